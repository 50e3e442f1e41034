"""Stage 2: align the photographs of a bracket with median threshold bitmaps.

After G. Ward, Fast, Robust Image Registration for Compositing High Dynamic Range Photographs from
Hand-Held Exposures, Journal of Graphics Tools 8(2), 2003.

A pixel brighter than the median stays brighter than the median when the exposure changes, so bitmaps
thresholded there can be compared across exposures. In a frame that is nearly black or nearly white the
median says nothing; there another percentile, the same for both frames, is tried before giving up.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from hdr_helpers.load import Bracket, in_8_bits

TOLERANCE = 4  # grey levels round the threshold in which noise decides: excluded (Ward, section 2.2)
PERCENTILES = (50, 67, 33, 80, 20, 90, 10, 95, 98)  # the median first, then ever further from it
MIN_CLEAR = 0.45  # share of pixels that must lie off the threshold in both frames to trust a pair
MAX_ERROR = 0.2  # bitmaps that still differ by more than this share of what chance would give don't match
MIN_PIXELS = 16  # the smallest pyramid level, in pixels across


@dataclass(frozen=True)
class Alignment:
    """What align_mtb found.

    images : tuple of P arrays (H, W, 3), shifted onto the reference; what moved in is 0
    shifts : (P, 2) int, (dx, dy) pixels by which each photograph was moved right and down
    reference : index of the photograph that stayed where it was
    doubtful : (P,) bool, True where no threshold could be trusted and the photograph was moved only
        with its neighbour
    """

    images: tuple[np.ndarray, ...]
    shifts: np.ndarray
    reference: int
    doubtful: np.ndarray


def align_mtb(images, max_shift: int = 64) -> Alignment:
    """Shift the photographs of a bracket onto the middle one.

    images : P arrays (H, W, 3) uint8 or uint16, RGB, in order of exposure
    max_shift : the largest shift between neighbouring exposures that is looked for, in pixels; at most
        half the picture

    Each photograph is compared with its neighbour in exposure, which looks most like it, and the shifts
    are added up along the chain. A pair that can't be trusted counts as not shifted and is reported.
    Raises ValueError for fewer than two photographs or photographs of different sizes.
    """
    images = tuple(images)
    if len(images) < 2:
        raise ValueError(f"Aligning needs at least two photographs; got {len(images)}.")
    if len({image.shape for image in images}) > 1:
        sizes = sorted({f"{i.shape[1]} x {i.shape[0]}" for i in images})
        raise ValueError(f"All photographs must have the same size; got {' and '.join(sizes)}.")

    pyramids = [_pyramid(cv2.cvtColor(in_8_bits(image), cv2.COLOR_RGB2GRAY), max_shift) for image in images]
    reference = len(images) // 2
    shifts = np.zeros((len(images), 2), dtype=int)
    doubtful = np.zeros(len(images), dtype=bool)
    for side in (range(reference + 1, len(images)), range(reference - 1, -1, -1)):
        neighbour = reference
        for k in side:
            shift = _pair_shift(pyramids[neighbour], pyramids[k], max_shift)
            doubtful[k] = shift is None
            shifts[k] = shifts[neighbour] + (0 if shift is None else shift)
            neighbour = k
    moved = tuple(shift_image(image, s) for image, s in zip(images, shifts, strict=True))
    return Alignment(moved, shifts, reference, doubtful)


def shift_image(image, shift) -> np.ndarray:
    """Move an image (H, W) or (H, W, 3) by (dx, dy) whole pixels right and down; what moves in is 0.

    The empty border holds no measurement: 0 has no weight in the merge, and crop_common cuts it off.
    (np.roll would bring in the opposite edge instead.)
    """
    dx, dy = (int(s) for s in shift)
    height, width = image.shape[:2]
    matrix = np.float32([[1, 0, dx], [0, 1, dy]])
    return cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_NEAREST, borderValue=0)


def crop_common(images, shifts) -> tuple[np.ndarray, ...]:
    """The part of aligned photographs that all of them show.

    images : P arrays (H, W, ...), aligned; shifts : (P, 2), what align_mtb moved them by
    Raises ValueError where they have no part in common.
    """
    height, width = images[0].shape[:2]
    (left, top), (right, bottom) = np.maximum(shifts, 0).max(axis=0), np.minimum(shifts, 0).min(axis=0)
    if top - bottom >= height or left - right >= width:
        raise ValueError("The aligned photographs have no part in common; check that they show one scene.")
    return tuple(image[top : height + bottom, left : width + right] for image in images)


def crop_bracket(bracket: Bracket, alignment: Alignment) -> Bracket:
    """The bracket with its photographs, and what is valid in them, aligned and cut to their common part.

    Its truth stays behind: it lies where the photographs lay.
    Raises ValueError where the photographs have no part in common.
    """
    images, valid = crop_common(alignment.images, alignment.shifts), bracket.valid
    if valid is not None:
        moved = [shift_image(v.view(np.uint8), s) for v, s in zip(valid, alignment.shifts, strict=True)]
        valid = tuple(v.view(bool) for v in crop_common(moved, alignment.shifts))
    return replace(bracket, images=images, valid=valid, truth=None)


def bitmaps(gray, percentile: float = 50) -> tuple[np.ndarray, np.ndarray]:
    """Threshold bitmap and exclusion bitmap of one grey picture (Ward, figures 2 and 3).

    gray : (H, W) uint8. Returns two (H, W) uint8 arrays of 0 and 255: where the picture is brighter than
    the percentile, and where it lies more than TOLERANCE grey levels from it, so that noise can't flip it.
    """
    threshold = float(np.percentile(gray, percentile))
    _, bright = cv2.threshold(gray, threshold, 255, cv2.THRESH_BINARY)
    near = cv2.inRange(gray, threshold - TOLERANCE, threshold + TOLERANCE)
    return bright, cv2.bitwise_not(near)


def _pyramid(gray, max_shift: int) -> list[np.ndarray]:
    """The picture at full size, half size, and so on, until max_shift is a pixel or the picture gets small."""
    levels = [gray]
    while 2 ** len(levels) <= max_shift and min(levels[-1].shape) >= 2 * MIN_PIXELS:
        levels.append(cv2.resize(levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return levels


def _pair_shift(fixed: list, moving: list, max_shift: int) -> np.ndarray | None:
    """(dx, dy) that brings moving onto fixed, by the first percentile that gives a match to be trusted."""
    for percentile in PERCENTILES:
        if _clear_share(fixed[0], moving[0], percentile) < MIN_CLEAR:
            continue
        shift, error = np.zeros(2, dtype=int), 1.0
        for level_fixed, level_moving in zip(fixed[::-1], moving[::-1], strict=True):
            # The smallest level is searched as far as max_shift goes, the others by one pixel each way.
            radius = 1 if level_fixed is not fixed[-1] else int(np.ceil(max_shift / 2 ** (len(fixed) - 1)))
            pair = bitmaps(level_fixed, percentile), bitmaps(level_moving, percentile)
            shift, error = _best_step(*pair, 2 * shift, radius)
        if error <= MAX_ERROR and abs(shift).max() <= max_shift:
            return shift
    return None


def _clear_share(a, b, percentile) -> float:
    """Share of pixels off the threshold in the worse of two frames; 0 where a bitmap is all one value."""
    share = 1.0
    for gray in (a, b):
        bright, clear = bitmaps(gray, percentile)
        bright_share = cv2.countNonZero(cv2.bitwise_and(bright, clear)) / gray.size
        clear_share = cv2.countNonZero(clear) / gray.size
        # Both sides of the threshold must be there, or there is nothing to align.
        share = min(share, clear_share if 0.005 < bright_share < clear_share - 0.005 else 0.0)
    return share


def _best_step(fixed, moving, start, radius) -> tuple[np.ndarray, float]:
    """The shift within radius pixels of start whose bitmaps differ least, and how much they differ.

    Bitmaps are compared by XOR where neither excludes a pixel. 0 is a perfect match, 1 is chance.
    """
    bright_fixed, clear_fixed = fixed
    height, width = bright_fixed.shape

    def error(step):
        dx, dy = start + step
        if abs(dx) > width // 2 or abs(dy) > height // 2:
            return 1.0  # too little overlap to tell anything
        here = np.s_[max(dy, 0) : height + min(dy, 0), max(dx, 0) : width + min(dx, 0)]
        there = np.s_[max(-dy, 0) : height + min(-dy, 0), max(-dx, 0) : width + min(-dx, 0)]
        clear = cv2.bitwise_and(clear_fixed[here], moving[1][there])
        a, b = bright_fixed[here], moving[0][there]
        # Shares, not counts: the overlap shrinks as the shift grows.
        pixels = max(cv2.countNonZero(clear), 1)
        p, q, differ = (
            cv2.countNonZero(cv2.bitwise_and(bits, clear)) / pixels for bits in (a, b, cv2.bitwise_xor(a, b))
        )
        return differ / max(p * (1 - q) + q * (1 - p), 1e-9)

    reach = range(-radius, radius + 1)
    steps = [np.array((dx, dy)) for dy in reach for dx in reach]
    steps.sort(key=lambda step: abs(step).sum())  # of equals, the smallest step wins
    errors = [error(step) for step in steps]
    return start + steps[int(np.argmin(errors))], min(errors)
