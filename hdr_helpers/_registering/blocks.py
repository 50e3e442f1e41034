"""Do two pictures really lie on each other? Small blocks of the one are looked for in the other, each on its own.

Blocks that found their places by chance point anywhere; blocks of two pictures that were only moved against each
other all tell the same story. So their agreement says how far the pictures were moved and turned, to a fraction of
a pixel, and how likely it is to be an accident: a vote, in the spirit of M. Fischler and R. Bolles, Random Sample
Consensus, Communications of the ACM 24(6), 1981. Things that moved on their own are outvoted.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.special import bdtrc

from hdr_helpers._registering.motion import Motion, fit_motion
from hdr_helpers.papers.grossberg_nayar2003 import intensity_mapping
from hdr_helpers.papers.ward2003 import halved

BLOCK = 16  # pixels across; small, so that a nearly white photograph still has some
STEP = 12  # pixels from one block of the grid to the next
CELL = 4  # pixels; contrast is counted in such cells, of which blocks and steps are multiples
FEW, MANY = 48, 192  # blocks looked for, spread over the picture: a few first, many where those can't agree
CONTRAST = 1.0  # grey levels in the direction of least contrast: less is noise
ALIKE = 0.6  # correlation from which on a block counts as found
REACH = 8  # pixels each way that a block is looked for
AGREE = 1.0  # pixels by which blocks that tell the same may differ; twice that where near and far things part
TURNS = np.arange(-10, 11) / 5  # degrees tried; in between, and at the ends, least squares takes over
BIAS = 0.1  # pixels by which neighbouring blocks can be wrong together: they see the same edge
SURE = 0.8  # share of the blocks that leaves nothing to be found by turning
ENOUGH = 12  # blocks from which on turns are tried
FIT = 4  # blocks from which on least squares is asked for a turn
SETTLED = 0.25  # pixels at the corners: a turn known so well is taken as it is, a less certain one where it is large
FINE = 3  # pixels each way that a block is looked for at the next finer level
FEWER = 32  # blocks are enough there: they are larger, and known to agree


class View:
    """A photograph for looking up blocks: whole in a small copy, and block by block at finer levels.

    image : (H, W, 3) uint8 or uint16; valid : (H, W) bool or None; levels : small is 2**levels times smaller

    small, half : grey, uint8, half is half as large again; clear, half_clear : 255 where they are valid
    histogram : (256,) counts of small's valid values
    contrast : of the block that starts at each CELL of small
    """

    def __init__(self, image, valid, levels: int):
        self.image, self.levels = image, levels
        self.small = self._reduced(image, levels)
        self.clear = np.full(self.small.shape, 255, np.uint8)
        if valid is not None:
            self.clear[self._reduced(valid.view(np.uint8) * 255, levels) < 255] = 0
        self.histogram = cv2.calcHist([self.small], [0], self.clear, [256], [0, 256]).ravel().astype(np.float64)
        self.half, self.half_clear = halved(self.small, self.clear)
        self.middle = np.array(image.shape[1::-1]) / 2
        self.contrast = self._contrast()

    def _contrast(self) -> np.ndarray:
        """For the BLOCK that starts at each CELL of small, its contrast in the direction in which it has least.

        Along an edge a block can slide without looking different, and its neighbours slide with it. Grey levels, rms
        difference over four pixels; 0 where not all of the block is valid.
        """
        block, radius = BLOCK // 2, BLOCK // 4  # in pixels of half
        least = cv2.cornerMinEigenVal(np.float32(self.half), block, ksize=3)
        least[cv2.erode(self.half_clear, np.ones((block, block), np.uint8)) == 0] = 0
        rows, cols = (
            np.minimum(np.arange(max(n // CELL, 1)) * CELL // 2 + radius, m - 1)
            for n, m in zip(self.small.shape, least.shape, strict=True)
        )
        return np.sqrt(np.maximum(least[np.ix_(rows, cols)], 0))

    @staticmethod
    def _reduced(pixels, levels) -> np.ndarray:
        """Grey, 8 bits, 2**levels times smaller; rows and columns that do not fill a pixel are left out."""
        height, width = (n >> levels for n in pixels.shape[:2])
        if levels:
            whole = pixels[: height << levels, : width << levels]
            pixels = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)
        if pixels.dtype == np.uint16:
            pixels = (pixels >> 8).astype(np.uint8)
        return pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)

    def patch(self, place, radius: int, level: int) -> np.ndarray | None:
        """Grey pixels round a place (x, y) of a level, (2 radius, 2 radius); None where they leave the picture."""
        (x0, y0), size = (int(c) - radius for c in place), 2 * radius
        if level == self.levels:
            found = self.small[max(y0, 0) : y0 + size, max(x0, 0) : x0 + size]
            return found if found.shape == (size, size) else None
        y0, x0, size = y0 << level, x0 << level, size << level
        found = self.image[max(y0, 0) : y0 + size, max(x0, 0) : x0 + size]
        return self._reduced(found, level) if found.shape[:2] == (size, size) else None


@dataclass(frozen=True)
class Vote:
    """What the blocks say.

    motion : of the moving picture onto the fixed one, in pixels of the full picture
    agree, blocks : how many blocks say so, of how many that were looked for
    chance : bound on the probability that so many would agree by accident
    turn_known : whether they tell the turn; if not, none is assumed
    within : pixels of the full picture by which they differ at most
    places : (N, 2), where the blocks that agree lie in the fixed picture, from its middle
    """

    motion: Motion
    agree: int
    blocks: int
    chance: float
    turn_known: bool
    within: float
    places: np.ndarray


def ask_blocks(fixed: View, moving: View, shift, most: int = FEW) -> Vote:
    """The vote on a guess: is moving, moved by shift = (dx, dy) pixels of the small copy, where fixed is?

    most : blocks to ask at most
    """
    unit = 2.0**fixed.levels
    guess = Motion(*np.array(shift) * unit)
    places = spread(fixed, moving, shift, most) * unit - fixed.middle
    asked, found, target = look_up(fixed, moving, places, guess, fixed.levels, REACH, BLOCK)
    best = Vote(guess, 0, asked, 1.0, False, 0.0, target)
    for turns, agree in ([0.0], AGREE), (TURNS, AGREE), (TURNS, 2 * AGREE):
        if len(found) < (2 if len(turns) == 1 else ENOUGH) or best.agree > SURE * asked:
            break
        near = _largest_agreement(found, target, turns, agree * unit)
        # Another block agrees by chance at few of the positions that it was tried at; but we chose among many.
        positions = (2 * REACH + 1) ** 2
        one = (2 * agree + 1) ** 2 / positions
        chance = min(1.0, len(turns) * positions / 9 * float(bdtrc(near.sum() - 1, asked, one)))
        if chance < best.chance:
            motion, known = _settled(found[near], target[near], unit, fixed)
            best = Vote(motion, int(near.sum()), asked, chance, known, agree * unit, target[near])
    return best


def refine(fixed: View, moving: View, vote: Vote) -> Vote:
    """The same vote with its motion to a fraction of a pixel: its blocks are looked up again at ever finer levels."""
    motion, known = vote.motion, vote.turn_known
    for level in range(max(fixed.levels - 1, 0), -1, -1):
        unit = 2**level
        asked, found, target = look_up(fixed, moving, vote.places[:FEWER], motion, level, FINE, 2 * BLOCK)
        off = target - motion(found)
        # Near and far things part by as much at every level; the blocks' own error shrinks with it.
        limit = AGREE * unit if vote.within <= AGREE * 2**fixed.levels else vote.within
        near = np.abs(off - np.median(off, axis=0)).max(axis=1) <= limit if len(off) else np.zeros(0, dtype=bool)
        if near.sum() < max(2, asked / 3):
            break  # too noisy from here on: the coarser answer stands
        motion, known = _settled(found[near], target[near], unit, fixed)
    return replace(vote, motion=motion, turn_known=known)


def spread(fixed, moving, shift, most) -> np.ndarray:
    """Middles (n, 2) of the blocks of fixed's small copy to ask: with contrast in both pictures, and everywhere.

    From each eighth of the width and height first the best, then the second best, and so on.
    """
    height, width = fixed.small.shape
    x, y = np.meshgrid(np.arange(0, width - BLOCK + 1, STEP), np.arange(0, height - BLOCK + 1, STEP))
    corner = np.stack([x.ravel(), y.ravel()], axis=1)
    there = corner - shift
    inside = np.all((there >= REACH) & (there + BLOCK + REACH <= (width, height)), axis=1)
    corner, there = corner[inside], there[inside] // CELL
    corner_cell = corner // CELL
    contrast = np.minimum(
        fixed.contrast[corner_cell[:, 1], corner_cell[:, 0]], moving.contrast[there[:, 1], there[:, 0]]
    )
    corner, contrast = corner[contrast >= CONTRAST], contrast[contrast >= CONTRAST]
    part = corner[:, 0] * 8 // width + corner[:, 1] * 8 // height * 8
    order = np.lexsort((-contrast, part))
    first = np.searchsorted(part[order], part[order])
    rank = np.arange(len(order)) - first
    order = order[np.lexsort((-contrast[order], rank))][:most]
    return corner[order] + BLOCK // 2


def look_up(fixed, moving, places, motion, level, reach, size) -> tuple[int, np.ndarray, np.ndarray]:
    """Look for blocks of fixed in moving, where motion says that they are and up to reach pixels round it.

    places : (N, 2) in fixed, pixels of the full picture from its middle
    Returns how many were looked for; of those found, where in moving, and where in fixed; both (n, 2) as places.
    """
    nothing = 0, np.empty((0, 2)), np.empty((0, 2))
    if not len(places):
        return nothing
    unit, radius = 2**level, size // 2
    # The darker picture is brought to the other's brightness; correlation would forgive a factor, but not a curve.
    darker, brighter = sorted((fixed, moving), key=lambda v: v.histogram @ np.arange(256) / v.histogram.sum())
    curve = np.rint(intensity_mapping(darker.histogram, brighter.histogram)).astype(np.uint8)
    here = np.rint((places + fixed.middle) / unit).astype(int)
    there = np.rint((motion.inverse()(here * unit - fixed.middle) + moving.middle) / unit).astype(int)
    blocks, offsets = [], []
    for k, (a, b) in enumerate(zip(here.tolist(), there.tolist(), strict=True)):
        block, window = fixed.patch(a, radius, level), moving.patch(b, radius + reach, level)
        if block is None or window is None:
            continue
        if darker is fixed:
            block = cv2.LUT(block, curve)
        else:
            window = cv2.LUT(window, curve)
        blocks.append(k)
        offsets.append(cv2.matchTemplate(window, block, cv2.TM_CCOEFF_NORMED))
    if not blocks:
        return nothing
    offset, peaked = _peaks(np.array(offsets))
    here, there = here[blocks][peaked] * unit, (there[blocks][peaked] + offset[peaked]) * unit
    return len(blocks), there - moving.middle, here - fixed.middle


def _peaks(likeness) -> tuple[np.ndarray, np.ndarray]:
    """Where the peaks of correlations (n, size, size) lie, (n, 2) as (x, y) from their middles, and (n,) which count.

    Fractions of a pixel by a parabola. A peak counts if it is high and not at the edge.
    """
    n, size, _ = likeness.shape
    y, x = np.divmod(likeness.reshape(n, -1).argmax(axis=1), size)
    best = likeness[np.arange(n), y, x]
    counts = (best >= ALIKE) & (x > 0) & (y > 0) & (x < size - 1) & (y < size - 1)
    y, x = np.clip(y, 1, size - 2), np.clip(x, 1, size - 2)
    offset = np.stack([x, y], axis=1) - size // 2 + 0.0
    for axis, (i, j) in enumerate(((0, 1), (1, 0))):
        before, after = likeness[np.arange(n), y - i, x - j], likeness[np.arange(n), y + i, x + j]
        bend = np.maximum(2 * best - before - after, 1e-9)
        offset[:, axis] += np.clip((after - before) / 2 / bend, -0.5, 0.5)
    return offset, counts


def _largest_agreement(found, target, turns, tolerance) -> np.ndarray:
    """(n,) bool: the most blocks that one of them and one of the turns can explain."""
    shifts = np.array([target - Motion(degrees=degrees)(found) for degrees in turns])
    apart = np.abs(shifts[:, :, None] - shifts[:, None]) <= tolerance
    near = apart[..., 0] & apart[..., 1]
    most = near.sum(axis=2)
    return near[np.unravel_index(most.argmax(), most.shape)]


def _settled(found, target, unit, view) -> tuple[Motion, bool]:
    """The motion of blocks that agree, and whether they tell the turn; where they do not, none is assumed."""
    if len(found) >= FIT:
        motion, error = fit_motion(found, target, BIAS * unit)
        corners = Motion(degrees=error).reach(view.image.shape)
        if corners < SETTLED * unit or abs(motion.degrees) > 3 * error:
            return motion, True
    return Motion(*np.mean(target - found, axis=0)), False
