"""Stage 2: lay the photographs of a bracket on each other.

Where they roughly lie is found by median threshold bitmaps (papers/ward2003.py). That answer is not believed: small
blocks of the one photograph are looked for in the other (_registering/blocks.py), and only where so many agree that
it can't be an accident is a photograph moved. They also tell a small turn of the hand. What can't be trusted is
reported, and left beside its neighbour.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np

from hdr_helpers._registering.blocks import View
from hdr_helpers._registering.matching import Match, match_chain
from hdr_helpers._registering.motion import Motion, common_part, move_image
from hdr_helpers.load import Bracket, Truth, in_8_bits
from hdr_helpers.papers.kang2003 import register_locally
from hdr_helpers.papers.ward2003 import bitmaps

__all__ = [
    "Alignment",
    "Ghosts",
    "Match",
    "Motion",
    "align_mtb",
    "bitmaps",
    "crop_bracket",
    "crop_common",
    "move_image",
    "remove_ghosts",
    "unaligned",
]

WORK = 384  # pixels across, at least, of the small copies on which photographs are compared
TURNED = 0.5  # pixels by which a turn moves the corners; less is no turn
GLANCE = 2e5  # pixels that are enough to see what moves
DARK, BRIGHT = 5, 250  # grey levels within which a photograph shows something


@dataclass(frozen=True)
class Alignment:
    """What align_mtb found.

    images : tuple of P arrays (H, W, 3), moved onto the reference; what moved in is 0
    shifts : (P, 2) float64, (dx, dy) pixels by which each photograph was moved right and down; whole numbers
        where it was not turned
    rotations : (P,) float64, degrees by which each was turned counter-clockwise about its middle, before the shift
    reference : index of the photograph that stayed where it was
    doubtful : (P,) bool, True where no match could be trusted and the photograph was moved only with its neighbour;
        and, if the hand turned, where a match does not tell the turn
    matches : tuple of P, the best Match of each photograph; None for the reference, and where there was nothing to
        compare
    """

    images: tuple[np.ndarray, ...]
    shifts: np.ndarray
    rotations: np.ndarray
    reference: int
    doubtful: np.ndarray
    matches: tuple[Match | None, ...]

    def doubt(self, k: int) -> str:
        """Why photograph k is doubtful, for people; empty where it is not."""
        match = self.matches[k]
        if not self.doubtful[k]:
            return ""
        if match is None:
            return "shows nothing to align; moved like its neighbour"
        if not match.trusted:
            return f"only {match.agree} of {match.blocks} blocks agree; moved like its neighbour"
        return "it can't be told how far the hand turned"


def align_mtb(images, max_shift: int | None = None, valid=None) -> Alignment:
    """Move the photographs of a bracket onto the middle one.

    images : P arrays (H, W, 3) uint8 or uint16, RGB, in order of exposure
    max_shift : the largest shift between two photographs that is looked for, in pixels; None looks as far as a
        quarter of the shorter side
    valid : P arrays (H, W) bool, the pixels that count; None counts all

    Each photograph is compared with its neighbour in exposure, which looks most like it, or with the next but one;
    the motions are added up along the chain. Where the hand did not turn, photographs are moved by whole pixels and
    keep their values; where it did, they are interpolated.
    Returns an Alignment.
    Raises ValueError for fewer than two photographs, photographs of different or unknown form, masks that do not fit
    them, or a max_shift below 1.

    >>> scene = cv2.resize(np.random.default_rng(0).integers(0, 200, (12, 18, 3), np.uint8), (180, 120))
    >>> align_mtb([scene[2:, 5:] // 2, scene[:-2, :-5]]).shifts.tolist()  # the first has lost 5 columns and 2 rows
    [[5.0, 2.0], [0.0, 0.0]]
    """
    images = tuple(images)
    if len(images) < 2:
        raise ValueError(f"Aligning needs at least two photographs; got {len(images)}.")
    for image in images:
        if image.dtype not in (np.uint8, np.uint16) or image.shape[2:] != (3,):
            raise ValueError(f"Photographs must be (H, W, 3), uint8 or uint16; got {image.dtype} {image.shape}.")
    if len({image.shape[:2] for image in images}) > 1:
        sizes = sorted({f"{i.shape[1]} x {i.shape[0]}" for i in images})
        raise ValueError(f"All photographs must have the same size; got {' and '.join(sizes)}.")
    shape = images[0].shape
    max_shift = max(min(shape[:2]) // 4, 1) if max_shift is None else max_shift
    if max_shift < 1:
        raise ValueError(f"max_shift must be at least 1 pixel; got {max_shift}.")
    if valid is not None and [np.shape(mask) for mask in valid] != [image.shape[:2] for image in images]:
        raise ValueError(f"valid must hold one mask of {shape[:2]} for each photograph.")

    levels = max(0, int(np.log2(max(min(shape[:2]) / WORK, 1))))
    reference = len(images) // 2
    sides = range(reference + 1, len(images)), range(reference - 1, -1, -1)
    with ThreadPoolExecutor() as pool:  # OpenCV and NumPy work side by side
        views = list(pool.map(partial(View, levels=levels), images, [None] * len(images) if valid is None else valid))
        chains = pool.map(partial(match_chain, views, reference, max_shift), sides)
        found = {k: pair for chain in chains for k, pair in chain.items()}
        matches, motions = zip(*(found[k] for k in range(len(images))), strict=True)
        turned = any(m.reach(shape) >= TURNED for m in motions)
        motions = [m if m.reach(shape) >= TURNED else Motion(round(m.dx), round(m.dy)) for m in motions]
        moved = tuple(pool.map(_moved, images, motions))
    return Alignment(
        images=moved,
        shifts=np.array([(m.dx, m.dy) for m in motions], dtype=np.float64),
        rotations=np.array([m.degrees for m in motions]),
        reference=reference,
        doubtful=np.array([not _sure(matches, k, reference, turned) for k in range(len(images))]),
        matches=matches,
    )


def _sure(matches, k, reference, turned) -> bool:
    """Whether photograph k lies where it belongs: its match, and those of the photographs it was laid on, tell so."""
    match = matches[k]
    if k == reference or match is None or not match.trusted:
        return k == reference
    return (match.turn_known or not turned) and _sure(matches, match.partner, reference, turned)


def _moved(image, motion: Motion) -> np.ndarray:
    return image if motion == Motion() else move_image(image, (motion.dx, motion.dy), motion.degrees)


def unaligned(images) -> Alignment:
    """The Alignment of P photographs that lie on each other already: nothing is moved, nothing is doubtful.

    images : P arrays (H, W, 3), kept as they are

    >>> unaligned([np.zeros((4, 6, 3), np.uint8)] * 2).shifts.tolist()
    [[0.0, 0.0], [0.0, 0.0]]
    """
    count = len(images)
    still = np.zeros((count, 2)), np.zeros(count)
    return Alignment(tuple(images), *still, count // 2, np.zeros(count, dtype=bool), (None,) * count)


def crop_common(images, shifts, rotations=None) -> tuple[np.ndarray, ...]:
    """The part of aligned photographs that all of them show.

    images : P arrays (H, W, ...), aligned
    shifts, rotations : (P, 2) pixels and (P,) degrees, as align_mtb moved them; None where nothing was turned
    Raises ValueError where they have no part in common.

    >>> [image.shape for image in crop_common(np.zeros((2, 4, 6, 3)), shifts=[(0, 0), (2, 1)])]
    [(3, 4, 3), (3, 4, 3)]
    """
    rotations = np.zeros(len(shifts)) if rotations is None else rotations
    part = common_part(images[0].shape, shifts, rotations)
    return tuple(image[part] for image in images)


def crop_bracket(bracket: Bracket, alignment: Alignment) -> Bracket:
    """The bracket with its photographs, what is valid in them, and its truth, aligned and cut to their common part.

    alignment : Alignment of the bracket's photographs
    Raises ValueError where the photographs have no part in common.

    >>> bracket = Bracket(np.zeros((2, 4, 6, 3), np.uint8), [0.1, 0.2], ("a", "b"))
    >>> moved = replace(unaligned(bracket.images), shifts=np.array([(0, 0), (2, 1)]))
    >>> crop_bracket(bracket, moved).images[0].shape
    (3, 4, 3)
    """
    place = alignment.shifts, alignment.rotations
    valid, truth = bracket.valid, bracket.truth
    if valid is not None:
        valid = crop_common([move_image(v, s, r) for v, s, r in zip(valid, *place, strict=True)], *place)
    if truth is not None:
        truth = _cut_truth(truth, alignment)
    return replace(bracket, images=crop_common(alignment.images, *place), valid=valid, truth=truth)


def _cut_truth(truth: Truth, alignment: Alignment) -> Truth:
    """The truth where the aligned photographs are: where the hand held the reference, and cut like them."""
    k = alignment.reference
    shift = (0, 0) if truth.shifts is None else truth.shifts[k]
    degrees = 0.0 if truth.rotations is None else truth.rotations[k]
    part = common_part(truth.radiance.shape, alignment.shifts, alignment.rotations)
    radiance = move_image(truth.radiance, shift, degrees)[part]
    moved = None if truth.moved is None else move_image(truth.moved, shift, degrees)[part]
    return Truth(radiance, truth.crf, moved=moved)


@dataclass(frozen=True)
class Ghosts:
    """What remove_ghosts found.

    bracket : Bracket in which every moving thing is where the reference has it: valid says where each photograph may
        speak, and what optical flow could follow was warped
    reference : index of the photograph that has the moving things where they stay
    moved : (H, W) bool, where at least one photograph lost its say, or was warped
    """

    bracket: Bracket
    reference: int
    moved: np.ndarray


def remove_ghosts(bracket: Bracket, reference: int | None = None) -> Ghosts:
    """Take the ghosts out of an aligned bracket in which something moves (papers/kang2003.py).

    bracket : Bracket, aligned
    reference : index of the photograph that says where the moving things are; None takes the one that is black or
        white in the fewest pixels of what moves, because there it will speak alone
    Returns Ghosts. Raises ValueError where there is no such photograph.

    >>> short = np.arange(20, 110, dtype=np.uint8).repeat(3).reshape(1, 90, 3).repeat(60, axis=0)
    >>> long = 2 * short
    >>> short[20:40, 20:40] = 100  # a ball flies by
    >>> moved = remove_ghosts(Bracket((short, long), [0.1, 0.2], ("a", "b")), reference=1).moved
    >>> bool(moved[30, 30]), bool(moved[10, 70])
    (True, False)
    """
    if reference is None:
        reference = _best_seen(bracket)
    images, valid = register_locally(bracket.images, reference, bracket.valid)
    warped = [np.any(a != b, axis=2) for a, b in zip(images, bracket.images, strict=True) if a is not b]
    moved = np.logical_or.reduce([_lost(bracket.valid, valid), *warped])
    return Ghosts(replace(bracket, images=images, valid=valid), reference, moved)


def _lost(before, after) -> np.ndarray:
    """(H, W) bool: where at least one photograph had a say and has none any more. before : masks, or None for all."""
    before = [True] * len(after) if before is None else before
    return np.logical_or.reduce([old & ~new for old, new in zip(before, after, strict=True)])


def _best_seen(bracket) -> int:
    """The photograph that is neither black nor white in most of what moves; of equals the one nearest the middle."""
    scale = min(1.0, np.sqrt(GLANCE / bracket.images[0][..., 0].size))
    size = [max(1, round(n * scale)) for n in bracket.images[0].shape[1::-1]]
    images = [cv2.resize(in_8_bits(image), size, interpolation=cv2.INTER_AREA) for image in bracket.images]
    valid = bracket.valid and [
        cv2.resize(mask.view(np.uint8) * np.uint8(255), size, interpolation=cv2.INTER_AREA) == 255
        for mask in bracket.valid
    ]
    middle = len(images) // 2
    moved = _lost(valid, register_locally(images, middle, valid)[1])
    seen = [np.count_nonzero(((image > DARK) & (image < BRIGHT)).all(axis=2) & moved) for image in images]
    return max(range(len(images)), key=lambda k: (seen[k], -abs(k - middle)))
