"""The figure that opens the course: its whole way in five pictures."""

import cv2
import numpy as np
from matplotlib.figure import Figure

from hdr_helpers.align import bitmaps
from hdr_helpers.crf import recover_crf
from hdr_helpers.lab.figures.style import CHANNELS, DPI, INK, WIDTH, bare, headline
from hdr_helpers.merge import merge_debevec
from hdr_helpers.tonemap import luminance, tonemap

STEPS = (
    ("1 load", "photographs and times"),
    ("2 align", "bitmaps, alike at any exposure"),
    ("3 recover the response", "what a pixel value means"),
    ("4 merge", "the light of the scene"),
    ("5 tone-map", "one picture for a screen"),
)
HEIGHT = 2.0  # inches
BOX, GAP, FOOT = 0.168, 0.04, 0.14  # widths of a step and between two, and what is below, as shares of the figure


def way_figure(bracket):
    """The five steps of the course side by side, on a Bracket."""
    crf = recover_crf(bracket).crf
    radiance = merge_debevec(bracket.images, bracket.times, crf).radiance
    picture = tonemap(radiance, "durand")
    fig = Figure(figsize=(WIDTH, HEIGHT), dpi=DPI, facecolor="white")
    shape = picture.shape[0] / picture.shape[1]
    tall = BOX * WIDTH / HEIGHT * shape
    axes = [fig.add_axes((k * (BOX + GAP), FOOT, BOX, tall)) for k in range(len(STEPS))]
    images = [bracket.images[k] for k in (-1, len(bracket.images) // 2, 0)]
    bright, _ = bitmaps(cv2.cvtColor(images[1], cv2.COLOR_RGB2GRAY))
    light = np.log2(np.maximum(luminance(radiance), 1e-9))
    low, high = np.percentile(light, (0.5, 99.5))
    axes[0].imshow(_stack(images))
    axes[1].imshow(bright, cmap="gray")
    axes[3].imshow(light, cmap="viridis", vmin=low, vmax=high)
    axes[4].imshow(picture)
    for ax, (name, what) in zip(axes, STEPS, strict=True):
        bare(ax)
        ax.set_title(name, fontsize=10.5, weight="bold", color=INK)
        ax.set_xlabel(what, fontsize=8.5, color=INK)
    _draw_response(axes[2], crf)
    for k in range(1, len(STEPS)):
        right = k * (BOX + GAP) - 0.006
        place = {"xycoords": "figure fraction", "textcoords": "figure fraction"}
        arrow = {"arrowstyle": "-|>", "color": INK, "shrinkA": 0, "shrinkB": 0}
        middle = FOOT + tall / 2
        axes[0].annotate(
            "", (right, middle), (right - GAP + 0.012, middle), arrowprops=arrow, annotation_clip=False, **place
        )
    headline(fig, "From photographs that each miss something to one picture that shows everything")
    return fig


def _stack(images, share=0.72):
    """Photographs of one size laid over one another, the last on top, on an area of their size; share : of its width"""
    rows, cols = images[0].shape[:2]
    height, width = int(share * rows), int(share * cols)
    area = np.full_like(images[0], 255)
    for k, image in enumerate(images):
        y, x = k * (rows - height) // (len(images) - 1), k * (cols - width) // (len(images) - 1)
        small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
        area[y : y + height, x : x + width] = cv2.copyMakeBorder(
            small[4:-4, 4:-4], 4, 4, 4, 4, cv2.BORDER_CONSTANT, value=(255,) * 3
        )
    return area


def _draw_response(ax, crf):
    for g, (_, colour, style, _) in zip(crf, CHANNELS, strict=True):
        ax.plot(g / np.log(2), color=colour, linestyle=style)
    ax.set(xlim=(0, 255), ylim=(-9, 4))
    ax.spines[["left", "bottom"]].set_visible(True)
