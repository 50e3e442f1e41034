"""Checks of notebook 3 except for the matrix: weights, samples, the solution, three channels, the plot."""

from functools import cache

import numpy as np

from hdr_helpers.crf import gsolve, hat_weights
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.checks._running import Wrong
from hdr_helpers.lab.checks._todos import Todo
from hdr_helpers.lab.checks._words import array, close, finite, recognised, several

LEVELS = 256

hat = Todo(
    "3.1",
    "hat",
    hat_weights,
    barred=("crf",),
    hints=(
        "How many values can a pixel have, and which is the first?",
        "What is the distance of z from the nearer end? np.minimum compares two arrays, element by element.",
        "Is your array one of floats? What will be multiplied with it later?",
    ),
    praise="That is the hat. What would happen to a clipped pixel if the weight at 255 were 1?",
)


@hat.part(1, "It returns 256 floats.")
def _(trial):
    w = array(trial.run(), "The weights", (LEVELS,), "f")
    finite(w, "the weights")


@hat.part(1, "The weights are 0 at both ends and rise by 1 to the middle.")
def _(trial):
    w, z = trial.run(), np.arange(LEVELS)
    spec = np.minimum(z, 255 - z)
    trial.compare("w", w, spec)
    if close(w, spec):
        return
    if w.max() > 0 and close(w * (127 / w.max()), spec, 1e-5):
        trial.note("Your hat is the paper's times a constant; the curve will be the same, for all rows share it.")
        return
    raise Wrong(
        recognised(
            w,
            {
                "The ends have weight 1: a clipped pixel, 255, would count.": spec + 1,
                "The hat stands on its head: it is largest at the ends.": 127 - spec,
                "It is not symmetric: 127 and 128 are equally far from their ends, and both have weight 127.": np.where(
                    z <= 128, z, 255 - z
                ),
                "It falls from 256, not from 255: the greatest value of a pixel is 255.": np.minimum(z, 256 - z),
                "It never falls again: the second half is missing.": z,
                "All weights are equal; a hat trusts the middle most.": np.ones(LEVELS),
            },
            f"w(0), w(1), w(127), w(128), w(255) are {', '.join(f'{v:.4g}' for v in w[[0, 1, 127, 128, 255]])}; "
            "by equation 4 they are min(z, 255 - z).",
        )
    )


def _course_sample_values(images, rows, cols, channel):
    return np.array(images)[:, rows, cols, channel].T


sample_values = Todo(
    "3.2",
    "sample_values",
    _course_sample_values,
    barred=("crf",),
    hints=(
        "What does one photograph give for all positions at once? NumPy takes two arrays of integers as an index.",
        "Which of rows and cols comes first in the index of a picture?",
        "A row of Z belongs to a pixel, a column to a photograph: along which axis do you join the photographs?",
    ),
    praise="Right: points, not averages. What would a row of Z look like in which something moved?",
)


def _photographs(trial, key, N=7, P=4):
    """Photographs that hold even values only, three channels without a value in common, and positions in them."""
    rng = trial.rng(32, key)
    images = [rng.integers(0, 42, (17, 23, 3), dtype=np.uint8) * 6 + np.array([0, 2, 4], np.uint8) for _ in range(P)]
    return images, rng.integers(1, 16, N), rng.integers(1, 16, N)


@sample_values.part(1, "Z has a row for each pixel, a column for each photograph, and holds integers.")
def _(trial):
    images, rows, cols = _photographs(trial, 1)
    Z = trial.run(images, rows, cols, 1)
    if isinstance(Z, np.ndarray) and Z.dtype.kind in "iuf" and np.any(np.mod(Z, 2)):
        raise Wrong("Some values stand in none of the photographs: take points, never averages, nor anything added.")
    if isinstance(Z, np.ndarray) and Z.shape == (7, 7, 4):
        raise Wrong("Z has every row with every column; position k is (rows[k], cols[k]), one pixel.")
    array(Z, "Z", (7, 4), "iu")


@sample_values.part(1, "Its values are those of the pixels, in any channel.")
def _(trial):
    for key, channel in ((2, 0), (3, 2), (4, 1)):
        images, rows, cols = _photographs(trial, key)
        Z, stack = trial.run(images, rows, cols, channel), np.array(images)
        spec = _course_sample_values(images, rows, cols, channel)
        trial.compare("Z", Z, spec)
        if close(Z, spec):
            continue
        suspects = {
            "Rows and columns are swapped: a picture is indexed [row, column].": stack[:, cols, rows, channel].T,
            "The rows of Z were sorted: a value then stands under another photograph's time.": np.sort(spec, axis=1),
            "The columns of Z were sorted: a value then stands in another pixel's row.": np.sort(spec, axis=0),
            "The photographs come in reverse order.": spec[:, ::-1],
            "Red and blue are swapped: channel 0 is red here.": stack[:, rows, cols, 2 - channel].T,
            "Every sample comes from the first column of the picture; cols is not used.": stack[:, rows, 0, channel].T,
            "All samples come from one column of the picture; cols says one for each.": stack[
                :, rows, cols[0], channel
            ].T,
            "All samples come from one row of the picture; rows says one for each.": stack[:, rows[0], cols, channel].T,
            "Every column of Z holds the first photograph.": np.repeat(spec[:, :1], len(images), axis=1),
        }
        for other in range(3):
            suspects[f"The channel is always {other}, whatever is asked for."] = stack[:, rows, cols, other].T
        raise Wrong(recognised(Z, suspects, f"Z[0] is {Z[0].tolist()}; the pixel has {spec[0].tolist()}."))


my_gsolve = Todo(
    "3.4",
    "my_gsolve",
    gsolve,
    uses=("hat", "sample_values", "build_system"),
    barred=("crf",),
    hints=(
        "Which function of the notebook makes A and b, and which of NumPy makes |A x - b|^2 smallest?",
        "np.linalg.lstsq returns four things. Which one is x?",
        "x holds 256 + N numbers. Which are g, and where does ln E begin, counted from 0?",
    ),
    praise="g and ln E are right. Look at the figure below: do all samples lie on one curve?",
)


@cache
def _samples(seed, key, N, P=7):
    """Samples of one channel of the virtual camera: Z (N, P), B; every pixel usable somewhere, some clipped."""
    rng, camera, channel = np.random.default_rng((seed, 34, key)), Camera(), key % 3
    stops = np.cumsum(rng.uniform(0.7, 1.5, P))
    exposure = np.exp2(rng.uniform(-9, -1, N)[:, None] + stops - stops[P // 2])
    Z = np.rint(camera.respond(exposure, channel) * 255 + 0.3 * rng.standard_normal((N, P)))
    return np.clip(Z, 0, 255).astype(np.intp), np.log(2) * (stops - 8)


@cache
def _solution(seed, key, N, lam, w):
    return gsolve(*_samples(seed, key, N), lam, np.array(w))


def _solved(trial, Z, B, lam, w):
    g, log_E = several(trial.run(Z, B, lam, w), 2, "g and log_E")
    N = len(Z)
    for value in (g, log_E):
        if isinstance(value, np.ndarray) and value.ndim == 2:
            raise Wrong(f"An array has shape {value.shape}; g is (256,) and log_E ({N},), each with one dimension.")
    if np.shape(g) == (N,) and np.shape(log_E) == (LEVELS,):
        raise Wrong("g and log_E are swapped: g, the curve, has 256 values and comes first.")
    if np.shape(g) == (LEVELS - 1,):
        raise Wrong("g was cut to 255 values; 0 to 255 are 256 of them, x[:256].")
    if np.shape(log_E) == (N - 1,):
        raise Wrong("log_E lacks one sample: it begins with x[256], right behind g.")
    if np.shape(g) == (N,):
        raise Wrong("log_E was returned as g: g is the first 256 unknowns.")
    for value, what, shape in ((g, "g", (LEVELS,)), (log_E, "log_E", (N,))):
        finite(array(value, what, shape, "f"), what)
    return g, log_E


@my_gsolve.part(1, "g has 256 values, log_E one for each sample.")
def _(trial):
    Z, B = _samples(trial.seed, 1, 61)
    _solved(trial, Z, B, 20.0, hat_weights())


@my_gsolve.part(2, "g and log_E make the paper's objective smallest, for several weights and lambdas.")
def _(trial):
    for key, lam, w in ((1, 20.0, hat_weights()), (2, 5.0, np.ones(LEVELS)), (3, 60.0, hat_weights() + 1)):
        Z, B = _samples(trial.seed, key, 50 + 9 * key)
        g, log_E = _solved(trial, Z, B, lam, w)
        spec, spec_E = _solution(trial.seed, key, len(Z), lam, tuple(w))
        trial.compare("g", g, spec)
        trial.compare("log_E", log_E, spec_E)
        if close(g, spec, 2e-3) and close(log_E, spec_E, 2e-3):
            continue
        if abs(g[128]) > 2e-3 and close(g - g[128], spec, 2e-3):
            raise Wrong(f"g has the right shape, but g(128) = {g[128]:.3f}: the gauge is not 0.")
        wrong = {
            "It is exp(g) that is returned; g itself is a logarithm.": np.exp(spec),
            "g is in stops, log2; natural logarithms go all the way in this course.": spec / np.log(2),
            "g has the wrong sign: more exposure gives larger values.": -spec,
            "The seconds went in where their logarithm should.": gsolve(Z, np.exp(B), lam, w)[0],
            "The weights are always the hat; use those that are given.": gsolve(Z, B, lam, hat_weights())[0],
        }
        for other in (0.1, 1.0, 5.0, 10.0, 20.0, 50.0, 60.0, 100.0):
            if other != lam and close(g, gsolve(Z, B, other, w)[0], 2e-3):
                raise Wrong(f"The smoothness is {other:g} where {lam:g} was given: use the argument.")
        if close(g, spec, 2e-3):
            raise Wrong("g is right and log_E is not: log_E is the rest of x, from 256 on.")
        raise Wrong(recognised(g, wrong, "g is not what makes the objective smallest.", 2e-3))


@my_gsolve.part(1, "Twice the times leave g alone and lower log_E by ln 2.")
def _(trial):
    Z, B = _samples(trial.seed, 4, 47)
    (g, log_E), (g2, log_E2) = (_solved(trial, Z, times, 20.0, hat_weights()) for times in (B, B + np.log(2)))
    trial.compare("g, all times doubled", g2, g)
    if not close(g, g2, 2e-3):
        raise Wrong("Twice the times move g: is the logarithm of the time taken twice, or not at all?")
    if not close(log_E - np.log(2), log_E2, 2e-3):
        raise Wrong("Twice the times should lower log_E by ln 2: the same values, from half of the light.")
