"""Pixels that are no photograph: borders of one colour, left where an alignment moved a frame.

A border has one colour and touches the edge of the frame. So does a dark corner or a white sky; what gives
a border away is that light can't explain it: a longer exposure is never darker, a shorter one never brighter.
"""

import cv2
import numpy as np

TOLERANCE = 3  # pixel values by which JPEG changes a flat colour
CONTRADICTION = 24  # pixel values by which another exposure must contradict a border
MIN_SHARE = 0.002  # of the frame's pixels; less is not worth a mask
MAX_SHARE = 0.5  # what covers more is no border
ENOUGH = 10_000  # pixels of a border that are looked at
COLOURFUL = 64  # between the channels of a colour that no grey, black or white comes near
MAJORITY = 0.5  # of a border's pixels that light must fail to explain


def find_borders(images) -> list[np.ndarray | None]:
    """For each photograph where it is a photograph, (H, W) bool, or None where it is one everywhere.

    images : P arrays (H, W, 3) uint8, shortest exposure first, roughly on each other
    """
    found = [_flat_regions(image) for image in images]
    colours = [colour for regions in found for colour, _ in regions]
    flat = [image.reshape(-1, 3) for image in images]
    valid = []
    for j, (image, regions) in enumerate(zip(images, found, strict=True)):
        inside = np.ones(image.shape[:2], dtype=bool)
        for colour, region in regions:
            # Black and white may be night and sun; one strong colour at the edge of most exposures is neither.
            repeated = np.ptp(colour) > COLOURFUL and colours.count(colour) > len(images) / 2
            if repeated or _impossible(flat, j, region) > MAJORITY:
                inside[region] = False
        valid.append(None if inside.all() else inside)
    return valid


def _impossible(flat, j: int, region) -> float:
    """Share of a region's pixels in photograph j that are darker than in a shorter exposure, or brighter than in a
    longer one. flat : P arrays (H * W, 3) uint8"""
    points = np.flatnonzero(region)
    points = points[:: max(1, len(points) // ENOUGH)]
    here = flat[j][points].astype(np.int16)
    against = np.zeros(len(points), dtype=bool)
    for k, other in enumerate(flat):
        excess = (other[points] - here) * np.sign(j - k)
        against |= (excess > CONTRADICTION).any(axis=1)
    return float(against.mean())


def _flat_regions(image) -> list[tuple[tuple[int, ...], np.ndarray]]:
    """Colours and regions, (H, W) bool, of one colour that touch the edge of the frame."""
    edge = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    packed = edge.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)
    shades, count = np.unique(packed, return_counts=True)
    common = shades[np.argsort(-count, kind="stable")][:3]
    regions = []
    for shade in common[np.sort(count)[::-1][:3] > len(edge) / 50]:
        colour = (int(shade) >> 16, int(shade) >> 8 & 255, int(shade) & 255)
        low, high = (np.clip(np.add(colour, d), 0, 255).astype(np.float64) for d in (-TOLERANCE, TOLERANCE))
        flat = cv2.inRange(image, low, high)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(flat, connectivity=4)
        for label, (left, top, width, height, area) in enumerate(stats[1:], 1):
            on_edge = left == 0 or top == 0 or left + width == image.shape[1] or top + height == image.shape[0]
            if on_edge and MIN_SHARE < area / flat.size < MAX_SHARE:
                regions.append((colour, labels == label))
    return regions
