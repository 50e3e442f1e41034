"""How noisy each pixel value is, found from how far neighbouring photographs of a bracket disagree.

After M. Granados and others, Optimal HDR Reconstruction with Linear Digital Cameras, CVPR 2010, and P. Hanji and
others, Noise-Aware Merging of High Dynamic Range Image Stacks without Camera Calibration, 2020: the best weight of a
measurement is the inverse of its variance, and that follows from how a sensor works. In exposure X = exp(g(z)),
counted so that X is 1 at white, a pixel value has the variance

    V(z) = a X + b + s^2 (dX/dz)^2:

a X is shot noise (photons arrive at random), b the noise of reading the sensor, and s what moves the pixel value
itself: rounding, 1/12, and JPEG, which errs by a level or two whatever the value is. Camera data are not needed: of
two photographs the longer says what the shorter should show, and a, b and s^2 are fitted to how far it does not.
"""

import numpy as np
from scipy.optimize import nnls

from hdr_helpers.crf import CLIPPED, LEVELS, RINGING

JUDGES = slice(5, 230)  # values of the longer photograph by which the shorter one is judged
OUTLIER = 3  # standard deviations: what is farther off counts as if it were not
ROUNDS = 8
START = np.array([1e-4, 1e-7, 1.0])  # a, b, s^2 of some camera
LEAST = np.array([1e-9, 1e-12, 1 / 12])
FRAYED = 1e-3  # share of almost white pixels that are clipped ones
BEYOND = np.log(1.5)  # by how much, ln exposure, a pixel must have been clipped to be sure of it


def frayed_white(joints, log_times, crf) -> bool:
    """Whether clipped pixels read other values than 255, as JPEG leaves them.

    joints : (P - 1, 3, 256, 256) counts of the values of each photograph and the next longer one
    log_times : (P,) ln seconds, ascending; crf : (3, 256)
    The next shorter photograph knows: where it says that the light was half as much again as white is, a value in
    230..254 is no measurement.
    """
    almost, clipped = 0.0, 0.0
    for step, channels in zip(np.diff(log_times), joints, strict=True):
        for g, counts in zip(crf, channels, strict=True):
            near_white = counts[:, CLIPPED - RINGING : LEVELS - 1]
            almost += near_white.sum()
            clipped += near_white[g + step > g[-1] + BEYOND].sum()
    return bool(clipped > FRAYED * almost)


def exposure_variance(joints, log_times, crf) -> np.ndarray:
    """Variance of the exposure exp(crf) that each pixel value stands for, (3, 256) float64.

    joints, log_times, crf : as for frayed_white
    """
    X = np.exp(crf - crf[:, -1:])
    slope = np.gradient(X, axis=1)
    ratios = np.round(np.exp(np.diff(log_times)), 3)
    terms, squares, counts, expected = [], [], [], []
    for ratio in np.unique(ratios):  # pairs with one ratio are one pair, photographed several times
        for c, joint in enumerate(joints[ratios == ratio].sum(axis=0)[:, :, JUDGES]):
            shorter, longer = np.nonzero(joint)
            x = X[c] / ratio
            # V(X_short) + V(X_long) / ratio^2, for each value of the longer one
            each = [x + x / ratio, np.full(LEVELS, 1 + 1 / ratio**2),
                    np.interp(x, X[c], slope[c]) ** 2 + (slope[c] / ratio) ** 2]  # fmt: skip
            at = longer + JUDGES.start
            terms.append(np.stack(each, axis=1)[at])
            squares.append((X[c, shorter] - x[at]) ** 2)
            counts.append(joint[shorter, longer])
            expected.append(x[at])
    fit = START
    if sum(map(len, counts)) > 0:
        fit = _fitted(*map(np.concatenate, (terms, squares, counts, expected)))
    variance = fit[0] * X + fit[1] + fit[2] * slope**2
    return variance * np.exp(2 * crf[:, -1:])


def _fitted(terms, squares, counts, expected) -> np.ndarray:
    """a, b and s^2 by least squares, none negative; each square is judged by what the fit before expected of it."""
    fit = START
    for _ in range(ROUNDS):
        predicted = terms @ fit
        bright = expected > 2 * np.sqrt(predicted)  # darker ones are cut off at zero light and scatter less
        trust = np.sqrt(counts) / predicted * (bright if bright.any() else 1)
        matrix = terms * trust[:, None]
        scale = np.linalg.norm(matrix, axis=0)
        wanted = np.minimum(squares, OUTLIER**2 * predicted) * trust
        fit = nnls((matrix / scale).T @ (matrix / scale), (matrix / scale).T @ wanted)[0] / scale
        fit = np.maximum(fit, LEAST)
    return fit
