"""Checks of notebook 2: bitmaps, and how far two of them disagree. The search is in shift.py."""

import numpy as np

from hdr_helpers.lab.checks._running import Wrong
from hdr_helpers.lab.checks._todos import Todo
from hdr_helpers.lab.checks._words import array, number, recognised, several


def course_bitmaps(gray, tolerance=4):
    middle = np.percentile(gray, 50)
    return gray > middle, (gray < middle - tolerance) | (gray > middle + tolerance)


threshold_bitmaps = Todo(
    "2.1",
    "threshold_bitmaps",
    course_bitmaps,
    barred=("align",),
    hints=(
        "Which grey value has as many pixels below as above? Is it the mean?",
        "What is np.uint8(3) - np.uint8(5)? Where could that happen in your function?",
        "A pixel can lie too near the median from below or from above: does your second bitmap see both?",
    ),
    praise="Both bitmaps are right. Look at them for a dark and a bright photograph: how much changes?",
)


def _gray(trial, key, shape=(31, 45)):
    """A grey picture, skewed, its median in the lower half, so that mean, median and 128 differ; an odd count."""
    return (255 * trial.rng(21, key).random(shape) ** 2.2).astype(np.uint8)


@threshold_bitmaps.part(1, "It returns two arrays (H, W) of booleans.")
def _(trial):
    gray = _gray(trial, 1)
    for value, what in zip(several(trial.run(gray), 2, "bright and clear"), ("bright", "clear"), strict=True):
        array(value, what, gray.shape, "b")


@threshold_bitmaps.part(1, "Bright is what lies above the median.")
def _(trial):
    for key in (1, 2):
        gray = _gray(trial, key)
        bright = trial.run(gray)[0]
        spec = gray > np.median(gray)
        trial.compare("bright", bright, spec)
        if not np.array_equal(bright, spec):
            raise Wrong(
                recognised(
                    bright,
                    {
                        "Bright is above the mean; a few lamps move the mean, and none of them moves the median.": gray
                        > gray.mean(),
                        "A pixel that equals the median counts as bright; only what is above it should.": gray
                        >= np.median(gray),
                        "Bright and dark are swapped: True should stand where the picture is above its median.": ~spec,
                        "It compares with a fixed grey level; then a longer exposure has another bitmap.": gray > 127,
                        "It compares with a fixed grey level; a longer exposure then has another bitmap.": gray > 128,
                        "It compares with the middle between black and white of the picture, not with the median.": gray
                        > (int(gray.min()) + int(gray.max())) / 2,
                    },
                    f"{np.sum(bright != spec)} of {spec.size} pixels are on the wrong side of the median.",
                )
            )


@threshold_bitmaps.part(1, "Clear is what differs from the median by more than the tolerance.")
def _(trial):
    for key, tolerance in ((1, 4), (2, 11)):
        gray = _gray(trial, key)
        clear = trial.run(gray, tolerance)[1]
        apart = gray.astype(int) - int(np.median(gray))
        wrapped = np.abs(gray - np.uint8(np.median(gray)))
        spec = np.abs(apart) > tolerance
        trial.compare("clear", clear, spec)
        if not np.array_equal(clear, spec):
            mean = np.abs(gray - gray.mean())
            raise Wrong(
                recognised(
                    clear,
                    {
                        "The difference of two uint8 numbers wraps round below 0: uint8 has no negative ones.": wrapped
                        > tolerance,
                        "Clear is turned round: True should stand where a pixel counts.": ~spec,
                        "A pixel exactly the tolerance away is clear; it should be more than the tolerance.": np.abs(
                            apart
                        )
                        >= tolerance,
                        "Only one side of the median is clear; the distance has no sign.": apart > tolerance,
                        "Only one side of the median is clear; a distance has no sign.": apart < -tolerance,
                        "The tolerance is 4 whatever is asked for.": np.abs(apart) > 4,
                        "The distance is taken from the mean, not from the median.": mean > tolerance,
                    },
                    f"{np.sum(clear != spec)} of {spec.size} pixels are wrongly clear or wrongly excluded.",
                )
            )


def course_disagreement(bright_a, clear_a, bright_b, clear_b):
    both = np.logical_and(clear_a, clear_b)
    return float(np.sum(both & (bright_a != bright_b)) / np.sum(both)) if np.any(both) else 1.0


disagreement = Todo(
    "2.2",
    "disagreement",
    course_disagreement,
    barred=("align",),
    hints=(
        "Which pixels count at all: those that are clear in one frame, or in both?",
        "Exactly one of two bits is set: which operator says so?",
        "A share of what? How many pixels stand under the stroke of the fraction?",
        "And if there are none? What should two frames that can't be compared tell the search?",
    ),
    praise="Right. Before you go on: what would two pictures score that have nothing in common?",
)


def _four(trial, key):
    random = trial.rng(22, key).random((4, 19, 26))
    return random[0] < 0.6, random[1] < 0.7, random[2] < 0.35, random[3] < 0.55


@disagreement.part(1, "It returns a single number.")
def _(trial):
    number(trial.run(*_four(trial, 1)), "The share")


@disagreement.part(1, "Of two frames it is the share of pixels clear in both.")
def _(trial):
    for key in (2, 3):
        a, clear_a, b, clear_b = _four(trial, key)
        share = number(trial.run(a, clear_a, b, clear_b), "The share")
        both, differ = clear_a & clear_b, a ^ b
        spec = differ[both].mean()
        trial.compare("the share", share, spec)
        if abs(share - spec) > 1e-9:
            either = clear_a | clear_b
            raise Wrong(
                recognised(
                    share,
                    {
                        "It is a number of pixels; divide it by how many were counted.": np.sum(differ & both),
                        "It divides by all pixels; only those clear in both were counted.": np.mean(differ & both),
                        "Excluded pixels count as well: there noise decides on which side they lie.": np.mean(differ),
                        "A pixel counts that is clear in one frame alone; it has to be clear in both.": differ[
                            either
                        ].mean(),
                        "Only the first frame's excluded pixels are left out.": differ[clear_a].mean(),
                        "Only the second frame's excluded pixels are left out.": differ[clear_b].mean(),
                        "It counts where the bitmaps agree, not where they disagree.": 1 - spec,
                        "It counts pixels bright in both; disagreeing are those bright in exactly one.": (a & b)[
                            both
                        ].mean(),
                        "It counts pixels bright in either frame; disagreeing are those bright in exactly one.": (
                            a | b
                        )[both].mean(),
                    },
                    f"It gives {share:.4g} where {spec:.4g} of the counted pixels differ.",
                )
            )


@disagreement.part(1, "Where no pixel is clear in both, it is 1.")
def _(trial):
    a, clear, b, _ = _four(trial, 4)
    value = trial.run(a, clear, b, ~clear)
    if isinstance(value, (float, np.floating)) and np.isnan(value):
        raise Wrong("Where no pixel is clear in both it gives NaN, 0/0; NaN is never the least, nor anything else.")
    value = number(value, "The share")
    if value == 0:
        raise Wrong("Where no pixel is clear in both it gives 0: a search would take that for perfect agreement.")
    if value != 1:
        raise Wrong(f"Where no pixel is clear in both it gives {value:g}; 1 is asked for.")
