"""Figures of stage 2: ghosts, bitmaps, shifts."""

import cv2
import numpy as np

from hdr_helpers.align import bitmaps, move_image
from hdr_helpers.lab.figures.style import INK, THREE, headline, new_figure, pictures_figure, plain, seconds


def detail_figure(pictures, titles, detail, title=None, cols=None, scale=4):
    """The same detail of several pictures, enlarged. detail : (top, left, height, width) in pixels"""
    top, left, height, width = detail
    crops = [p[top : top + height, left : left + width] for p in pictures]
    large = [
        cv2.resize(np.ascontiguousarray(c), None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC) for c in crops
    ]
    large = [np.clip(c, 0, 1) if c.dtype != np.uint8 else c for c in large]
    return pictures_figure(large, titles, cols, title)


def bitmaps_figure(images, times):
    """Photographs above their median threshold bitmaps, excluded pixels in pink."""
    below = []
    for image in images:
        bright, clear = bitmaps(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
        shown = np.repeat(bright[..., None], 3, axis=2)
        shown[clear == 0] = (204, 121, 167)
        below.append(shown)
    titles = [*(seconds(t) for t in times), *("median threshold bitmap" for _ in times)]
    return pictures_figure(
        [*images, *below],
        titles,
        len(images),
        "The photographs change with exposure, their bitmaps hardly do",
    )


def hand_figure(fixed, moving, shift):
    """Two bitmaps laid over each other at a shift (dx, dy): grey and white where they agree, else coloured.

    Orange is bright in fixed alone, blue in moving alone.

    fixed, moving : (bright, clear) of align.bitmaps. Returns (H, W, 3) uint8.
    """
    bright, clear = (move_image(bits, shift) for bits in moving)
    counted = (clear & fixed[1]) > 0
    picture = np.full((*bright.shape, 3), 205, dtype=np.uint8)
    picture[fixed[0] > 0] = 255
    picture[~counted] = 165
    picture[counted & (fixed[0] > bright)] = (213, 94, 0)
    picture[counted & (fixed[0] < bright)] = (0, 114, 178)
    return picture


def shifts_figure(times, found, truth):
    """Shifts in x and y against exposure time. found : name -> (P, 2); truth : (P, 2)"""
    fig, axes = new_figure(1, 2, 3.2, sharex=True)
    for axis, (ax, name) in enumerate(zip(axes, ("right (px)", "down (px)"), strict=True)):
        ax.plot(times, truth[:, axis], "+", ms=16, mew=2, color=INK, label="truth")
        for (who, shifts), (colour, style, marker) in zip(found.items(), THREE, strict=False):
            ax.plot(times, shifts[:, axis], marker + style, color=colour, mfc="none", ms=8, label=who)
        ax.set(xscale="log", xlabel="exposure time (s)", ylabel=name)
        plain(ax)
    axes[1].legend(frameon=False)
    headline(fig, "OpenCV's shift of the darkest photograph is far off, and nothing says so")
    return fig
