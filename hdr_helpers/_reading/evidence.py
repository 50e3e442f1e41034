"""What the photographs themselves say of their exposure times.

The same light falls on the sensor in every exposure, so the pixel value that u in one photograph becomes
in the next, T(u), obeys g(T(u)) - g(u) = ln of the ratio of their times, with one response g for all
pairs. T follows from the two histograms alone (Grossberg and Nayar, What can be known about the
radiometric response from images, ECCV 2002), so the photographs need not be aligned. A smooth g is fitted
by least absolute deviations, so a photograph whose time is wrong stands out and does not bend it.
"""

import itertools
from typing import NamedTuple

import numpy as np

DARKEST, BRIGHTEST = 24, 240  # pixel values between which a photograph can be trusted
MIN_LEVELS, MIN_PIXELS = 6, 300  # what a pair must have in common to be measured
LIMIT = 0.7  # stops; response, noise and a moved camera leave up to half a stop in real sets
TYPICAL = np.array([1.2, 1.4, 1.0, 0.0])  # on _basis: near the middle of the cameras that were measured
PRIOR = 0.5  # weight of the typical response, in pairs; decides only where pairs are few


class Evidence(NamedTuple):
    """What neighbouring photographs, shortest exposure first, show beside what their times claim.

    claimed : (P-1,) ln of the ratio of the times; seen : (P-1,) the same from the pixels, NaN where too
    few pixels are well exposed in both
    """

    claimed: np.ndarray
    seen: np.ndarray

    @property
    def excess(self) -> np.ndarray:
        """(P-1,) float64, stops by which the pixels' ratio exceeds the claimed one; 0 where that may be chance."""
        seen, claimed = (np.nan_to_num(x) / np.log(2) for x in (self.seen, self.claimed))
        stops = np.where(np.isnan(self.seen), 0.0, seen - claimed)
        # Where T(u) = u the photographs are exposed alike, whatever the response.
        alike = ~np.isnan(self.seen) & (seen < 0.1) & (claimed > 0.5)
        strong = (np.abs(stops) > LIMIT) | alike
        # A wrong time shows on both sides of its photograph; beside a strong sign a weaker one counts too.
        beside = np.append(strong[1:], False) | np.append(False, strong[:-1])
        return np.where(strong | (beside & (np.abs(stops) > LIMIT / 2)), stops, 0.0)


def measure(histograms, times) -> Evidence:
    """Compare neighbours.

    histograms : (P, 256) counts of pixel values, shortest exposure first; times : (P,) seconds, ascending
    """
    claimed = np.diff(np.log(times))
    pairs = [transfer(a, b) for a, b in itertools.pairwise(histograms)]
    steps = [_basis(there) - _basis(here) for here, there in pairs]
    known = [j for j, step in enumerate(steps) if len(step)]
    seen = np.full(len(claimed), np.nan)
    if known:
        response = _fit_response(steps, known, np.log(times))
        seen[known] = [np.median(steps[j] @ response) for j in known]
    return Evidence(claimed, seen)


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


def looks_brighter(first, second) -> float:
    """How many times as bright a second photograph looks, for a typical response; NaN where that can't be told.

    first, second : (256,) counts of pixel values
    """
    here, there = transfer(first, second)
    return float(np.exp(np.median((_basis(there) - _basis(here)) @ TYPICAL))) if len(here) else float("nan")


def transfer(first, second) -> tuple[np.ndarray, np.ndarray]:
    """Pixel values of one photograph and, by matching histograms, what they became in the next."""
    below_first, below_second = (np.cumsum(h) - h / 2 for h in (first, second))
    here = np.arange(256.0)
    filled = np.flatnonzero(second)
    there = np.interp(below_first, below_second[filled], filled)
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
        return []
    # One wrong time shows in two pairs, too long in one and too short in the other. Where it can be told
    # which photograph is off, most others agree with one another; pairs that were not measured cut the chain.
    measured = np.nan_to_num(evidence.seen - evidence.claimed) / np.log(2)
    sentences = []
    cuts = np.flatnonzero(np.isnan(evidence.seen)) + 1
    for chain in np.split(np.arange(len(times)), cuts):
        off = np.concatenate([[0.0], np.cumsum(excess[chain[:-1]])])
        usual = max(off, key=lambda o: np.sum(np.abs(off - o) <= LIMIT / 2))
        off -= usual
        wrong = np.zeros(len(chain), dtype=bool)
        for i in np.argsort(-np.abs(off)):  # no more photographs than it takes to explain every pair
            unexplained = measured[chain[:-1]] - np.diff(np.where(wrong, off, 0))
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
