"""The look of every figure: one width, one palette, alt text, pictures side by side."""

import io

import cv2
import numpy as np
from IPython.display import Image, display
from matplotlib.figure import Figure

from hdr_helpers.tonemap import to_8bit

# Okabe and Ito's colours, which the colour-blind can tell apart. A second cue goes with each: line style and
# marker.
CHANNELS = (("red", "#D55E00", "-", "o"), ("green", "#009E73", "--", "s"), ("blue", "#0072B2", ":", "^"))
THREE = (("#E69F00", "-", "o"), ("#0072B2", "--", "^"), ("#009E73", ":", "s"))
INK, ACCENT, MUTED = "#222222", "#CC79A7", "#8A8A8A"
DARK_MARK, BRIGHT_MARK = "#0072B2", "#E69F00"  # too dark and too bright, wherever clipping is shown
WIDTH = 10.0  # inches; every figure of the course is as wide as the text
DPI = 96


def new_figure(rows=1, cols=1, height=3.6, **kwargs):
    """A Figure of the course's width, and its axes, without pyplot's global state."""
    fig = Figure(figsize=(WIDTH, height), dpi=DPI, layout="constrained", facecolor="white")
    return fig, fig.subplots(rows, cols, **kwargs)


def headline(fig, message: str):
    """What the figure says, above it. Returns the Text."""
    return fig.suptitle(message, fontsize=12, weight="bold", color=INK)


def bare(ax) -> None:
    """No ticks, no frame: for photographs."""
    ax.set(xticks=[], yticks=[])
    ax.spines[:].set_visible(False)


def plain(ax) -> None:
    """Two axes and a faint grid: for plots."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(alpha=0.25)


def seconds(t: float) -> str:
    """An exposure time as cameras write it: 1/60 s, 0.6 s, 4 s."""
    return f"1/{round(1 / t)} s" if t < 0.4 else f"{t:.3g} s"


def png_bytes(fig) -> bytes:
    """A Figure as PNG."""
    buffer = io.BytesIO()
    fig.savefig(buffer, format="png")
    return buffer.getvalue()


def jpeg_bytes(picture, quality: int = 88) -> bytes:
    """JPEG of a Figure, or of an RGB picture (H, W, 3), uint8 or float in 0..1."""
    if isinstance(picture, Figure):
        buffer = io.BytesIO()
        picture.savefig(buffer, format="jpeg", pil_kwargs={"quality": quality})
        return buffer.getvalue()
    picture = picture if picture.dtype == np.uint8 else to_8bit(picture)
    options = [cv2.IMWRITE_JPEG_QUALITY, quality]
    return cv2.imencode(".jpg", np.ascontiguousarray(picture[..., ::-1]), options)[1].tobytes()


def show(figure, alt: str) -> None:
    """Put a Figure, or a picture (H, W, 3), into the notebook.

    alt : a sentence that says what is to be seen, for those who can't see it
    Figures with photographs in them become JPEG, plots PNG: small files, sharp lines.
    """
    if isinstance(figure, Figure) and not any(ax.images for ax in figure.axes):
        display(Image(png_bytes(figure), format="png", alt=alt))
    else:
        display(Image(jpeg_bytes(figure), format="jpeg", alt=alt))


def pictures_figure(pictures, titles, cols=None, title=None):
    """Pictures side by side, each under its own title; title is the message of the whole.

    pictures : arrays of one size, (H, W, 3) uint8 or 0..1, or (H, W) grey
    """
    cols = cols or len(pictures)
    rows = -(-len(pictures) // cols)
    aspect = pictures[0].shape[0] / pictures[0].shape[1]
    fig, axes = new_figure(rows, cols, rows * (WIDTH / cols * aspect + 0.3) + (0.35 if title else 0), squeeze=False)
    for ax in axes.flat:
        bare(ax)
    for ax, picture, name in zip(axes.flat, pictures, titles, strict=False):
        ax.imshow(picture, cmap="gray")
        ax.set_title(name, fontsize=10, color=INK)
    if title:
        headline(fig, title)
    return fig
