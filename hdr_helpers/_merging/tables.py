"""Weighted means of what photographs say of a pixel, by tables: look up and add, a tile at a time, on two threads.

What a photograph says, and with what weight, depends on the photograph and the pixel value only. Both sums of
equation 6 come from one table: its entries are pairs (weight x word, weight) of float32, which OpenCV's LUT looks up
as one float64. Two neighbouring photographs of 8 bits make one value of 16 bits, so that one look-up serves both.
"""

from concurrent.futures import ThreadPoolExecutor
from itertools import product

import cv2
import numpy as np

from hdr_helpers.crf import CLIPPED, RINGING

TILE = 64, 1024  # rows and columns merged at a time: the working arrays stay in the processor's cache
THREADS = 2


def mean_by_tables(images, said, weights, finish, masks=None, settle=False, least=0.0):
    """finish(sum_j W_j(Z_j) Y_j(Z_j) / sum_j W_j(Z_j)) for every pixel and channel.

    images : P arrays (H, W, 3), all uint8 or all uint16, shortest exposure first
    said, weights : (P, values, 3) float, Y and W for each photograph, value (256 or 65,536) and channel; no weight 0
    finish : takes means to radiance, in place, an array of float32
    masks : P arrays (H, W) bool, False where a photograph has no say, or None
    settle : whether values near white that touch white count as white, in all but the shortest photograph
    least : sum of weights, the largest weight being 1, from which on a pixel was measured

    Returns the radiance, (H, W, 3) float32, NaN where no photograph has a say; and how many pixels have a channel that
    was not measured though a photograph has a say: too bright, too dark, by the shortest photograph's value.
    """
    scaled = weights / weights.max()
    pairs = np.stack([scaled * said, scaled], axis=-1).astype(np.float32)  # (P, values, 3, 2)
    single = [_as_table(pair) for pair in pairs]
    couples = range(0, len(images) - 1, 2) if images[0].dtype == np.uint8 else ()
    double = {j: _as_table(pairs[j] + pairs[j + 1][:, None]) for j in couples}
    height, width = images[0].shape[:2]
    middle = np.iinfo(images[0].dtype).max // 2
    radiance = np.empty((height, width, 3), dtype=np.float32)

    def merge(corner):
        tile = tuple(slice(at, min(at + n, end)) for at, n, end in zip(corner, TILE, (height, width), strict=True))
        found = np.empty(radiance[tile].shape, dtype=np.float64)  # a pair of float32 in each
        sums = np.zeros((*found.shape[:2], 6), dtype=np.float64)  # in float32 they would be off by more than 1e-5
        speak = [None if masks is None or _whole(masks[j][tile]) else masks[j][tile] for j in range(len(images))]
        values = [_settled(i, tile, masks and masks[j]) if settle and j else i[tile] for j, i in enumerate(images)]
        j = 0
        while j < len(images):
            couple = j in double and speak[j] is None and speak[j + 1] is None
            at = values[j] + np.multiply(values[j + 1], 256, dtype=np.uint16) if couple else values[j]
            cv2.LUT(at, double[j] if couple else single[j], found)
            if speak[j] is None:  # as one channel: OpenCV is much faster so
                cv2.accumulate(found.view(np.float32).reshape(len(found), -1), sums.reshape(len(found), -1))
            else:
                cv2.accumulate(found.view(np.float32).reshape(sums.shape), sums, speak[j].view(np.uint8))
            j += 1 + couple
        total = sums[..., 1::2]
        unmeasured = (total < least) & (total > 0)
        with np.errstate(invalid="ignore"):
            finish(np.divide(sums[..., ::2], total, out=radiance[tile], casting="same_kind"))
        if not unmeasured.any():
            return 0, 0
        bright = values[0] > middle
        return [np.count_nonzero(np.bitwise_or.reduce(unmeasured & of, axis=2)) for of in (bright, ~bright)]

    before = cv2.getNumThreads()
    cv2.setNumThreads(1)  # the threads are here: OpenCV's own would wait for each other at every table
    try:
        with ThreadPoolExecutor(THREADS) as pool:
            corners = product(range(0, height, TILE[0]), range(0, width, TILE[1]))
            counts = list(pool.map(merge, corners))
    finally:
        cv2.setNumThreads(before)
    return radiance, *np.sum(counts, axis=0).tolist()


def _as_table(pairs) -> np.ndarray:
    """(..., 3, 2) float32 as cv2.LUT wants it: (1, values, 3) float64, of which each is a pair."""
    return np.ascontiguousarray(pairs).view(np.float64).reshape(1, -1, 3)


def _settled(image, tile, mask) -> np.ndarray:
    """crf.whole_white of one tile, for which the pixels around it are looked at, too."""
    values, level = image[tile], np.iinfo(image.dtype).max // 255
    if values.max() < (CLIPPED - RINGING) * level:
        return values
    around = tuple(slice(max(side.start - 1, 0), side.stop + 1) for side in tile)
    light = image[around] if mask is None or _whole(mask[around]) else image[around] * mask[around][..., None]
    inside = tuple(slice(side.start - out.start, side.stop - out.start) for side, out in zip(tile, around, strict=True))
    touches = cv2.dilate(light, np.ones((3, 3), np.uint8))[inside]
    return cv2.max(values, cv2.min(_at_least(touches, CLIPPED * level), _at_least(values, (CLIPPED - RINGING) * level)))


def _at_least(values, least) -> np.ndarray:
    """White where values are at least that, black elsewhere."""
    return cv2.threshold(values, least - 1, np.iinfo(values.dtype).max, cv2.THRESH_BINARY)[1]


def _whole(mask) -> bool:
    return cv2.countNonZero(mask.view(np.uint8)) == mask.size  # numpy's all is slow on part of an array
