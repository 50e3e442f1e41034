"""Figures of stage 2: ghosts, bitmaps, shifts."""

import cv2
import numpy as np
from matplotlib import colormaps

from hdr_helpers._registering.blocks import AGREE, BLOCK, MANY, REACH, View, look_up, spread
from hdr_helpers.align import Motion, align_mtb, bitmaps, move_image
from hdr_helpers.lab.figures.style import INK, THREE, bare, headline, new_figure, pictures_figure, plain, seconds

EXCLUDED = (204, 121, 167)  # pink


def detail_figure(pictures, titles, detail, title=None, cols=None, scale=4):
    """The same detail of several pictures, enlarged. detail : (top, left, height, width) in pixels"""
    top, left, height, width = detail
    crops = [p[top : top + height, left : left + width] for p in pictures]
    large = [
        cv2.resize(np.ascontiguousarray(c), None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC) for c in crops
    ]
    large = [np.clip(c, 0, 1) if c.dtype != np.uint8 else c for c in large]
    return pictures_figure(large, titles, cols, title)


def bitmaps_figure(images, times, title):
    """Photographs above their median threshold bitmaps, excluded pixels in pink."""
    pictures = [*images, *(_bitmap_picture(image, 50)[0] for image in images)]
    titles = [*(seconds(t) for t in times), *("median threshold bitmap" for _ in times)]
    return pictures_figure(pictures, titles, len(images), title)


def percentiles_figure(brighter, darker, percentile, title):
    """Two photographs' bitmaps at the median, and at another percentile; excluded pixels in pink."""
    pictures, titles = [], []
    for p in (50, percentile):
        for image, name in ((brighter, "brighter"), (darker, "darker")):
            picture, excluded = _bitmap_picture(image, p)
            pictures.append(picture)
            where = "median" if p == 50 else f"{p:g}th percentile"
            titles.append(f"{name} frame, {where}: {excluded:.0%} excluded")
    return pictures_figure(pictures, titles, 2, title)


def _bitmap_picture(image, percentile) -> tuple[np.ndarray, float]:
    """A photograph's bitmap with what is excluded in pink, and the share of that."""
    bright, clear = bitmaps(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), percentile)
    picture = np.repeat(bright[..., None], 3, axis=2)
    picture[clear == 0] = EXCLUDED
    return picture, np.mean(clear == 0)


def vote_figure(fixed, moving, title):
    """Where small blocks of one photograph are found in another: those that agree on one motion, and the others.

    fixed, moving : (H, W, 3) uint8. Arrows show how far a block is from where the common motion would have it, ten
    times enlarged.
    """
    views = [View(image, None, 0) for image in (fixed, moving)]
    match = align_mtb([moving, fixed])
    guess = Motion(*match.shifts[0], match.rotations[0])
    places = spread(*views, np.rint(match.shifts[0]).astype(int), MANY) - views[0].middle
    _, found, target = look_up(*views, places, guess, 0, REACH, 2 * BLOCK)
    off, at = guess(found) - target, target + views[0].middle
    agrees = np.abs(off).max(axis=1) <= AGREE
    fig, ax = new_figure(1, 1, 6.2)
    bare(ax)
    ax.imshow(fixed, alpha=0.55)
    for who, colour, marker, name in (
        (agrees, "#0072B2", "s", "agree"),
        (~agrees, "#D55E00", "X", "see another motion"),
    ):
        ax.plot(*at[who].T, marker, ms=9, mfc="none", mec=colour, mew=1.8, label=f"{who.sum()} blocks {name}")
        ax.quiver(*at[who].T, *10 * off[who].T, angles="xy", scale_units="xy", scale=1, color=colour, width=0.003)
    ax.set(xlim=(0, fixed.shape[1]), ylim=(fixed.shape[0], 0))
    ax.legend(loc="lower left", framealpha=0.95)
    headline(fig, title)
    return fig


def ghost_map_figure(ghosts, picture, title):
    """How many photographs have a say, in colour over a grey picture; where all have it stays grey.

    ghosts : Ghosts; picture : (H, W, 3) in 0..1, of the same size
    """
    says, most = np.sum(ghosts.bracket.valid, axis=0), len(ghosts.bracket)
    colours = colormaps["viridis"].resampled(most)
    fig, ax = new_figure(1, 1, 5.4)
    bare(ax)
    ax.imshow(0.35 + 0.6 * np.repeat(picture.mean(axis=2, keepdims=True), 3, axis=2))
    shown = ax.imshow(np.ma.masked_equal(says, most), cmap=colours, vmin=0.5, vmax=most + 0.5, interpolation="nearest")
    bar = fig.colorbar(shown, ax=ax, ticks=range(1, most), shrink=0.8, boundaries=np.arange(0.5, most))
    bar.set_label("photographs that have a say")
    headline(fig, title)
    return fig


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
