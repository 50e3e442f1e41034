"""Answers to the TODOs of notebook 2."""

import cv2
import numpy as np
from mistakes.corpus import answer, right, slip, wrong

answer(
    "2.1",
    """
    def threshold_bitmaps(gray, tolerance=4):
        median = np.median(gray)
        bright = gray > median
        clear = np.abs(gray.astype(int) - median) > tolerance
        return bright, clear
    """,
)
slip("2.1", "mean", "np.median(gray)", "np.mean(gray)")
slip("2.1", "equals the median", "gray > median", "gray >= median")
slip("2.1", "swapped", "gray > median", "gray <= median")
slip("2.1", "fixed grey level", "gray > median", "gray > 127")
slip("2.1", "wraps round", "gray.astype(int) - median", "gray - np.uint8(median)")
slip("2.1", "turned round", ") > tolerance", ") <= tolerance")
slip("2.1", "exactly the tolerance", ") > tolerance", ") >= tolerance")
slip("2.1", "has no sign", "np.abs(gray.astype(int) - median)", "(gray.astype(int) - median)")
slip("2.1", "tolerance is 4", "> tolerance", "> 4")
slip("2.1", "booleans", "return bright, clear", "return bright * np.uint8(255), clear * np.uint8(255)")
slip("2.1", "2 things", "return bright, clear", "return bright")
slip("2.1", "None", "    return bright, clear\n", "")


@wrong("2.1", says="calls createAlignMTB,")
def opencv_does_it(gray, tolerance=4):
    mtb, eb = np.zeros_like(gray), np.zeros_like(gray)
    cv2.createAlignMTB(exclude_range=tolerance).computeBitmaps(gray, mtb, eb)
    return mtb > 0, eb > 0


@right("2.1")
def by_percentile(gray, tolerance=4):
    middle = float(np.percentile(gray, 50))
    return np.greater(gray, middle), ~((gray >= middle - tolerance) & (gray <= middle + tolerance))


@right("2.1")
def by_sorting(gray, tolerance=4):
    middle = int(np.sort(gray.ravel())[gray.size // 2])
    return gray > middle, cv2.absdiff(gray, np.full_like(gray, middle)) > tolerance


answer(
    "2.2",
    """
    def disagreement(bright_a, clear_a, bright_b, clear_b):
        both = clear_a & clear_b
        differ = bright_a ^ bright_b
        if both.sum() == 0:
            return 1.0
        return (differ & both).sum() / both.sum()
    """,
)
slip("2.2", "number of pixels", " / both.sum()", "")
slip("2.2", "all pixels", "/ both.sum()", "/ both.size")
slip("2.2", "clear in one frame alone", "clear_a & clear_b", "clear_a | clear_b")
slip("2.2", "Only the first frame", "clear_a & clear_b", "clear_a")
slip("2.2", "agree", "bright_a ^ bright_b", "bright_a == bright_b")
slip("2.2", "bright in", "bright_a ^ bright_b", "bright_a | bright_b")
slip("2.2", "bright in both", "bright_a ^ bright_b", "bright_a & bright_b")
slip("2.2", "perfect agreement", "return 1.0", "return 0.0")
slip("2.2", "NaN", "if both.sum() == 0:", "if False:")
slip("2.2", "noise", "return (differ & both).sum() / both.sum()", "return differ.mean()")


@wrong("2.2", says="TypeError")
def booleans_subtracted(bright_a, clear_a, bright_b, clear_b):
    return np.abs(bright_a - bright_b)[clear_a & clear_b].mean()


@right("2.2")
def by_not_equal(bright_a, clear_a, bright_b, clear_b):
    counted = np.logical_and(clear_a, clear_b)
    return 1.0 if not counted.any() else np.mean(bright_a[counted] != bright_b[counted])


answer(
    "2.3",
    """
    def overlap(fixed, moving, shift):
        (height, width), (dx, dy) = fixed.shape, shift
        here = fixed[max(dy, 0) : height + min(dy, 0), max(dx, 0) : width + min(dx, 0)]
        there = moving[max(-dy, 0) : height + min(-dy, 0), max(-dx, 0) : width + min(-dx, 0)]
        return here, there

    def best_shift(fixed, moving, start=(0, 0)):
        best, least = None, 2
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                shift = start[0] + dx, start[1] + dy
                a, b = overlap(fixed[0], moving[0], shift)
                c, d = overlap(fixed[1], moving[1], shift)
                error = disagreement(a, c, b, d)
                if error < least:
                    least = error
                    best = shift
        return best
    """,
)
slip("2.3", "sign is turned round", "return best\n", "return -best[0], -best[1]\n")
slip(
    "2.3",
    "sign is turned round",
    "fixed[0], moving[0], shift",
    "moving[0], fixed[0], shift",
    "fixed[1], moving[1], shift",
    "moving[1], fixed[1], shift",
)
slip("2.3", "swapped", "return best\n", "return best[1], best[0]\n")
slip("2.3", "swapped", "return best\n", "return best[::-1]\n")
slip("2.3", "step from start", "best = shift", "best = dx, dy")
slip("2.3", "look around start", "shift = start[0] + dx, start[1] + dy", "shift = dx, dy")
slip("2.3", "tried last", "if error < least:", "if True:")
slip("2.3", "None", "if error < least:", "if error > least:")
slip("2.3", "tried last", "least = error", "pass")
slip(
    "2.3",
    "tried last",
    "shift = start[0] + dx, start[1] + dy",
    "current[:] = [start[0] + dx, start[1] + dy]; shift = current",
    "best, least = None, 2",
    "best, least, current = None, 2, [0, 0]",
)
slip(
    "2.3",
    "opposite edge",
    "overlap(fixed[0], moving[0], shift)",
    "fixed[0], np.roll(moving[0], shift, (1, 0))",
    "overlap(fixed[1], moving[1], shift)",
    "fixed[1], np.roll(moving[1], shift, (1, 0))",
)
slip("2.3", "seconds at most", "for dx in (-1, 0, 1):", "while True:\n        dx = 0")


@right("2.3")
def by_min(fixed, moving, start=(0, 0)):
    def error(shift):
        dx, dy = shift
        h, w = fixed[0].shape
        here = np.s_[max(dy, 0) : h + min(dy, 0), max(dx, 0) : w + min(dx, 0)]
        there = np.s_[max(-dy, 0) : h - max(dy, 0), max(-dx, 0) : w - max(dx, 0)]
        both = fixed[1][here] & moving[1][there]
        return np.mean((fixed[0][here] ^ moving[0][there])[both]) if both.any() else 1

    return np.array(min(((start[0] + x, start[1] + y) for x in (-1, 0, 1) for y in (-1, 0, 1)), key=error))
