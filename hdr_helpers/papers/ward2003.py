"""Median threshold bitmaps: where two exposures of one scene lie on each other.

G. Ward, Fast, Robust Image Registration for Compositing High Dynamic Range Photographs from Hand-Held Exposures,
Journal of Graphics Tools 8(2), 2003. A pixel brighter than the median stays brighter than the median when the
exposure changes, so bitmaps thresholded there can be compared across exposures: by XOR, from the smallest picture
of a pyramid to the largest. In a frame that is nearly black or nearly white the median says nothing; there another
percentile, the same for both frames, can.

Two things are done otherwise than in the paper. At the smallest level the bitmaps are compared at every shift at
once, by Fourier transform, not at 9: a walk that starts one pixel wrong does not find back. And bitmaps are judged
by how far they agree beyond chance, so that a mostly white pair does not win by its white.
"""

from functools import partial

import cv2
import numpy as np
import scipy.fft

TOLERANCE = 4  # grey levels round the threshold in which noise decides: excluded (section 2.2)
PERCENTILES = (50, 60, 40, 70, 30, 80, 20, 85, 15, 90, 10, 93, 7, 95, 5, 97, 3, 98, 2, 99, 1, 99.5, 0.5, 99.8, 0.2)
SMALLEST = 64  # pixels across: the level at which every shift is tried
CANDIDATES = 4  # shifts followed down the pyramid


def bitmaps(gray, percentile: float = 50, valid=None) -> tuple[np.ndarray, np.ndarray]:
    """Threshold bitmap and exclusion bitmap of one grey picture (figures 2 and 3).

    gray : (H, W) uint8; valid : (H, W) uint8, 0 where a pixel does not count, or None
    percentile : 0 to 100, of the pixels that count; 50 is the median
    Returns two (H, W) uint8 arrays of 0 and 255: where the picture is brighter than the percentile, and where it
    lies more than TOLERANCE grey levels from it, so that noise can't flip it.

    >>> bright, clear = bitmaps(np.uint8([[10, 52, 50, 49, 90]]))
    >>> bright.tolist(), clear.tolist()
    ([[0, 255, 0, 0, 255]], [[255, 0, 0, 0, 255]])
    """
    threshold = _threshold(cv2.calcHist([gray], [0], valid, [256], [0, 256]).ravel(), percentile)
    _, bright = cv2.threshold(gray, threshold, 255, cv2.THRESH_BINARY)
    clear = cv2.bitwise_not(cv2.inRange(gray, max(threshold - TOLERANCE, 0), min(threshold + TOLERANCE, 255)))
    return bright, clear if valid is None else cv2.bitwise_and(clear, valid)


def clear_share(histograms, percentile: float) -> float:
    """How well a percentile splits two pictures, each into clearly dark and clearly bright pixels, 0 to 0.5.

    histograms : two (256,) counts; percentile : 0 to 100, at which both are split
    Returns the smallest of the four shares; 0 where a bitmap would be all one value.

    >>> ramp, black = np.ones(256), np.bincount([0], minlength=256)
    >>> round(clear_share([ramp, ramp], 50), 1), clear_share([ramp, black], 50)
    (0.5, 0.0)
    """
    shares = []
    for histogram in histograms:
        threshold, below = _threshold(histogram, percentile), np.cumsum(histogram) / max(np.sum(histogram), 1)
        dark = below[threshold - TOLERANCE - 1] if threshold > TOLERANCE else 0.0
        shares += [dark, 1 - below[min(threshold + TOLERANCE, 255)]]
    return float(max(min(shares), 0))


def likely_shifts(fixed, moving, percentile: float, max_shift: int) -> list[tuple[int, int]]:
    """Shifts (dx, dy) of moving, in pixels right and down, at which the bitmaps of two pictures agree; likeliest first.

    fixed, moving : (gray, valid) each, (H, W) uint8; valid is 255 where a pixel counts, else 0
    percentile : 0 to 100, at which both are thresholded; 50 is the median
    max_shift : pixels each way

    >>> wall = np.random.default_rng(0).integers(0, 256, (60, 80), np.uint8)
    >>> everywhere = np.full((58, 75), 255, np.uint8)
    >>> likely_shifts((wall[:-2, :-5], everywhere), (wall[2:, 5:], everywhere), 50, max_shift=8)[0]
    (5, 2)
    """
    levels = [[fixed, moving]]
    while min(levels[-1][0][0].shape) >= 2 * SMALLEST:
        levels.append([halved(*picture) for picture in levels[-1]])
    pairs = [[bitmaps(gray, percentile, mask) for gray, mask in level] for level in levels]
    found = []
    for shift in _every_shift(*pairs[-1], -(-max_shift // 2 ** (len(pairs) - 1))):
        for pair in pairs[-2::-1]:
            shift = one_level_finer(*pair, shift)
        found.append(shift)
    return list(dict.fromkeys(found))


def one_level_finer(fixed, moving, shift) -> tuple[int, int]:
    """Of twice a shift (dx, dy) and its eight neighbours, the one at which two bitmaps disagree least.

    fixed, moving : (bright, clear) as bitmaps returns them, twice as large as where shift was found
    shift : (dx, dy) whole pixels of the coarser level

    >>> wall = np.random.default_rng(0).integers(0, 256, (60, 80), np.uint8)
    >>> one_level_finer(bitmaps(wall[:-2, :-5]), bitmaps(wall[2:, 5:]), shift=(2, 1))
    (5, 2)
    """
    x, y = 2 * shift[0], 2 * shift[1]
    near = [(x + i, y + j) for j in (0, -1, 1) for i in (0, -1, 1)]  # of equals, the first
    return min(near, key=partial(disagreement, fixed, moving))


def disagreement(fixed, moving, shift) -> float:
    """How far two bitmaps differ when the second is moved by (dx, dy): 0 not at all, 1 as much as chance would.

    fixed, moving : (bright, clear) as bitmaps returns them. Compared by XOR where neither excludes a pixel.
    shift : (dx, dy) whole pixels right and down

    >>> picture = bitmaps(np.uint8([[10, 90, 10, 10, 90, 90]]))
    >>> disagreement(picture, picture, shift=(0, 0)), disagreement(picture, picture, shift=(6, 0))
    (0.0, 1.0)
    """
    (height, width), (dx, dy) = fixed[0].shape, shift
    if abs(dx) >= width or abs(dy) >= height:
        return 1.0
    here, there = overlap((height, width), shift)
    clear = cv2.bitwise_and(fixed[1][here], moving[1][there])
    a, b = (cv2.bitwise_and(bits, clear) for bits in (fixed[0][here], moving[0][there]))
    # Shares, not counts: the overlap shrinks as the shift grows.
    pixels = max(cv2.countNonZero(clear), 1)
    p, q, differ = (cv2.countNonZero(bits) / pixels for bits in (a, b, cv2.bitwise_xor(a, b)))
    return differ / max(p * (1 - q) + q * (1 - p), 1e-9)


def halved(gray, valid) -> tuple[np.ndarray, np.ndarray]:
    """The next level of a pyramid: a picture (H, W) uint8 and its mask of 0 and 255, half as large.

    gray, valid : (H, W) uint8. A pixel is valid where all four are that it was made of.

    >>> small, whole = halved(np.uint8([[10, 20, 5, 5], [30, 40, 5, 5]]), np.uint8([[255] * 4, [255, 0, 255, 255]]))
    >>> small.tolist(), whole.tolist()
    ([[25, 5]], [[0, 255]])
    """
    size = max(gray.shape[1] // 2, 1), max(gray.shape[0] // 2, 1)
    small, whole = (cv2.resize(a, size, interpolation=cv2.INTER_AREA) for a in (gray, valid))
    return small, cv2.threshold(whole, 254, 255, cv2.THRESH_BINARY)[1]


def overlap(shape, shift) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Where two arrays of one shape lie on each other when the second is moved by (dx, dy) whole pixels.

    shape : (H, W), of both; shift : (dx, dy); one beyond their size leaves no overlap
    Returns the rows and columns of the first, and those of the second.

    >>> here, there = overlap((1, 5), shift=(2, 0))
    >>> row = np.array([[0, 1, 2, 3, 4]])
    >>> row[here].tolist(), row[there].tolist()
    ([[2, 3, 4]], [[0, 1, 2]])
    """
    height, width = shape
    dx, dy = (max(-size, min(step, size)) for step, size in zip(shift, (width, height), strict=True))
    here = np.s_[max(dy, 0) : height + min(dy, 0), max(dx, 0) : width + min(dx, 0)]
    there = np.s_[max(-dy, 0) : height + min(-dy, 0), max(-dx, 0) : width + min(-dx, 0)]
    return here, there


def _threshold(histogram, percentile) -> int:
    """The smallest pixel value that at least percentile of the pixels do not exceed."""
    below = np.cumsum(histogram)
    return int(np.searchsorted(below, below[-1] * percentile / 100))


def _every_shift(fixed, moving, reach) -> list[tuple[int, int]]:
    """The CANDIDATES best shifts within reach, best first.

    Four correlations give for every shift the number of pixels that are clear in both, bright in the one, in the
    other, and in both. Judged is the correlation of the bits times the root of their number: its chance fluctuations
    are the same for a large overlap and a small one.
    """
    height, width = fixed[0].shape
    reach_y, reach_x = min(reach, height - 1), min(reach, width - 1)
    shape = [scipy.fft.next_fast_len(n + r, real=True) for n, r in ((height, reach_y), (width, reach_x))]
    clear_a, bright_a, clear_b, bright_b = (
        scipy.fft.rfft2(np.float32(bits > 0), shape)
        for bright, clear in (fixed, moving)
        for bits in (clear, cv2.bitwise_and(bright, clear))
    )

    def count(a, b):
        everywhere = np.roll(scipy.fft.irfft2(a * np.conj(b), shape), (reach_y, reach_x), axis=(0, 1))
        return np.rint(everywhere[: 2 * reach_y + 1, : 2 * reach_x + 1])

    pixels = np.maximum(count(clear_a, clear_b), 1)
    p, q, both = (count(*pair) / pixels for pair in ((bright_a, clear_b), (clear_a, bright_b), (bright_a, bright_b)))
    score = np.sqrt(pixels) * (both - p * q) / np.sqrt(np.maximum(p * (1 - p) * q * (1 - q), 1e-9))
    score = score.astype(np.float32)
    y, x = np.nonzero(score >= cv2.dilate(score, np.ones((3, 3))))
    distance = np.hypot(y - reach_y, x - reach_x)
    best = np.lexsort((distance, -score[y, x]))[:CANDIDATES]  # of equals, the smallest shift
    return [(int(x[k]) - reach_x, int(y[k]) - reach_y) for k in best]
