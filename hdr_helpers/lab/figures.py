"""Figures of the course: one style, colours safe for the colour-blind, alt text on every figure.

Functions named *_figure return a matplotlib Figure; show() puts one into a notebook with its alt text.
"""

import io

import cv2
import numpy as np
from IPython.display import Image, display
from matplotlib import colormaps
from matplotlib.figure import Figure

from hdr_helpers.tonemap import luminance, to_8bit

# Okabe and Ito's colours. Red, green and blue channels also differ in line style and marker.
CHANNELS = (("red", "#D55E00", "-", "o"), ("green", "#009E73", "--", "s"), ("blue", "#0072B2", ":", "^"))
INK, ACCENT, MUTED = "#222222", "#CC79A7", "#8A8A8A"
WIDTH = 10.0  # inches; every figure of the course is as wide as the text
DPI = 96


def new_figure(rows=1, cols=1, height=3.6, **kwargs):
    """A Figure of the course's width and its axes, without pyplot's global state."""
    fig = Figure(figsize=(WIDTH, height), dpi=DPI, layout="constrained", facecolor="white")
    return fig, fig.subplots(rows, cols, **kwargs)


def png_bytes(fig) -> bytes:
    """A Figure as PNG."""
    buffer = io.BytesIO()
    fig.savefig(buffer, format="png")
    return buffer.getvalue()


def show(fig, alt: str) -> None:
    """Put a figure, or a picture (H, W, 3) in 0..1 or uint8, into the notebook.

    alt : a sentence that says what is to be seen, for those who can't see it
    Figures with photographs in them become JPEG, plots PNG: small files, sharp lines.
    """
    if isinstance(fig, np.ndarray):
        display(Image(jpeg_bytes(fig), format="jpeg", alt=alt))
    elif any(ax.images for ax in fig.axes):
        buffer = io.BytesIO()
        fig.savefig(buffer, format="jpeg", pil_kwargs={"quality": 85})
        display(Image(buffer.getvalue(), format="jpeg", alt=alt))
    else:
        display(Image(png_bytes(fig), format="png", alt=alt))


def jpeg_bytes(picture, quality: int = 88) -> bytes:
    """JPEG of an RGB picture, (H, W, 3) uint8 or float in 0..1."""
    picture = picture if picture.dtype == np.uint8 else to_8bit(picture)
    options = [cv2.IMWRITE_JPEG_QUALITY, quality]
    return cv2.imencode(".jpg", np.ascontiguousarray(picture[..., ::-1]), options)[1].tobytes()


def _bare(ax):
    ax.set(xticks=[], yticks=[])
    ax.spines[:].set_visible(False)


def _plain(ax):
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(alpha=0.25)


def pictures_figure(pictures, titles, cols=None, title=None, height=None):
    """Pictures side by side, each under its title; title is the message of the whole."""
    cols = cols or len(pictures)
    rows = -(-len(pictures) // cols)
    aspect = pictures[0].shape[0] / pictures[0].shape[1]
    height = height or rows * (WIDTH / cols * aspect + 0.3) + (0.4 if title else 0)
    fig, axes = new_figure(rows, cols, height, squeeze=False)
    for ax in axes.flat:
        _bare(ax)
    for ax, picture, name in zip(axes.flat, pictures, titles, strict=False):
        ax.imshow(picture if picture.ndim == 3 else np.repeat(picture[..., None], 3, axis=2))
        ax.set_title(name, fontsize=10, color=INK)
    if title:
        fig.suptitle(title, fontsize=12, weight="bold", color=INK)
    return fig


def seconds(t: float) -> str:
    """An exposure time as cameras write it: 1/60 s, 0.6 s, 4 s."""
    return f"1/{round(1 / t)} s" if t < 0.4 else f"{t:g} s"


def strip_figure(bracket, title=None, cols=5):
    """All photographs of a bracket as a contact sheet."""
    small = [cv2.resize(i, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for i in bracket.images]
    return pictures_figure(small, [seconds(t) for t in bracket.times], cols, title)


def histogram_figure(image, time, low=3, high=250):
    """A photograph beside its histograms; pixels that can't be used are marked, below black and above white."""
    fig, (left, right) = new_figure(1, 2, 3.4, width_ratios=[1.35, 1])
    _bare(left)
    left.imshow(clipping_overlay(image, low, high))
    left.set_title("striped: too dark (blue) or too bright (orange) to be used", fontsize=10)
    for c, (name, colour, style, _) in enumerate(CHANNELS):
        count = np.bincount(image[..., c].ravel(), minlength=256)
        right.plot(count / count.sum() * 100, color=colour, ls=style, label=name)
    right.axvspan(0, low, color="#0072B2", alpha=0.25)
    right.axvspan(high, 255, color="#E69F00", alpha=0.35)
    right.set(xlabel="pixel value", ylabel="share of pixels (%)", ylim=(0.01, 100), yscale="log", xlim=(0, 255))
    right.legend(frameon=False)
    right.set_title(f"histogram at {seconds(time)}", fontsize=10)
    _plain(right)
    return fig


def clipping_overlay(image, low=3, high=250):
    """A photograph, (H, W, 3) uint8, with unusable pixels striped: rising stripes too bright, falling too dark."""
    rows, cols = np.indices(image.shape[:2])
    marked = image.copy()
    bright, dark = (image >= high).any(axis=2), (image < low).any(axis=2)
    marked[bright & ((rows + cols) % 8 < 4)] = (230, 159, 0)
    marked[dark & ((rows - cols) % 8 < 4)] = (0, 114, 178)
    return marked


def pixel_figure(bracket, points):
    """Pixels followed through all exposures: pixel value against exposure time."""
    fig, (left, right) = new_figure(1, 2, 3.6, width_ratios=[1.25, 1])
    _bare(left)
    left.imshow(bracket.images[len(bracket) // 2 + 1])
    left.set_title("three pixels of one scene", fontsize=10)
    looks = zip(points.items(), ("#E69F00", "#56B4E9", "#009E73"), "o^s", ("-", "--", ":"), strict=True)
    for (name, (row, col)), colour, marker, style in looks:
        left.plot(col, row, marker, ms=11, mfc="none", mec="white", mew=4)
        left.plot(col, row, marker, ms=11, mfc="none", mec=colour, mew=2)
        left.annotate(name, (col, row), (10, 8), textcoords="offset points", color="white", weight="bold")
        values = [image[row, col, 1] for image in bracket.images]
        right.plot(bracket.times, values, marker + style, color=colour, label=name)
    right.set(xscale="log", xlabel="exposure time (s)", ylabel="pixel value (green)", ylim=(-5, 262))
    right.set_title("no single exposure holds all three", fontsize=10)
    right.legend(frameon=False)
    _plain(right)
    return fig


def crf_figure(crf, truth=None, title="Response curve of the camera", other=None, other_name="OpenCV"):
    """Log inverse response of three channels: log exposure against pixel value, and the other way round.

    crf : (3, 256); truth and other likewise, or None: drawn thin and dotted, each gauge removed
    """
    fig, (left, right) = new_figure(1, 2, 3.8)
    z = np.arange(256)
    for c, (name, colour, style, marker) in enumerate(CHANNELS):
        shown = crf[c] - crf[c, 128]
        left.plot(z, shown, color=colour, ls=style, marker=marker, markevery=(10 * c + 8, 48), label=name)
        right.plot(shown, z, color=colour, ls=style, marker=marker, markevery=(10 * c + 8, 48), label=name)
        for curve, ink, width in ((truth, INK, 0.9), (other, ACCENT, 1.6)):
            if curve is not None:
                # The gauge is free: laid over the curve where all of them are well known.
                offset = np.median((shown - curve[c])[40:220])
                left.plot(z, curve[c] + offset, color=ink, lw=width, ls=(0, (1, 1.5)))
                right.plot(curve[c] + offset, z, color=ink, lw=width, ls=(0, (1, 1.5)))
    for curve, ink, label in ((truth, INK, "truth"), (other, ACCENT, other_name)):
        if curve is not None:
            left.plot([], [], color=ink, ls=(0, (1, 1.5)), label=label)
    left.set(xlabel="pixel value Z", ylabel="log exposure g(Z) = ln(E dt)", xlim=(0, 255))
    right.set(ylabel="pixel value Z", xlabel="log exposure ln(E dt)", ylim=(0, 255))
    left.set_title("inverse response: what a value means", fontsize=10)
    right.set_title("response: what the camera makes of light", fontsize=10)
    left.legend(frameon=False)
    _plain(left), _plain(right)
    fig.suptitle(title, fontsize=12, weight="bold", color=INK)
    return fig
