"""What a bracket is asked when its camera is in question: enough of its pixels, and how often they read which pair."""

import cv2
import numpy as np

from hdr_helpers._response import LEVELS
from hdr_helpers.load import in_8_bits

ENOUGH = 12_000_000  # pixels, all photographs together


def evidence(images, valid=None) -> tuple[list[np.ndarray], list[np.ndarray | None]]:
    """Every second, third ... pixel each way of photographs, in 8 bits, so that ENOUGH remain; and of their masks.

    images : P arrays (H, W, 3) uint8 or uint16; valid : P arrays (H, W) bool, or None for all
    Pixels are taken as points, never as averages: the response is not linear.
    """
    step = int(np.ceil(np.sqrt(images[0][..., 0].size * len(images) / ENOUGH)))
    few = np.s_[::step, ::step]
    masks = [None] * len(images) if valid is None else [mask[few] for mask in valid]
    return [in_8_bits(np.ascontiguousarray(image[few])) for image in images], masks


def joint_histograms(images, masks, pairs) -> np.ndarray:
    """How often the pixels of pairs of photographs read which values, for each channel.

    images : P arrays (H, W, 3) uint8; masks : P arrays (H, W) bool or None
    pairs : K pairs (j, k) of indices
    Returns (K, 3, 256, 256) float32: at [i, c, u, v] the pixels that read u in photograph j and v in k.
    """
    planes = [[np.ascontiguousarray(image[..., c]) for c in range(3)] for image in images]
    counts = np.empty((len(pairs), 3, LEVELS, LEVELS), dtype=np.float32)
    for i, (j, k) in enumerate(pairs):
        masked = [mask for mask in (masks[j], masks[k]) if mask is not None]
        mask = np.logical_and.reduce(masked).view(np.uint8) if masked else None
        for c in range(3):
            both = [planes[j][c], planes[k][c]]
            counts[i, c] = cv2.calcHist(both, [0, 1], mask, [LEVELS, LEVELS], [0, LEVELS, 0, LEVELS])
    return counts
