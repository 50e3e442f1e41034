"""A guess where bitmaps have none: which shift lets the few things that two pictures show lie on each other?"""

import cv2
import numpy as np

CANDIDATES = 6  # shifts given


def correlated_shifts(fixed, moving, max_shift: int) -> list[tuple[int, int]]:
    """Shifts (dx, dy) of moving, in pixels right and down, at which grey values correlate; likeliest first.

    fixed, moving : (gray, valid) each, (H, W) uint8; valid is 255 where a pixel counts, else 0
    max_shift : pixels each way

    In a nearly white photograph some dark spots are left, in a nearly black one some lamps. Which share of the
    pixels they are depends on what has left the frame, so a percentile misleads; their shape does not.
    """
    white = np.mean(moving[0]) > 127
    # What most pixels are counts nothing, so that the rest does.
    a, b = (np.float32(np.where(valid > 0, 255 - gray if white else gray, 0)) for gray, valid in (fixed, moving))
    wide = [cv2.copyMakeBorder(p, *[max_shift] * 4, cv2.BORDER_CONSTANT) for p in (a, a * a, np.ones_like(a))]
    parts = (b, np.ones_like(b), b * b)
    # For every shift: the products in the overlap, and what each of the two has there of its own.
    both, of_fixed, of_moving = (cv2.matchTemplate(w, p, cv2.TM_CCORR) for w, p in zip(wide, parts, strict=True))
    share = np.clip(np.minimum(of_fixed, of_moving) / max(float(of_moving.max()), 1), 0, None)
    score = both / np.sqrt(np.maximum(of_fixed * of_moving, 1)) * np.sqrt(share)
    y, x = np.nonzero(score >= cv2.dilate(score, np.ones((3, 3))))
    best = np.argsort(-score[y, x], kind="stable")[:CANDIDATES]
    return [(int(x[k]) - max_shift, int(y[k]) - max_shift) for k in best]
