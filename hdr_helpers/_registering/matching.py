"""One photograph against its neighbours: guesses from bitmaps, judged by blocks, until one can be trusted."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hdr_helpers._registering.blocks import FEW, MANY, Vote, ask_blocks, refine
from hdr_helpers._registering.correlation import correlated_shifts
from hdr_helpers._registering.motion import Motion
from hdr_helpers.papers.ward2003 import PERCENTILES, clear_share, likely_shifts

CLEAR = 0.225  # share of the pixels on each side of the median, off it in both frames, from which on it is trusted
MORE = 2  # other percentiles tried where the median is not enough
PARTNERS = 3  # neighbours, next first, with which a photograph is compared
MAX_CHANCE = 1e-4  # a match is trusted if blocks would agree like this by accident less often


@dataclass(frozen=True)
class Match:
    """How one photograph was compared with another, and how sure that is.

    partner : index of the photograph that it was laid on
    percentile : at which both were thresholded, 50 is the median; None where only their grey values gave a guess
    agree, blocks : small blocks that tell the motion, of those looked for
    chance : bound on the probability that so many would agree by accident, 0 to 1
    trusted : whether that is little enough
    turn_known : whether the blocks tell the turn; too few in one place do not, and none is assumed
    """

    partner: int
    percentile: float | None
    agree: int
    blocks: int
    chance: float
    trusted: bool
    turn_known: bool


def match_chain(views, reference: int, max_shift: int, side) -> dict[int, tuple[Match | None, Motion]]:
    """Match the photographs of one side of the reference, one after the other.

    views : P View; max_shift : pixels of the full picture
    side : their indices, nearest to the reference first
    Returns for each of them, and the reference, its best Match and its motion onto the reference. One whose match
    can't be trusted moves like the last one that can.
    """
    found = {reference: (None, Motion())}
    known = [reference]  # the photographs whose place is sure, last one last
    for k in side:
        match, motion = _best_match(views, known[: -PARTNERS - 1 : -1], k, max_shift)
        if match is not None and match.trusted:
            found[k] = match, found[match.partner][1].after(motion)
            known.append(k)
        else:
            found[k] = match, found[known[-1]][1]
    return found


def _best_match(views, partners, k, max_shift) -> tuple[Match | None, Motion | None]:
    """The first match of photograph k with one of its partners that can be trusted, else the least doubtful one."""
    best = None
    for partner in partners:
        fixed, moving = views[partner], views[k]
        for percentile, shifts in _guesses(fixed, moving, max_shift):
            vote = _best_vote(fixed, moving, shifts)
            trusted = vote.chance <= MAX_CHANCE
            if trusted:
                vote = refine(fixed, moving, vote)
            if best is None or vote.chance < best.chance:
                best = Match(partner, percentile, vote.agree, vote.blocks, vote.chance, trusted, vote.turn_known)
            if trusted:
                return best, vote.motion
    return best, None


def _guesses(fixed, moving, max_shift) -> Iterator[tuple[float | None, list[tuple[int, int]]]]:
    """Percentiles, and the likeliest shifts that they give in pixels of half; at last (None) those of grey values."""
    halves = [(view.half, view.half_clear) for view in (fixed, moving)]
    reach = -(-max_shift // 2 ** (fixed.levels + 1))
    for percentile in _percentiles(fixed.histogram, moving.histogram):
        yield percentile, likely_shifts(*halves, percentile, reach)
    yield None, correlated_shifts(*halves, reach)


def _best_vote(fixed, moving, shifts) -> Vote:
    """What the blocks say to some shifts, in pixels of half; the rest is not asked once most of them agree."""
    best = None
    for most in FEW, MANY:
        for shift in shifts:
            vote = ask_blocks(fixed, moving, np.multiply(shift, 2), most)
            if best is None or vote.chance < best.chance:
                best = vote
            if best.agree > best.blocks / 2 and best.chance <= MAX_CHANCE:
                break
        if best.chance <= MAX_CHANCE:
            break
    return best


def _percentiles(*histograms) -> Iterator[float]:
    """Those worth trying on two pictures: the median where it splits both well, then what splits them best."""
    median = clear_share(histograms, 50) >= CLEAR
    if median:
        yield 50
    shares = {p: clear_share(histograms, p) for p in PERCENTILES if not (median and p == 50)}
    yield from sorted((p for p in shares if shares[p] > 0), key=lambda p: -shares[p])[:MORE]
