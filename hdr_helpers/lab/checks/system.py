"""Check of TODO 3.3, the matrix of the least-squares problem.

|A x - b|^2 must be the paper's objective for every x, in whatever order the rows stand. Chosen weights, lambda and x
leave one of its terms alone, which tells the term that is wrong; and a list of what a known mistake would give at
random x tells the mistake.
"""

import numpy as np
from scipy.sparse import issparse

from hdr_helpers.lab.checks._running import Wrong
from hdr_helpers.lab.checks._todos import Todo
from hdr_helpers.lab.checks._words import KINDS, described, finite, several

LEVELS, MIDDLE = 256, 128


def _residual(x, Z, B, lam, w):
    """Everything that the objective squares, for the unknowns x, (256 + N,)."""
    g, log_E = x[:LEVELS], x[LEVELS:]
    data = w[Z] * (g[Z] - log_E[:, None] - B)
    return np.concatenate([data.ravel(), g[MIDDLE : MIDDLE + 1], lam * w[1:-1] * np.diff(g, 2)])


def _course_build_system(Z, B, lam, w):
    """The matrix of an affine function, column by column: what changes when one unknown becomes 1."""
    Z, unknowns = np.asarray(Z), np.eye(LEVELS + len(Z))
    nothing = _residual(0 * unknowns[0], Z, B, lam, w)
    return np.stack([_residual(x, Z, B, lam, w) - nothing for x in unknowns], axis=1), -nothing


build_system = Todo(
    "3.3",
    "build_system",
    _course_build_system,
    uses=("hat", "sample_values"),
    barred=("crf",),
    hints=(
        "Take one squared term of the objective, for one i and one j. Which of the unknowns stand in it, and with what "
        "factor? That is one row.",
        "Which column belongs to g(z), and which to ln E of sample i? What stands in the row on the right side?",
        "Every entry of a row is squared together in the end. How often, then, may w stand in a row, and lambda?",
        "The smoothness rows have a middle z. What is the least z that has two neighbours, and the greatest? Whose "
        "weight do they take? And does every row get a row number of its own?",
    ),
    praise="A and b are the paper's objective. Next: solve it. Which rank do you expect A to have?",
)


class _System:
    """What a student's function makes of one problem; q(x) is |A x - b|^2."""

    def __init__(self, trial, Z, B, lam, w):
        A, b = several(trial.run(Z, B, lam, w), 2, "A and b")
        if issparse(A):
            A, trial.usable = A.toarray(), False
            trial.note("A is sparse, which is well; the figures below want an array, so they show the course's A.")
        for value, what in ((A, "A"), (b, "b")):
            if not isinstance(value, np.ndarray):
                raise Wrong(f"{what} is {described(value)}; it should be a NumPy array.")
            if value.dtype.kind != "f":
                raise Wrong(
                    f"{what} holds {value.dtype}; it should hold {KINDS['f']}, for an integer array cuts off what "
                    "stands behind the point of ln t and of lambda w."
                )
            finite(value, what)
        width = LEVELS + len(Z)
        if A.ndim != 2 or A.shape[1] != width:
            turned = A.ndim == 2 and A.shape[0] == width
            raise Wrong(f"A has shape {A.shape}; it needs {width} columns, 256 + N{', so it is transposed' * turned}.")
        if b.shape != (len(A),):
            raise Wrong(f"b has shape {b.shape}; it should have ({len(A)},), one number for each row of A.")
        self.A, self.b = np.array(A, np.float64), np.array(b, np.float64)

    def q(self, xs):
        return np.array([np.sum((self.A @ x - self.b) ** 2) for x in xs])

    @property
    def rows(self):
        return int(np.any(self.A != 0, axis=1).sum())


class _Problem:
    """N pixels in P photographs, weights without symmetry, a clipped pixel, and no value from 124 to 132."""

    def __init__(self, trial, key, N=13, P=5):
        rng = trial.rng(33, key)
        values = np.r_[0:124, 133:256]
        self.Z = np.sort(rng.choice(values, (N, P)), axis=1)
        self.Z[0] = 255
        self.B = np.log(0.004) + np.sort(rng.uniform(0, 6, P))
        self.w = rng.uniform(0.5, 3, LEVELS) + np.minimum(np.arange(LEVELS), 255 - np.arange(LEVELS)) / 40
        self.lam = float(rng.uniform(3, 6))
        self.xs = rng.standard_normal((5, LEVELS + N))


@build_system.part(1, "A and b have the right form.")
def _(trial):
    for key, N, P in ((0, 13, 5), (1, 9, 4)):
        p = _Problem(trial, key, N, P)
        _System(trial, p.Z, p.B, p.lam, p.w)


@build_system.part(2, "The data rows are w (g(Z) - ln E - ln t).")
def _(trial):
    p = _Problem(trial, 2)
    without = _System(trial, p.Z, p.B, 0.0, p.w)
    xs = p.xs.copy()
    xs[:, 124:133] = 0  # so that the gauge has no say, whatever column it stands in
    g, log_E = xs[:, :LEVELS], xs[:, LEVELS:, None]
    Z, B, w = p.Z, p.B, p.w[p.Z]

    def q(rows):
        return np.sum(np.square(rows), axis=(1, 2))

    yours, spec = without.q(xs), q(w * (g[:, Z] - log_E - B))
    trial.compare("data term", yours, spec)
    if np.allclose(yours, spec, rtol=1e-4):
        return
    up, hat = np.minimum(Z + 1, 255), np.minimum(np.arange(LEVELS), 255 - np.arange(LEVELS))
    says = {
        "The weight is missing from the data rows.": g[:, Z] - log_E - B,
        "The data rows hold the weight squared: a row is squared as a whole, so w belongs in it once.": w**2
        * (g[:, Z] - log_E - B),
        "b has no weight: w multiplies the whole equation, its right side too.": w * (g[:, Z] - log_E) - B,
        "The sign of ln E is wrong in the data rows: it stands in g(Z) - ln E - ln t.": w * (g[:, Z] + log_E - B),
        "The sign of b is wrong: ln t stands on the right side with a plus.": w * (g[:, Z] - log_E + B),
        "g has the weight, but ln E has none: w multiplies the whole equation.": w * (g[:, Z] - B) - log_E,
        "ln E has the weight, but g has none: w multiplies the whole equation.": w * (-log_E - B) + g[:, Z],
        "b is the time itself; B holds its logarithm, and that is what the equation asks for.": w
        * (g[:, Z] - log_E - np.exp(B)),
        "b is in stops, log2: the curve is one of natural logarithms.": w * (g[:, Z] - log_E - B / np.log(2)),
        "ln t is missing: b is 0 in the data rows.": w * (g[:, Z] - log_E),
        "Z + 1 was taken for Z, as in a language that counts from 1; and 255 has no place then.": p.w[up]
        * (g[:, up] - log_E - B),
        "The weight is that of Z + 1, not of Z.": p.w[up] * (g[:, Z] - log_E - B),
        "The weights are upside down: the middle values should count most.": (p.w.max() - p.w)[Z]
        * (g[:, Z] - log_E - B),
        "The weights are those of a hat, not those in w: use the argument.": hat[Z] * (g[:, Z] - log_E - B),
        "The column of ln E is one too far: sample i, counted from 0, has column 256 + i.": w
        * (g[:, Z] - np.roll(log_E, -1, axis=1) - B),
        "All samples share one column of ln E: each has a column of its own, 256 + i.": w
        * (g[:, Z] - log_E[:, :1] - B),
        "The column of ln E follows the photograph, not the sample.": w
        * (g[:, Z] - np.moveaxis(log_E[:, : len(B)], 1, 2) - B),
    }
    for sentence, rows in says.items():
        if np.allclose(yours, q(rows), rtol=1e-4):
            raise Wrong(sentence)
    if without.rows < p.Z.size:
        raise Wrong(
            f"There are {p.Z.size} samples in all photographs and {without.rows} rows for them: rows are missing, or "
            "written over each other; does the row counter go up after every row?"
        )
    last = without.A[:, LEVELS - 1 + len(p.Z)]
    if not last.any() or without.A[:, LEVELS:].any(axis=0).sum() < len(p.Z):
        raise Wrong("Some columns of ln E stay empty: sample i, counted from 0, has column 256 + i.")
    raise Wrong("The data rows are not w (g(Z) - ln E - ln t): look at one of them, for one i and one j.")


@build_system.part(1, "The gauge row holds g(128) = 0, and nothing else does.")
def _(trial):
    p = _Problem(trial, 3)
    system = _System(trial, p.Z, p.B, 0.0, p.w)
    unseen = np.arange(124, 133)  # no data row holds these: what they do, the gauge does
    places = np.flatnonzero(np.any(system.A[:, unseen] != 0, axis=0)) + 124
    trial.compare("gauge column", float(places[0]) if len(places) == 1 else 0.0, MIDDLE)
    if not len(places):
        raise Wrong(
            "The gauge row holds 0 or is missing: nothing says where g is 0, and one constant stays free; a 1 has to "
            "stand in column 128."
            if np.allclose(system.A[:, :LEVELS].sum(axis=1), -system.A[:, LEVELS:].sum(axis=1))
            else "The gauge row does not hold g(128): its 1 stands in a column far from 128."
        )
    if len(places) > 1:
        raise Wrong(f"More than one column has to do with the gauge: {', '.join(map(str, places))}; it is 128 alone.")
    rows = system.A[:, places[0]] != 0
    if np.any(system.b[rows] != 0):
        raise Wrong("The right side of the gauge row is not 0; g(128) = 0 has a 0 there.")
    if places[0] == MIDDLE - 1:
        trial.note("Your gauge is g(127) = 0; this course takes 128, and both are conventions.")
    elif places[0] != MIDDLE:
        raise Wrong(f"The gauge stands in column {places[0]}: g(128) has column 128 where one counts from 0.")


@build_system.part(2, "The smoothness rows are lambda w(z) g''(z) for z = 1 to 254.")
def _(trial):
    p = _Problem(trial, 4)
    with_it, without = (_System(trial, p.Z, p.B, lam, p.w) for lam in (p.lam, 0.0))
    xs = p.xs.copy()
    xs[:, LEVELS:] *= 3
    yours = with_it.q(xs) - without.q(xs)
    g, lam, w = xs[:, :LEVELS], p.lam, p.w
    left, mid, after, own = g[:, :-2], g[:, 1:-1], g[:, 2:], lam * w[1:-1]
    bend = left - 2 * mid + after

    def q(rows):
        return np.sum(np.square(rows), axis=1)

    right = own * bend
    spec = q(right)
    trial.compare("smoothness term", yours, spec)
    if np.allclose(yours, spec, rtol=1e-5):
        return
    over, around = xs[:, 254] - 2 * xs[:, 255] + xs[:, 256], xs[:, -1] - 2 * xs[:, 0] + xs[:, 1]
    hat = np.minimum(np.arange(LEVELS), 255 - np.arange(LEVELS))
    says = {
        "The smoothness rows start late: z = 1 has a left neighbour, g(0), and needs a row.": q(right[:, 1:]),
        "The smoothness rows end early: z = 254 has a right neighbour, g(255), and needs a row.": q(right[:, :-1]),
        "The smoothness rows start late and end early: z runs from 1 to 254.": q(right[:, 1:-1]),
        "The smoothness rows run one too far: z = 255 has no right neighbour, and column 256 is the first ln E.": spec
        + (lam * w[255] * over) ** 2,
        "The smoothness rows begin too early: z = 0 has no left neighbour, and column -1 is the last ln E.": spec
        + (lam * w[0] * around) ** 2,
        "The smoothness rows run too far at both ends: z is 1 to 254.": spec
        + (lam * w[255] * over) ** 2
        + (lam * w[0] * around) ** 2,
        "The smoothness rows have no weight: w(z) is missing from them.": q(lam * bend),
        "The smoothness row of z has the weight of z - 1: w(i) for w(i + 1).": q(lam * w[:-2] * bend),
        "The smoothness row of z has the weight of z + 1, not its own.": q(lam * w[2:] * bend),
        "The smoothness rows hold lambda squared: the row as a whole is squared already.": q(lam * right),
        "The smoothness rows hold the root of lambda; rows are multiplied by lambda itself.": q(right / lam**0.5),
        "The smoothness rows hold the weight squared: w belongs in a row once.": q(lam * w[1:-1] ** 2 * bend),
        "The middle of a smoothness row is +2: a second difference is 1, -2, 1.": q(own * (left + 2 * mid + after)),
        "The middle of a smoothness row is -1: a second difference is 1, -2, 1.": q(own * (left - mid + after)),
        "The smoothness rows hold a first difference; that asks for a flat curve, not for a smooth one.": q(
            own * (after - mid)
        ),
        "The smoothness rows hold a first difference; that asks for a flat curve, not a smooth one.": q(
            own * (mid - left)
        ),
        "The smoothness rows have the weights of a hat, not those in w: use the argument.": q(lam * hat[1:-1] * bend),
    }
    for sentence, value in says.items():
        if np.allclose(yours, value, rtol=1e-5):
            raise Wrong(sentence)
    if np.allclose(yours, 0):
        raise Wrong("Lambda changes nothing: it is missing from the smoothness rows, or they are missing from A.")
    rows = with_it.rows - without.rows
    if rows < LEVELS - 2:
        raise Wrong(
            f"{rows} smoothness rows hold anything where 254 should: one was written over another row; does the row "
            "counter go up after the gauge row, and after each of these?"
        )
    raise Wrong("The smoothness rows are not lambda w(z) (1, -2, 1): look at the one for z = 1.")


@build_system.part(1, "Each call starts afresh, for another channel and other times.")
def _(trial):
    first, second = _Problem(trial, 5), _Problem(trial, 6)
    before = _System(trial, first.Z, first.B, first.lam, first.w)
    other = _System(trial, second.Z, second.B, second.lam, second.w)
    again = _System(trial, first.Z, first.B, first.lam, first.w)
    doubled = _System(trial, first.Z, first.B + np.log(2), first.lam, first.w)
    if not (np.allclose(before.A, again.A) and np.allclose(before.b, again.b)):
        raise Wrong("A is kept between channels: what one call wrote is still there in the next; make A inside.")
    if not np.allclose(other.A[:, :LEVELS].any(axis=0)[np.unique(second.Z)], True):
        raise Wrong("The second channel's values are not in its A; is A made inside the function?")
    if np.allclose(doubled.b, again.b) or not np.allclose(doubled.A, again.A):
        raise Wrong("Twice the times should change b and leave A alone.")
