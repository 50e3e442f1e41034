"""What the exposures of one scene say of each other, without knowing which pixel went where.

M. Grossberg and S. Nayar, Determining the Camera Response from Images: What Is Knowable?, IEEE Transactions
on Pattern Analysis and Machine Intelligence 25(11), 2003. A response never falls, so the pixels keep their
order from one exposure to the next: the brightest fifth stays the brightest fifth. The curve that takes pixel
values of one photograph to those of another therefore follows from their two histograms.
"""

import numpy as np


def intensity_mapping(first, second) -> np.ndarray:
    """What each pixel value of one photograph becomes in another of the same scene (section 3).

    first, second : (256,) counts of the pixel values of the two photographs
    Returns (256,) float64, values 0..255 with fractions. Where first has no pixels it is interpolated; the
    photographs need not be aligned, if they show nearly the same.
    """
    below_first, below_second = (np.cumsum(h) - h / 2 for h in (first, second))
    filled = np.flatnonzero(second)
    mapped = np.interp(below_first, below_second[filled], filled)
    # What has the rank of the clipped pixels is clipped: there is nothing between 254 and 255 to interpolate.
    return np.where(below_first > np.sum(second[:-1]), 255.0, mapped)
