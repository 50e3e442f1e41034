"""Which pixels speak when only some do."""

import numpy as np


def sample_pixels(images, n: int, seed: int = 0, valid=None) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of n pixels spread over the picture and over its brightness.

    images : P arrays (H, W, 3) uint8
    valid : (H, W) bool, the pixels that may be taken; None takes any
    Returns two (n,) integer arrays. Pixels are taken as points, never as averages: the response is not
    linear, so the mean of some values is not the value of their mean. They are drawn evenly from the
    pixels sorted by brightness, so that every pixel value is met; seeded, so that a run can be repeated.
    Raises ValueError where there are fewer than n pixels.
    """
    valid = np.ones(images[0].shape[:2], dtype=bool) if valid is None else valid
    count = np.count_nonzero(valid)
    if n > count:
        raise ValueError(f"{n} pixels were asked for; the photographs have {count}.")
    # A grid of some ten times as many pixels is choice enough, and large photographs stay quick to sort.
    stride = max(1, int(np.sqrt(count / (10 * n))))
    # No single photograph tells the brightnesses of a high-range scene apart: their sum does.
    brightness = np.sum([image[::stride, ::stride].sum(axis=2, dtype=np.int64) for image in images], axis=0)
    rng = np.random.default_rng(seed)
    order = np.lexsort((rng.random(brightness.size), brightness.ravel()))  # equal ones in random order
    order = order[valid[::stride, ::stride].ravel()[order]]
    bins = np.linspace(0, len(order), n + 1).astype(int)
    picked = order[rng.integers(bins[:-1], bins[1:])]
    rows, cols = np.unravel_index(picked, brightness.shape)
    return rows * stride, cols * stride
