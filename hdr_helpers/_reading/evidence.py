"""What the photographs themselves say of their exposure times.

The same light falls on the sensor in every exposure, so the pixel value that u in one photograph becomes
in the next, T(u), obeys g(T(u)) - g(u) = ln of the ratio of their times, with one response g for all
pairs. T follows from the two histograms alone (papers/grossberg_nayar2003.py), so the photographs need not
be aligned. A smooth g is fitted by least absolute deviations, so a photograph whose time is wrong stands out
and does not bend it.
"""

import itertools
from typing import NamedTuple

import numpy as np

from hdr_helpers.papers.grossberg_nayar2003 import intensity_mapping

DARKEST, BRIGHTEST = 24, 240  # pixel values between which a photograph can be trusted
MIN_LEVELS, MIN_PIXELS = 6, 300  # what a pair must have in common to be measured
LIMIT = 0.7  # stops; response, noise and a moved camera leave up to half a stop in real sets
TYPICAL = np.array([1.2, 1.4, 1.0, 0.0])  # on _basis: near the middle of the cameras that were measured
MAX_SCALE = 3  # a common power on all times is part of any response; beyond this no camera has it
PRIOR = 0.5  # weight of the typical response, in pairs; decides only where pairs are few


class Evidence(NamedTuple):
    """What neighbouring photographs, shortest exposure first, show beside what their times claim.

    claimed : (P-1,) ln of the ratio of the times
    seen : (P-1,) the same from the pixels, NaN where too few are well exposed in both
    typical : (P-1,) the same if the response were TYPICAL; it owes nothing to the times
    """

    claimed: np.ndarray
    seen: np.ndarray
    typical: np.ndarray

    @property
    def stops(self) -> np.ndarray:
        """(P-1,) float64, stops by which the pixels' ratio exceeds the claimed one; 0 where it was not measured."""
        return np.nan_to_num((self.seen - self.claimed) / np.log(2))

    @property
    def excess(self) -> np.ndarray:
        """(P-1,) float64, the same, but 0 where it may be chance."""
        seen, claimed, size = self.seen / np.log(2), self.claimed / np.log(2), np.abs(self.stops)
        # Where T(u) = u the photographs are exposed alike, whatever the response. (NaN compares as False.)
        strong = (size > LIMIT) | ((seen < 0.1) & (claimed > 0.5))
        # A wrong time shows on both sides of its photograph; beside a strong sign a weaker one counts too.
        beside = np.append(strong[1:], False) | np.append(False, strong[:-1])
        return np.where(strong | (beside & (size > LIMIT / 2)), self.stops, 0.0)

    @property
    def scale(self) -> float:
        """How many times more stops a typical camera would need for these photographs than the times claim."""
        ratio = self.typical / self.claimed
        return float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else 1.0


def measure(histograms, times) -> Evidence:
    """Compare neighbours.

    histograms : (P, 256) counts of pixel values, shortest exposure first; times : (P,) seconds, ascending
    """
    pairs = [transfer(a, b) for a, b in itertools.pairwise(histograms)]
    steps = [_basis(there) - _basis(here) for here, there in pairs]
    known = [j for j, step in enumerate(steps) if len(step)]
    seen, typical = np.full((2, len(steps)), np.nan)
    if known:
        response = _fit_response(steps, known, np.log(times))
        seen[known] = [np.median(steps[j] @ response) for j in known]
        typical[known] = [np.median(steps[j] @ TYPICAL) for j in known]
    return Evidence(np.diff(np.log(times)), seen, typical)


def _fit_response(steps, known, log_times) -> np.ndarray:
    """Coefficients of the log inverse response on _basis, (4,), that most of the times agree with.

    steps : P-1 arrays (n, 4), what a change from one photograph to the next adds to each function of _basis
    known : indices of the pairs where n > 0; log_times : (P,) ln seconds
    """
    size = len(TYPICAL)
    mean = np.array([step.mean(axis=0) if len(step) else np.zeros(size) for step in steps])
    # Unknown beside the response: one constant for every chain of photographs without a gap.
    chain = np.concatenate([[0], np.cumsum([len(step) == 0 for step in steps])])
    constants = chain[-1] + 1
    since_first = np.concatenate([np.zeros((1, size)), np.cumsum(mean, axis=0)])
    # By least absolute deviations: the log time of every photograph, which a swap of two can't bend, and the
    # step of every pair, which a wrong first or last can't bend.
    photographs = np.hstack([since_first, np.eye(constants)[chain]])
    robust = np.vstack([photographs, np.pad(mean[known], ((0, 0), (0, constants)))])
    claims = np.concatenate([log_times, np.diff(log_times)[known]])
    # By least squares: all values of a pair agree on its step, and the response is not far from typical.
    within = [(steps[j] - mean[j]) / np.sqrt(len(steps[j])) for j in known]
    smooth = np.pad(np.concatenate([*within, PRIOR * np.eye(size)]), ((0, 0), (0, constants)))
    wanted = np.concatenate([np.zeros(len(smooth) - size), PRIOR * TYPICAL])
    weights = np.ones(len(claims))
    for least in np.geomspace(2, 0.05, 40):  # reweighted least squares, ever nearer to absolute deviations
        root = np.sqrt(weights)
        A, b = np.concatenate([root[:, None] * robust, smooth]), np.concatenate([root * claims, wanted])
        x = np.linalg.lstsq(A, b, rcond=None)[0]
        weights = 1 / np.maximum(np.abs(robust @ x - claims), least)
    return x[:size]


def transfer(first, second) -> tuple[np.ndarray, np.ndarray]:
    """Well-exposed pixel values of one photograph and what they became in the next; empty where there are too few.

    first, second : (256,) counts of pixel values
    """
    here, there = np.arange(256.0), intensity_mapping(first, second)
    both = (first > 0) & (np.minimum(here, there) > DARKEST) & (np.maximum(here, there) < BRIGHTEST)
    if both.sum() < MIN_LEVELS or first[both].sum() < MIN_PIXELS:
        return np.empty(0), np.empty(0)
    return here[both], there[both]


def _basis(z) -> np.ndarray:
    """ln of the pixel value and a cubic: enough for the response of most cameras between the limits."""
    x = z / 255
    return np.stack([np.log(x), x, x**2 - x, (x - 0.5) ** 3], axis=-1)


def doubts(evidence: Evidence, times, names, source: str) -> list[str]:
    """A sentence for every time that the photographs contradict, with what they suggest.

    times : (P,) seconds, ascending, by source; names : P file names in that order
    """
    excess = evidence.excess
    if not excess.any():
        if 1 / MAX_SCALE < evidence.scale < MAX_SCALE:
            return []
        stops = np.log2(times[-1] / times[0])
        return [
            f"By {source} the times span {stops:.2g} stops, but the photographs look about "
            f"{stops * evidence.scale:.2g} stops apart; check that these are exposure times."
        ]
    # One wrong time shows in two pairs, too long in one and too short in the other. Where it can be told
    # which photograph is off, most others agree with one another; pairs that were not measured cut the chain.
    sentences = []
    cuts = np.flatnonzero(np.isnan(evidence.seen)) + 1
    for chain in np.split(np.arange(len(times)), cuts):
        off = np.concatenate([[0.0], np.cumsum(excess[chain[:-1]])])
        usual = max(off, key=lambda o: np.sum(np.abs(off - o) <= LIMIT / 2))
        off -= usual
        wrong = np.zeros(len(chain), dtype=bool)
        for i in np.argsort(-np.abs(off)):  # no more photographs than it takes to explain every pair
            unexplained = evidence.stops[chain[:-1]] - np.diff(np.where(wrong, off, 0))
            if np.abs(off[i]) > LIMIT / 2 and np.any(np.abs(unexplained) > LIMIT):
                wrong[i] = True
        if 0 < 3 * wrong.sum() < len(chain):
            for i in chain[wrong]:
                fits = times[i] * 2.0 ** off[i - chain[0]]
                sentences.append(
                    f"{names[i]}: {times[i]:.4g} s by {source}, but it looks as if exposed for about {fits:.2g} s; "
                    "check its time."
                )
        else:
            for i in chain[:-1][excess[chain[:-1]] != 0]:
                sentences.append(
                    f"{names[i]} and {names[i + 1]}: {times[i]:.4g} s and {times[i + 1]:.4g} s by {source}, "
                    f"{np.exp(evidence.claimed[i]):.3g} times the light, but it looks like "
                    f"{np.exp(evidence.seen[i]):.2g} times; check both times."
                )
    return sentences
