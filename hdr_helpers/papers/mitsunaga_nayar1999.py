"""Radiometric self calibration: a response that is a polynomial, from exposure times that are only roughly known.

T. Mitsunaga and S. Nayar, CVPR 1999. Light is a polynomial f of the pixel value M. A pixel with the values M_q and
M_q+1 in two successive photographs obeys f(M_q) = R_q f(M_q+1), where R_q is the ratio of the two exposures. With the
ratios known, f follows by linear least squares; with f known, the ratios can be read from the pixels. The method goes
to and fro between the two, from what the camera says its times were, and repeats this for several orders.

Gauge. If f and the ratios fit, so do f^u and the ratios to the power u, for every u: photographs alone can't tell a
steep response and wide steps from a flat one and narrow steps. The times given therefore have to be right on average.
Here u is held at the median slope of log time given on log time found, so a single wrong time does not turn it.

Limits. A low order can't follow a curve that falls a hundredfold into the darks, and the error counts light, not its
logarithm: what is darkest has least say, and the lowest values may be a stop off or not even positive. The errors of
successive ratios add up, so that the three channels of a long bracket may find times a tenth or two apart.

Three things are done otherwise than in the paper. It fixes f at white, M = 1, which no usable pixel reaches, so that
noise is fitted best by an f that rises only beyond them: here the mean of f over the usable values is fixed. A ratio
is the ratio of sums of light, not the mean of ratios, which the darkest pixels would rule. And orders are compared by
the error of the logarithm, because the error of light hardly ever stops falling with the order.
"""

import numpy as np
import scipy.linalg
from scipy.stats import theilslopes

LEVELS = 256
MIDDLE = 128  # g[MIDDLE] = 0
USABLE = slice(5, 250)  # pixel values that are neither noise nor clipped, where the caller does not say
HIGHEST = 10  # order, as in the paper
ROUNDS = 100  # to and fro at most; mostly ten are enough
CONVERGED = 1e-7  # change of f, of which the mean is 1
FLOOR = 1e-5  # of the light of the middle value, where the polynomial is not positive


def radiometric_self_calibration(Z, times, w=None, order=None) -> tuple[np.ndarray, np.ndarray]:
    """Log inverse response of one channel, and exposure times set right.

    Z : (N, P) integers 0..255, values of N pixels in P photographs, shortest exposure first
    times : (P,) float, seconds, ascending; roughly right
    w : (256,) float, weight of each pixel value; what has 0 is not used, all else counts alike. The paper has no
        weights: the error counts light, which weighs the pixel values already. None takes 5..249
    order : of the polynomial, 1..10; None tries them all and takes the one with the smallest error

    Returns g, (256,) float64, natural logarithm of the polynomial with g[128] = 0, nowhere falling; and the refined
    times, (P,) float64, of which only the ratios mean anything: most stay as they are where one was wrong. Two
    photographs leave nothing to refine.
    Raises ValueError where shapes or values don't fit, and where neighbours share no usable pixel.

    >>> Z = np.array([(z, 2 * z, 4 * z, 8 * z) for z in range(5, 32)])  # a linear camera
    >>> g, times = radiometric_self_calibration(Z, [1, 2, 5, 8], order=1)  # one time is wrong
    >>> times.round(2).tolist()
    [1.0, 2.0, 4.0, 8.0]
    """
    Z, log_times, used, orders = _checked(Z, times, w, order)
    counts = _pairs(Z, used)
    best, least = None, np.inf
    for n in orders:
        light, log_ratios = _to_and_fro(counts, log_times, used, n)
        error = _log_error(light, log_ratios, counts)
        if error < least:
            best, least = (light, log_ratios), error
    if best is None:
        raise ValueError(
            f"No polynomial of order {orders[0]} to {orders[-1]} explains these pixels: check that the photographs go "
            "from the shortest exposure to the longest, and that they lie on each other."
        )
    light, log_ratios = best
    found = _log_times(log_ratios)
    found += np.median(log_times - found)
    return _rising_logarithm(light), np.exp(found)


def _pairs(Z, used) -> np.ndarray:
    """(P - 1, 256, 256) counts of the pixels with each pair of usable values in two successive photographs."""
    counts = []
    for k, (shorter, longer) in enumerate(zip(Z.T[:-1], Z.T[1:], strict=True), 1):
        joint = np.bincount(shorter.astype(np.intp) * LEVELS + longer, minlength=LEVELS**2)
        counts.append(joint.reshape(LEVELS, LEVELS) * np.outer(used, used).astype(np.float64))
        if not counts[-1].any():
            raise ValueError(
                f"Photographs {k} and {k + 1} share no pixel with usable values in both, so nothing ties their "
                "exposures together; take photographs one to three stops apart."
            )
    return np.array(counts)


def _to_and_fro(counts, log_times, used, order) -> tuple[np.ndarray, np.ndarray]:
    """Light of each pixel value, (256,), as a polynomial of one order, and the log ratios, (P - 1,), that go with it.

    Polynomial and ratios are found in turn from each other until the polynomial stays as it is.
    The ratios are NaN where that leads nowhere: to light that falls where pixel values rise or exposures get longer.
    """
    # Chebyshev polynomials span the same curves as powers of M, and the equations keep their digits.
    basis = np.polynomial.chebyshev.chebvander(np.linspace(-1, 1, LEVELS), order)
    basis[:, 1:] -= basis[used, 1:].mean(axis=0)  # so that f = 1 + c_1 basis_1 + ... has mean 1, whatever c is
    shorter, longer = counts.sum(axis=2), counts.sum(axis=1)
    squares = [np.einsum("zm,kz,zn->kmn", basis, count, basis, optimize=True) for count in (shorter, longer)]
    mixed = basis.T @ counts @ basis
    log_ratios, light = -np.diff(log_times), np.ones(LEVELS)
    for _ in range(ROUNDS):
        before, R = light, np.exp(log_ratios)[:, None, None]
        # The paper's error, the sum of (f(M_q) - R_q f(M_q+1))^2 over all pairs, is a quadratic form in 1, c_1, c_2 ...
        form = np.sum(squares[0] + R**2 * squares[1] - R * (mixed + mixed.transpose(0, 2, 1)), axis=0)
        light = basis @ np.concatenate([[1.0], scipy.linalg.lstsq(form[1:, 1:], -form[1:, 0], cond=1e-14)[0]])
        less, more = shorter @ light, longer @ light
        if light[used][-1] <= light[used][0] or not np.all((less > 0) & (more > less)):
            return light, np.full(len(counts), np.nan)
        log_ratios = np.log(less / more)
        log_ratios *= theilslopes(log_times, _log_times(log_ratios)).slope  # the gauge: u
        if np.abs(light - before).max() < CONVERGED:
            break
    return light, log_ratios


def _log_error(light, log_ratios, counts) -> float:
    """Root mean square of ln f(M_q) - ln R_q - ln f(M_q+1) over all pairs; infinite where there is no solution."""
    if not np.all(np.isfinite(log_ratios)) or light[MIDDLE] <= 0:
        return np.inf
    g = np.log(np.maximum(light, FLOOR * light[MIDDLE]))
    error = g[:, None] - log_ratios[:, None, None] - g
    return float(np.sqrt(np.sum(counts * error**2) / counts.sum()))


def _log_times(log_ratios) -> np.ndarray:
    """(P,) log exposure times from the log ratios of successive ones; the first is 0."""
    return np.concatenate([[0.0], -np.cumsum(log_ratios)])


def _rising_logarithm(light) -> np.ndarray:
    """ln of a polynomial, from the middle outwards held from falling and from below by FLOOR; 0 in the middle."""
    darker, brighter = light[MIDDLE::-1], light[MIDDLE:]
    held = np.concatenate([np.minimum.accumulate(darker)[:0:-1], np.maximum.accumulate(brighter)])
    return np.log(np.maximum(held / light[MIDDLE], FLOOR))


def _checked(Z, times, w, order):
    """The arguments as arrays: Z, log times, which values are used as (256,) bool, and the orders to try."""
    Z, times = np.asarray(Z), np.asarray(times, dtype=np.float64)
    if Z.ndim != 2 or Z.shape[1] < 2 or not Z.size or times.shape != Z.shape[1:]:
        raise ValueError(f"Z must be (N, P), P at least 2, and times (P,); got {Z.shape} and {times.shape}.")
    if not np.issubdtype(Z.dtype, np.integer) or Z.min() < 0 or Z.max() >= LEVELS:
        raise ValueError(f"Z must hold integers in 0..{LEVELS - 1}; got {Z.dtype} in {Z.min()}..{Z.max()}.")
    if not (np.all(np.isfinite(times)) and times[0] > 0 and np.all(np.diff(times) > 0)):
        raise ValueError(f"times must be positive seconds, ascending; got {times.tolist()}.")
    used = np.zeros(LEVELS, dtype=bool)
    used[USABLE] = True
    if w is not None:
        w = np.asarray(w, dtype=np.float64)
        if w.shape != (LEVELS,) or not w.min() >= 0 or not w.max() > 0:
            raise ValueError(f"w must hold {LEVELS} weights, none negative and not all 0; got shape {w.shape}.")
        used = w > 0
    if order is not None and order not in range(1, HIGHEST + 1):
        raise ValueError(f"order must be a whole number in 1..{HIGHEST}; got {order}.")
    return Z, np.log(times), used, range(1, HIGHEST + 1) if order is None else [int(order)]
