"""Answers to TODO 3.3, the matrix."""

import numpy as np
from mistakes.corpus import answer, right, slip, wrong
from scipy.sparse import lil_matrix

answer(
    "3.3",
    """
    def build_system(Z, B, lam, w):
        N, P = Z.shape
        A = np.zeros((N * P + 1 + 254, 256 + N))
        b = np.zeros(A.shape[0])
        k = 0
        for i in range(N):
            for j in range(P):
                wij = w[Z[i, j]]
                A[k, Z[i, j]] = wij
                A[k, 256 + i] = -wij
                b[k] = wij * B[j]
                k += 1
        A[k, 128] = 1
        k = k + 1
        for i in range(1, 255):
            A[k, i - 1] = lam * w[i]
            A[k, i] = -2 * lam * w[i]
            A[k, i + 1] = lam * w[i]
            k += 1
        return A, b
    """,
)
WIDER = "A = np.zeros((N * P + 1 + 254,", "A = np.zeros((N * P + 1 + 260,"
FIRST, MIDDLE, LAST = "A[k, i - 1] = lam * w[i]", "= -2 * lam * w[i]", "A[k, i + 1] = lam * w[i]"


def weighted(says, weight):
    """All three entries of a smoothness row with another weight."""
    new = FIRST.replace("lam * w[i]", weight), MIDDLE.replace("lam * w[i]", weight), LAST.replace("lam * w[i]", weight)
    slip("3.3", says, FIRST, new[0], MIDDLE, new[1], LAST, new[2])


# The gauge.
slip("3.3", "gauge row holds 0", "A[k, 128] = 1", "A[k, 128] = 0")
slip("3.3", "gauge row holds 0", "A[k, 128] = 1", "b[k] = 0")
slip("3.3", "column 129", "A[k, 128] = 1", "A[k, 129] = 1")
slip("3.3", None, "A[k, 128] = 1", "A[k, 127] = 1", fine=True)
slip("3.3", "far from 128", "A[k, 128] = 1", "A[k, 0] = 1")
slip("3.3", "right side of the gauge", "A[k, 128] = 1", "A[k, 128] = 1; b[k] = 1")
slip("3.3", None, "A[k, 128] = 1", "A[k, 128] = w[128]", fine=True)
# The smoothness.
slip("3.3", "start late", "range(1, 255)", "range(2, 255)")
slip("3.3", "end early", "range(1, 255)", "range(1, 254)")
slip("3.3", "start late and end early", "range(1, 255)", "range(2, 254)")
slip("3.3", "one too far", "range(1, 255)", "range(1, 256)", *WIDER)
slip("3.3", "too early", "range(1, 255)", "range(0, 255)", *WIDER)
slip("3.3", "IndexError", "range(1, 255)", "range(1, 256)")
weighted("no weight", "lam")
weighted("w(i) for w(i + 1)", "lam * w[i - 1]")
weighted("weight of z + 1", "lam * w[i + 1]")
weighted("lambda squared", "lam ** 2 * w[i]")
weighted("Lambda changes nothing", "w[i]")
weighted("weight squared", "lam * w[i] ** 2")
slip("3.3", "middle of a smoothness row is +2", MIDDLE, "= 2 * lam * w[i]")
slip("3.3", "middle of a smoothness row is -1", MIDDLE, "= -lam * w[i]")
slip("3.3", "first difference", LAST, "pass", MIDDLE, "= -lam * w[i]")
slip("3.3", "row counter", "w[i]\n        k += 1\n", "w[i]\n")
slip("3.3", "row counter", "    k = k + 1\n", "")
# The data.
slip("3.3", "row counter", "B[j]\n            k += 1\n", "B[j]\n")
slip("3.3", "row counter", "B[j]\n            k += 1\n", "B[j]\n        k += 1\n")
slip("3.3", "weight squared", "wij = w[Z[i, j]]", "wij = w[Z[i, j]] ** 2")
slip("3.3", "weight is missing", "wij = w[Z[i, j]]", "wij = 1.0")
slip("3.3", "b has no weight", "b[k] = wij * B[j]", "b[k] = B[j]")
slip("3.3", "sign of ln E", "= -wij", "= wij")
slip("3.3", "sign of b", "b[k] = wij", "b[k] = -wij")
slip("3.3", "ln E has none", "= -wij", "= -1")
slip("3.3", "time itself", "wij * B[j]", "wij * np.exp(B[j])")
slip("3.3", "log2", "wij * B[j]", "wij * B[j] / np.log(2)")
slip("3.3", "NaN", "wij * B[j]", "wij * np.log(B[j])")
slip("3.3", "ln t is missing", "b[k] = wij * B[j]", "pass")
slip("3.3", "weight is that of Z + 1", "w[Z[i, j]]", "w[min(Z[i, j] + 1, 255)]")
slip("3.3", "Z + 1 was taken", "N, P = Z.shape", "N, P = Z.shape; Z = np.minimum(Z + 1, 255)")
slip("3.3", "upside down", "w[Z[i, j]]", "w.max() - w[Z[i, j]]")
slip("3.3", "those of a hat", "w[Z[i, j]]", "min(Z[i, j], 255 - Z[i, j])")
slip("3.3", "columns", "A[k, 256 + i]", "A[k, 257 + i]", "256 + N))", "257 + N))")
slip("3.3", "256 + i", "A[k, 256 + i]", "A[k, 255 + i]")
slip("3.3", "IndexError", "A[k, 256 + i]", "A[k, 257 + i]")
slip("3.3", "share one column", "A[k, 256 + i]", "A[k, 256]")
slip("3.3", "follows the photograph", "A[k, 256 + i]", "A[k, 256 + j]")
slip("3.3", "integer", "256 + N))", "256 + N), dtype=int)")
slip("3.3", "integer", "np.zeros(A.shape[0])", "np.zeros(A.shape[0], int)")
slip("3.3", "shape", "np.zeros(A.shape[0])", "np.zeros((A.shape[0], 1))")
slip("3.3", "A and b", "return A, b", "return A")
slip("3.3", "None", "return A, b", "A, b")
slip("3.3", "changes the arrays", "N, P = Z.shape", "Z.sort(); B -= B.mean(); N, P = Z.shape")

KEPT = np.zeros((4000, 256 + 100))


@wrong("3.3", says="256 + N")
def a_global_matrix(Z, B, lam, w):
    N, P = Z.shape
    b = np.zeros(len(KEPT))
    for k, (i, j) in enumerate(np.ndindex(N, P)):
        KEPT[k, Z[i, j]], KEPT[k, 256 + i], b[k] = w[Z[i, j]], -w[Z[i, j]], w[Z[i, j]] * B[j]
    return KEPT, b  # of one size for all


@wrong("3.3", says="kept between channels")
def a_default_matrix(Z, B, lam, w, A={}):  # noqa: B006
    N, P = Z.shape
    A = A.setdefault(Z.shape, np.zeros((N * P + 255, 256 + N)))
    b = np.zeros(N * P + 255)
    for k, (i, j) in enumerate(np.ndindex(N, P)):
        A[k, Z[i, j]], A[k, 256 + i], b[k] = w[Z[i, j]], -w[Z[i, j]], w[Z[i, j]] * B[j]
    A[N * P, 128] = 1
    for z in range(1, 255):
        A[N * P + z, z - 1 : z + 2] = lam * w[z] * np.array([1, -2, 1])
    return A, b


@right("3.3")
def smoothness_first(Z, B, lam, w):
    N, P = Z.shape
    smooth = np.zeros((254, 256 + N))
    smooth[:, :256] = lam * w[1:255, None] * np.diff(np.eye(256), 2, axis=0)
    gauge = np.eye(256 + N)[128:129] * 7
    rows, which = np.zeros((N * P, 256 + N)), np.repeat(np.arange(N), P)
    rows[np.arange(N * P), Z.ravel()] = -w[Z.ravel()]
    rows[np.arange(N * P), 256 + which] = w[Z.ravel()]
    b = np.concatenate([np.zeros(255), -w[Z.ravel()] * np.tile(B, N)])
    return np.vstack([gauge, smooth, rows]), b


@right("3.3")
def sparse(Z, B, lam, w):
    N, P = Z.shape
    A, b = lil_matrix((N * P + 255, 256 + N)), np.zeros(N * P + 255)
    for k, (j, i) in enumerate(np.ndindex(P, N)):
        A[k, Z[i, j]], A[k, 256 + i], b[k] = w[Z[i, j]], -w[Z[i, j]], w[Z[i, j]] * B[j]
    A[N * P, 128] = 1
    for z in range(1, 255):
        A[N * P + z, z - 1], A[N * P + z, z], A[N * P + z, z + 1] = lam * w[z], -2 * lam * w[z], lam * w[z]
    return A.tocsr(), b


@right("3.3")
def single_precision_backwards(Z, B, lam, w):
    A, b = smoothness_first(Z, B, lam, w)
    return A[::-1].astype(np.float32), b[::-1].astype(np.float32)
