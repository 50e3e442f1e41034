"""What the exposures of one scene say of each other, and the response that follows from it.

M. Grossberg and S. Nayar, Determining the Camera Response from Images: What Is Knowable?, IEEE Transactions
on Pattern Analysis and Machine Intelligence 25(11), 2003. Between two exposures every pixel value v of the one
belongs to a pixel value u of the other: the brightness transfer function. If the exposures differ by the factor r,
then g(u) - g(v) = ln r, whatever the scene. Two ways to it:

- from the two histograms alone. A response never falls, so the pixels keep their order from one exposure to the
  next: the brightest fifth stays the brightest fifth (section 3);
- from the joint histogram, where the photographs are aligned: the median of v where the other photograph reads u.

A median is carried through any rising curve unharmed. Noise in the shorter exposure therefore hardly moves it,
while it bends the least squares of Debevec and Malik, which takes every noisy value at its word.
"""

import numpy as np
import scipy.linalg
import scipy.sparse

LEVELS, MIDDLE = 256, 128

# A value u of the longer photograph speaks if it is bright enough for its own noise to be small, not almost clipped,
# and seen often enough; and if the median it leads to is neither in the black nor beside clipped pixels.
DARKEST, BRIGHTEST, SEEN = 30, 250, 20
BLACK = 4.5
MOST_BLACK, MOST_CLIPPED = 0.45, 0.05

ROUNDING = 0.02  # pixel values by which a median of rounded values may be off, standard deviation
MISFIT = 0.002  # by which g(u) - g(v) = ln r may fail for other reasons (shutter, interpolation), ln exposure
BEND = 0.011  # by how much the local gamma dg / d ln z changes from a pixel value to the next
NEAR = 8  # pixel values each way that a mean is taken over, so that what moved has no part in it
LEAST_SLOPE = 1e-3  # of g, per pixel value
ROUNDS = 3  # the errors of medians are counted in exposure, so they need the slope of g, which needs them
FEWEST = 100  # equations


class TooLittleEvidence(ValueError):
    """Photographs that say too little of each other for a response."""


def intensity_mapping(first, second) -> np.ndarray:
    """What each pixel value of one photograph becomes in another of the same scene (section 3).

    first, second : (256,) counts of the pixel values of the two photographs
    Returns (256,) float64, values 0..255 with fractions. Where first has no pixels it is interpolated; the
    photographs need not be aligned, if they show nearly the same.

    >>> short, long = np.bincount([10, 20, 30], minlength=256), np.bincount([20, 40, 60], minlength=256)
    >>> intensity_mapping(short, long)[[10, 20, 30]].tolist()  # the darkest third stays the darkest third
    [20.0, 40.0, 60.0]
    """
    below_first, below_second = (np.cumsum(h) - h / 2 for h in (first, second))
    filled = np.flatnonzero(second)
    mapped = np.interp(below_first, below_second[filled], filled)
    # What has the rank of the clipped pixels is clipped: there is nothing between 254 and 255 to interpolate.
    return np.where(below_first > np.sum(second[:-1]), 255.0, mapped)


def brightness_transfer(joint, black: int = 0) -> tuple[np.ndarray, ...]:
    """Pixel values that belong together in two aligned exposures.

    joint : (256, 256) counts of pixels that read u in the longer and v in the shorter photograph
    black : pixel value that stands for no light
    Returns for the K values that can be trusted: u, (K,) integers; the median of v, (K,) float64, with fractions;
    the variance of that median, (K,) float64, pixel values squared; and the shares of pixels that read each v, (K, 256)
    float64, 0 away from the median.

    >>> joint = np.zeros((256, 256))
    >>> joint[[100, 200], [50, 100]] = 1000  # a linear camera, and a second exposure twice as long
    >>> u, v, variance, seen = brightness_transfer(joint)
    >>> (u / v).tolist()
    [2.0, 2.0]
    """
    joint = np.asarray(joint, dtype=np.float64)
    count = joint.sum(axis=1)
    u = np.flatnonzero(count >= SEEN)
    u = u[(u >= black + DARKEST) & (u <= BRIGHTEST)]
    seen, below = joint[u] / count[u, None], np.cumsum(joint[u], axis=1) / count[u, None]
    middle = np.argmax(below >= 0.5, axis=1)
    rows = np.arange(len(u))
    inside = seen[rows, middle]  # the value that holds the median stands for all light that rounds to it
    median = middle + 0.5 - (below[rows, middle] - 0.5) / inside
    v = np.arange(LEVELS)
    spread = np.maximum(seen @ v**2 - (seen @ v) ** 2, 0.05)
    trusted = (median > black + BLACK) & (median < BRIGHTEST - 1)
    trusted &= (seen[:, : black + 1].sum(axis=1) < MOST_BLACK) & (seen[:, -2:].sum(axis=1) < MOST_CLIPPED)
    # The variance of a median is pi / 2 times that of a mean.
    variance = np.pi / 2 * spread / count[u] + ROUNDING**2
    near = np.abs(v - median[:, None]) <= NEAR
    return u[trusted], median[trusted], variance[trusted], (seen * near)[trusted]


def response_from_transfers(
    joints, log_ratios, photographs: int, smoothness: float = 1.0, black: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Log inverse response of one channel from joint histograms of pairs of exposures, and its standard errors.

    joints : K arrays (256, 256), counts of pixels that read u in the longer and v in the shorter photograph
    log_ratios : (K,) float, natural logarithm of longer over shorter time
    photographs : how many there are; they form the K pairs
    smoothness : 1 fits cameras; larger is smoother. A curve that is a power of the pixel value costs nothing.
    black : pixel value that stands for no light

    Each trusted value u of each pair is one equation g(u) - g(v) = ln r, v between pixel values by a cubic through
    four of them, weighted by its precision. Where a pair of ratios leaves g free (a ripple with the period of the
    ratio changes nothing, section 4) the smoothness decides.
    Returns g, (256,) float64 with g[128] = 0, and its standard error, (256,) float64, 0 at 128: of the difference
    g(z) - g(128), from the inverse of the same normal equations.
    Raises TooLittleEvidence where the pairs say too little.

    >>> light = np.geomspace(1, 255, 100_000)  # of a linear camera's pixels, and half of it
    >>> joint = np.histogram2d(light // 1, light // 2, bins=256, range=[(0, 256), (0, 256)])[0]
    >>> g, errors = response_from_transfers([joint], [np.log(2)], photographs=2)
    >>> round(float(g[128] - g[64]) / np.log(2).item(), 1)  # stops
    1.0
    """
    transfers = [brightness_transfer(joint, black) for joint in joints]
    if not transfers:
        raise TooLittleEvidence("Not one pair of exposures was given.")
    u, median, variance, seen = (np.concatenate(parts) for parts in zip(*transfers, strict=True))
    if len(u) < FEWEST:
        raise TooLittleEvidence(
            f"The pairs of exposures give {len(u)} pixel values that belong together, fewer than {FEWEST}."
        )
    ratios = np.repeat(np.asarray(log_ratios, dtype=np.float64), [len(t[0]) for t in transfers])
    bends = _bends(black) * (smoothness / BEND)
    prior = bends.T @ bends
    v, slope = median, 1.5 / np.maximum(np.arange(LEVELS), 3)  # of some camera, for the first round
    for _ in range(ROUNDS):
        A = _differences(u, v)
        precision = 1 / (MISFIT**2 + np.interp(v, np.arange(LEVELS), slope) ** 2 * variance)
        weighted = A.multiply(precision[:, None]).tocsr()
        normal, pull = (weighted.T @ A).toarray() + prior, weighted.T @ ratios
        normal[MIDDLE, MIDDLE] += normal.diagonal().max()  # the gauge row
        scale = 1 / np.sqrt(normal.diagonal())
        factor = scipy.linalg.cho_factor(normal * scale[:, None] * scale)
        g = scale * scipy.linalg.cho_solve(factor, scale * pull)
        slope = np.maximum(np.gradient(g), LEAST_SLOPE)
        v = (median + _mean_light(seen, g)) / 2

    misfit = (precision @ ratios**2 - g @ pull) / len(u)  # 1 if the precisions were right
    # The pairs share photographs: there are as many pieces of news as photographs beside the first.
    repeated = max(1, len(joints) / (photographs - 1))
    return g - g[MIDDLE], standard_errors(scale, factor, misfit * repeated)


def standard_errors(scale, factor, variance: float) -> np.ndarray:
    """Standard error of each difference g(z) - g(128), (256,) float64, from normal equations as they were solved.

    scale, factor : (256,), and the Cholesky factor of the normal matrix scaled by it on both sides
    variance : of an equation whose precision in the matrix is 1

    >>> apart = scipy.linalg.cho_factor(np.eye(256))  # each g(z) measured by itself: variances add up
    >>> (standard_errors(np.ones(256), apart, 1.0)[[127, 128]] ** 2).round(6).tolist()
    [2.0, 0.0]
    """
    covariance = scale[:, None] * scipy.linalg.cho_solve(factor, np.diag(scale)) * variance
    of_differences = covariance.diagonal() - 2 * covariance[MIDDLE] + covariance[MIDDLE, MIDDLE]
    return np.sqrt(np.maximum(of_differences, 0))


def _mean_light(seen, g) -> np.ndarray:
    """The pixel value, with fractions, that stands for the mean light of what was seen.

    Shot noise is skewed. A median lies a sixth of an electron below the light, some hundredths of a stop in the dark;
    a mean takes every rounding and outlier along, upwards. Half way between errs least.
    """
    rising = np.maximum.accumulate(g) + 1e-9 * np.arange(LEVELS)
    return np.interp(np.log(seen @ np.exp(rising) / seen.sum(axis=1)), rising, np.arange(LEVELS))


def _differences(u, v):
    """Rows that take g to g(u) - g(v), (K, 256) sparse; u integers, v with fractions (Catmull and Rom's cubic)."""
    below = np.clip(np.floor(v).astype(int), 1, LEVELS - 3)
    t = v - below
    cubic = [-t / 2 + t**2 - t**3 / 2, 1 - 2.5 * t**2 + 1.5 * t**3, t / 2 + 2 * t**2 - 1.5 * t**3, (t**3 - t**2) / 2]
    columns = np.stack([below - 1, below, below + 1, below + 2, u], axis=1)
    entries = np.stack([*(-weight for weight in cubic), np.ones(len(u))], axis=1)
    rows = np.repeat(np.arange(len(u)), 5)
    return scipy.sparse.csr_array((entries.ravel(), (rows, columns.ravel())), shape=(len(u), LEVELS))


def _bends(black: int) -> np.ndarray:
    """Rows that take g to the changes of its local gamma dg / d ln z, (254, 256); z counts from black."""
    light = np.maximum(np.arange(LEVELS) - black, 0.25)
    steps = np.diff(np.log(light))
    steps[:black] = steps[black]  # below black there is no light: g goes on as it was
    return np.diff(np.diff(np.eye(LEVELS), axis=0) / steps[:, None], axis=0)
