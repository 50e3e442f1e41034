"""Where a photograph ends: what stands for no light, and what is white although it does not say so."""

import cv2
import numpy as np

from hdr_helpers._response import LEVELS
from hdr_helpers.load import in_8_bits

CLIPPED = 250  # from here on a pixel value may be a clipped one, pulled down by noise or JPEG
DARKER = 0.1  # share of pixels that may be darker than half of a black level
RINGING = 20  # grey levels by which JPEG pulls a clipped pixel below white where white ends


def black_level(images, valid=None) -> int:
    """The pixel value that stands for no light: 0 in most files, about 17 in some scans.

    images : P arrays (H, W, 3) uint8 or uint16 (in 8 bits), aligned, shortest exposure first
    valid : P arrays (H, W) bool, the pixels that count, or None for all
    It is the largest dark value that the next longer exposure does not brighten. Up to there a pixel says
    nothing of the scene, yet each of the short exposures would say it with conviction. Where darker values are common
    it is noise round 0 and no level.
    """
    if len(images) < 2:
        return 0
    shortest, longer = (in_8_bits(image[::2, ::2]) for image in images[:2])
    pairs = shortest.astype(np.intp) * LEVELS + longer
    if valid is not None:
        pairs = pairs[(valid[0] & valid[1])[::2, ::2]]
    joint = np.bincount(pairs.ravel(), minlength=LEVELS**2).reshape(LEVELS, LEVELS)
    count = joint.sum(axis=1)
    median = np.argmax(np.cumsum(joint, axis=1) >= count[:, None] / 2, axis=1)
    dark = np.arange(LEVELS) < LEVELS // 4
    still = dark & (count > 1e-3 * count.sum()) & (median <= np.arange(LEVELS))
    level = int(np.flatnonzero(still).max(initial=0))
    return level if count[: level // 2].sum() < DARKER * count.sum() else 0


def whole_white(image, valid=None) -> np.ndarray:
    """A photograph, (H, W, 3) uint8 or uint16, in which what is almost white and touches white is white.

    A clipped area in a JPEG is not all 255: here and there it reads 245, which would pass for a measurement.
    In a long exposure such a pixel says of the sun that it is hundreds of times too dim: it must not vote.
    valid : (H, W) bool, the pixels that can be touched, or None for all
    """
    white = np.iinfo(image.dtype).max
    level = white // (LEVELS - 1)
    light = image if valid is None else image * valid[..., None]
    touches_white = cv2.dilate(light, np.ones((3, 3), np.uint8)) >= CLIPPED * level
    return np.where(touches_white & (image >= (CLIPPED - RINGING) * level), image.dtype.type(white), image)
