"""Pixels that are no photograph: borders of one colour, left where an alignment moved a frame.

A border has one colour and touches the edge of the frame. So does a dark corner or a white sky; what gives
a border away is that light can't explain it: a longer exposure is never darker, a shorter one never brighter.
"""

from collections import Counter
from collections.abc import Iterator

import cv2
import numpy as np

TOLERANCE = 3  # pixel values by which JPEG changes a flat colour
RINGING, REACH = 16, 4  # pixel values by which it changes one near its end, and how many pixels from there
CONTRADICTION = 24  # pixel values by which another exposure must contradict a border
MIN_SHARE = 0.01  # of the frame; a smaller bright or dark spot at the edge may only have been moved by the hand
MAX_SHARE = 0.5  # what covers more is no border
ENOUGH = 10_000  # pixels of a border that are looked at
DARK, BRIGHT = 8, 240  # a channel that may be clipped, or as good as
COLOURFUL = 64  # between the channels of a colour that no grey, black or white comes near
SUSPICION = 0.1  # of the edge's pixels of one colour that light must fail to explain, to look any further
MAJORITY = 0.5  # of a border's pixels that light must fail to explain


def find_borders(images, opaque, doubted: bool = False) -> list[np.ndarray | None]:
    """For each photograph where it is a photograph, (H, W) bool, or None where it is one everywhere.

    images : P arrays (H, W, 3) uint8, shortest exposure first, roughly on each other
    opaque : P arrays (H, W) bool, or None, outside of which a photograph is no evidence against another
    doubted : whether the order of the images is in doubt; then they are no evidence against each other
    """
    valid = [np.ones(i.shape[:2], dtype=bool) if o is None else o.copy() for i, o in zip(images, opaque, strict=True)]
    colours = [_common_colours(_edge(image)) for image in images]
    repeated = _repeated(colours)
    for colour in repeated:
        borders = []
        for image, some in zip(images, colours, strict=True):
            borders.append(np.zeros(image.shape[:2], dtype=bool))
            for region in _regions_at_edge(image, colour, 0) if colour in some else ():
                borders[-1] |= _grown(image, colour, region)
        # A lamp that clips stays where it is; a border moves with its photograph.
        fixed = np.logical_and.reduce([b for b in borders if b.any()] or borders)
        if _clipped(colour) and fixed.sum() > MAJORITY * np.logical_or.reduce(borders).sum():
            continue
        for inside, border in zip(valid, borders, strict=True):
            inside &= ~border
    if not doubted:
        _judge_by_light(images, colours, repeated, valid)
    return [None if inside.all() else inside for inside in valid]


def _repeated(colours) -> set[tuple[int, int, int]]:
    """Colours at the edge of most exposures, though exposures differ: no light does that, unless it clips."""
    count = Counter(colour for some in colours for colour in some)
    return {
        colour
        for colour, photographs in count.items()
        if photographs > len(colours) / 2 and (np.ptp(colour) > COLOURFUL or not _clipped(colour))
    }


def _clipped(colour) -> bool:
    """Whether every channel is as good as black or white."""
    return all(value <= DARK or value >= BRIGHT for value in colour)


def _judge_by_light(images, colours, repeated, valid) -> None:
    """Take from valid, P arrays (H, W) bool, the borders that are too dark or too bright for their exposure."""
    edges, pixels = [_edge(image) for image in images], [image.reshape(-1, 3) for image in images]
    solid_edges, solid = [_edge(inside) for inside in valid], [inside.ravel() for inside in valid]
    for j, (image, inside) in enumerate(zip(images, valid, strict=True)):
        for colour in colours[j]:
            there = np.flatnonzero(np.abs(edges[j].astype(np.int16) - colour).max(axis=1) <= TOLERANCE)
            if colour in repeated or _impossible(edges, solid_edges, j, there) < SUSPICION:
                continue
            for region in _regions_at_edge(image, colour, MIN_SHARE):
                points = np.flatnonzero(region)
                if _impossible(pixels, solid, j, points[:: len(points) // ENOUGH + 1]) > MAJORITY:
                    inside[_grown(image, colour, region)] = False


def _impossible(pixels, solid, j: int, points) -> float:
    """Share of points in photograph j that are darker than in a shorter exposure, or brighter than in a longer one.

    pixels : P arrays (n, 3) uint8, shortest exposure first; points : indices into n
    solid : P arrays (n,) bool, which pixels are evidence
    """
    here = pixels[j][points].astype(np.int16)
    against = np.zeros(len(points), dtype=bool)
    for k, (other, counts) in enumerate(zip(pixels, solid, strict=True)):
        excess = ((other[points] - here) * np.sign(j - k)).max(axis=1)
        against |= (excess > CONTRADICTION) & counts[points]
    return float(against.mean())


def _edge(image) -> np.ndarray:
    """The outermost pixels of a picture (H, W) or (H, W, 3), one after the other."""
    return np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])


def _common_colours(edge) -> list[tuple[int, int, int]]:
    """Up to three colours that make up the edge of a frame, (n, 3) uint8; none with less than a fiftieth of it."""
    packed = edge.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)
    shades, count = np.unique(packed, return_counts=True)
    most = np.argsort(-count, kind="stable")[:3]
    return [(int(s) >> 16, int(s) >> 8 & 255, int(s) & 255) for s in shades[most[count[most] > len(edge) / 50]]]


def _near(image, colour, distance: int) -> np.ndarray:
    """(H, W) uint8, 255 where no channel is further than distance from a colour."""
    low, high = (np.clip(np.add(colour, d), 0, 255).astype(np.float64) for d in (-distance, distance))
    return cv2.inRange(image, low, high)


def _regions_at_edge(image, colour, min_share: float) -> Iterator[np.ndarray]:
    """Connected regions, (H, W) bool, of one colour that touch the edge of the frame."""
    flat = _near(image, colour, TOLERANCE)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(flat, connectivity=4)
    for label, (left, top, width, height, area) in enumerate(stats[1:], 1):
        at_edge = left == 0 or top == 0 or left + width == image.shape[1] or top + height == image.shape[0]
        if at_edge and min_share < area / flat.size < MAX_SHARE:
            yield labels == label


def _grown(image, colour, region) -> np.ndarray:
    """A region with what JPEG made of its rim, (H, W) bool."""
    around = cv2.dilate(region.view(np.uint8), np.ones((2 * REACH + 1,) * 2, np.uint8))
    return region | ((around > 0) & (_near(image, colour, RINGING) > 0))
