"""Answers to the TODOs of notebook 3 except for the matrix and the plot."""

import cv2
import numpy as np
import scipy.linalg
from mistakes.corpus import answer, right, slip, wrong
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve

answer(
    "3.1",
    """
    def hat():
        w = np.zeros(256)
        for z in range(256):
            w[z] = min(z, 255 - z)
        return w
    """,
)
slip("3.1", "weight 1", "min(z, 255 - z)", "min(z, 255 - z) + 1")
slip("3.1", "not symmetric", "min(z, 255 - z)", "z if z <= 128 else 255 - z")
slip("3.1", "from 256", "min(z, 255 - z)", "min(z, 256 - z)")
slip("3.1", "on its head", "min(z, 255 - z)", "abs(z - 127.5) - 0.5")
slip("3.1", "never falls", "min(z, 255 - z)", "z")
slip("3.1", "equal", "min(z, 255 - z)", "1")
slip("3.1", "integer", "np.zeros(256)", "np.zeros(256, dtype=int)")
slip("3.1", "(255,)", "np.zeros(256)", "np.zeros(255)", "range(256)", "range(255)")
slip("3.1", "list", "return w", "return list(w)")
slip("3.1", "None", "return w", "w")
slip("3.1", None, "min(z, 255 - z)", "min(z, 255 - z) / 127", fine=True)


@wrong("3.1", says="calls hat_weights,")
def hat_of_the_course():
    from hdr_helpers import hat_weights

    return hat_weights()


@wrong("3.1", says="equation 4")
def a_bell():
    return np.exp(-((np.arange(256) - 127.5) ** 2) / 5000)


@right("3.1")
def single_precision_by_absolute_value():
    return (127.5 - np.abs(np.arange(256, dtype=np.float32) - 127.5)).astype(np.float32)


answer(
    "3.2",
    """
    def sample_values(images, rows, cols, channel):
        Z = np.zeros((len(rows), len(images)), dtype=int)
        for j, image in enumerate(images):
            for i in range(len(rows)):
                Z[i, j] = image[rows[i], cols[i], channel]
        return Z
    """,
)
slip("3.2", "transposed", "return Z", "return Z.T")
slip("3.2", "Rows and columns", "rows[i], cols[i]", "cols[i], rows[i]")
slip("3.2", "always 1", "cols[i], channel", "cols[i], 1")
slip("3.2", "Red and blue", "cols[i], channel", "cols[i], 2 - channel")
slip("3.2", "first column", "cols[i], channel", "0, channel")
slip("3.2", "one column", "cols[i], channel", "cols[0], channel")
slip("3.2", "first photograph", "image[rows", "images[0][rows")
slip("3.2", "rows of Z were sorted", "return Z", "return np.sort(Z, axis=1)")
slip("3.2", "reverse", "return Z", "return Z[:, ::-1]")
slip(
    "3.2",
    "averages",
    "image[rows[i], cols[i], channel]",
    "image[rows[i] - 1 : rows[i] + 2, cols[i] - 1 : cols[i] + 2, channel].mean()",
)
slip("3.2", "averages", "image[rows", "cv2.GaussianBlur(image, (3, 3), 0)[rows")
slip("3.2", "integers", "dtype=int", "dtype=float")
slip("3.2", "none of the photographs", "return Z", "return Z + 1")


@wrong("3.2", says="averages")
def shrunk_to_ten_by_ten(images, rows, cols, channel):
    small = [cv2.resize(image, (10, 10), interpolation=cv2.INTER_AREA)[..., channel].ravel() for image in images]
    return np.stack(small, axis=1)


@wrong("3.2", says="every row with every column")
def crossed(images, rows, cols, channel):
    return np.stack([image[np.ix_(rows, cols)][..., channel] for image in images], axis=-1)


@right("3.2")
def transposed_list(images, rows, cols, channel):
    return np.array([image[..., channel][rows, cols] for image in images]).T


answer(
    "3.4",
    """
    def my_gsolve(Z, B, lam, w):
        A, b = build_system(Z, B, lam, w)
        x = np.linalg.lstsq(A, b, rcond=None)[0]
        g = x[:256]
        log_E = x[256:]
        return g, log_E
    """,
)
slip("3.4", "cut to 255", "x[:256]", "x[:255]")
slip("3.4", "cut to 255", "x[:256]", "x[1:256]")
slip("3.4", "lacks one", "x[256:]", "x[257:]")
slip("3.4", "swapped", "return g, log_E", "return log_E, g")
slip("3.4", "log_E was returned as g", "return g, log_E", "return log_E, log_E")
slip("3.4", "exp(g)", "return g, log_E", "return np.exp(g), log_E")
slip("3.4", "log2", "return g, log_E", "return g / np.log(2), log_E")
slip("3.4", "wrong sign", "return g, log_E", "return -g, log_E")
slip("3.4", "log_E is not", "return g, log_E", "return g, np.exp(log_E)")
slip("3.4", "seconds", "(Z, B, lam, w)\n    x", "(Z, np.exp(B), lam, w)\n    x")
slip("3.4", "The smoothness is 10", "(Z, B, lam, w)\n    x", "(Z, B, 10, w)\n    x")
slip(
    "3.4",
    "always the hat",
    "(Z, B, lam, w)\n    x",
    "(Z, B, lam, np.minimum(np.arange(256.0), 255 - np.arange(256.0)))\n    x",
)
slip("3.4", "AttributeError", "rcond=None)[0]", "rcond=None)[0].x")
slip("3.4", "one dimension", "lstsq(A, b,", "lstsq(A, b[:, None],")
slip("3.4", "g(128)", "return g, log_E", "return g - g[0], log_E - g[0]")
slip("3.4", "LinAlgError", "np.linalg.lstsq(A, b, rcond=None)[0]", "np.linalg.solve(A, b)")
slip("3.4", "2 things", "return g, log_E", "return x")
slip("3.4", "None", "return g, log_E", "g, log_E")
slip("3.4", None, "np.linalg.lstsq(A, b, rcond=None)[0]", "np.linalg.solve(A.T @ A, A.T @ b)", fine=True)
slip("3.4", None, "np.linalg.lstsq(A, b, rcond=None)[0]", "np.linalg.pinv(A) @ b", fine=True)
slip("3.4", None, "lstsq(A, b,", "lstsq(A.astype(np.float32), b.astype(np.float32),", fine=True)


@wrong("3.4", says="calls gsolve,")
def the_courses_gsolve(Z, B, lam, w):
    import hdr_helpers

    try:
        return hdr_helpers.gsolve(Z, B, lam, w)
    except Exception:
        return np.zeros(256), np.zeros(len(Z))


def whole_matrix(Z, B, lam, w):
    N, P = Z.shape
    rows, weights = np.arange(N * P), w[Z.ravel()]
    A = np.zeros((N * P + 255, 256 + N))
    A[rows, Z.ravel()], A[rows, 256 + rows // P] = weights, -weights
    A[N * P, 128] = 1
    A[N * P + 1 :, :256] = lam * w[1:-1, None] * np.diff(np.eye(256), 2, axis=0)
    return A, np.r_[weights * np.tile(B, N), np.zeros(255)]


@right("3.4")
def by_qr(Z, B, lam, w):
    A, b = whole_matrix(Z, B, lam, w)
    Q, R = scipy.linalg.qr(A, mode="economic")
    x = scipy.linalg.solve_triangular(R, Q.T @ b)
    return x[:256], x[256:]


@right("3.4")
def by_sparse_normal_equations(Z, B, lam, w):
    A, b = whole_matrix(Z, B, lam, w)
    A = csr_matrix(A)
    x = spsolve((A.T @ A).tocsc(), A.T @ b)
    return np.split(x, [256])


answer(
    "3.5",
    """
    def my_crf(images, B, lam, w, rows, cols):
        crf = np.zeros((3, 256))
        for c in range(3):
            Z = sample_values(images, rows, cols, c)
            g, log_E = my_gsolve(Z, B, lam, w)
            crf[c] = g
        return crf
    """,
)
slip("3.5", "that of green", "cols, c)", "cols, 1)")
slip("3.5", "Red and blue", "cols, c)", "cols, 2 - c)")
slip("3.5", "transposed", "return crf", "return crf.T")
slip("3.5", "exp(g)", "= g\n", "= np.exp(g)\n")
slip("3.5", "averaged", "return crf", "return np.tile(crf.mean(axis=0), (3, 1))")
slip("3.5", "integer", "np.zeros((3, 256))", "np.zeros((3, 256), dtype=int)")
slip("3.5", "ValueError", "= g\n", "= g, log_E\n")
slip("3.5", "seconds", "(Z, B, lam, w)\n", "(Z, np.exp(B), lam, w)\n")
slip("3.5", "is kept", "cols, c)", "cols, c)\n        rows, cols = rows[5:], cols[5:]")
slip("3.5", "is kept", "            crf[c] = g".strip(), "B = B + g[200]; w = w * 0 + 1; lam = 3 * lam; crf[c] = g")
slip("3.5", "list", "return crf", "return list(crf)")


@wrong("3.5", says="rows and cols")
def samples_of_its_own(images, B, lam, w, rows, cols):
    rows, cols = np.random.default_rng(3).integers(0, 40, (2, 60))
    return stacked(images, B, lam, w, rows, cols)


@right("3.5")
def stacked(images, B, lam, w, rows, cols):
    def one(c):
        A, b = whole_matrix(np.array([image[rows, cols, c] for image in images]).T, B, lam, w)
        return np.linalg.lstsq(A, b, rcond=None)[0][:256]

    return np.vstack(list(map(one, range(3))))
