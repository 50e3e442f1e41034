"""Figures of stage 1: exposures, histograms, clipping, what one photograph knows."""

from dataclasses import replace

import cv2
import numpy as np
from matplotlib import patheffects

from hdr_helpers._reading.evidence import transfer
from hdr_helpers.crf import CLIPPED, NOISE
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.figures.style import (
    ACCENT,
    BRIGHT_MARK,
    CHANNELS,
    DARK_MARK,
    INK,
    THREE,
    WIDTH,
    bare,
    headline,
    new_figure,
    pictures_figure,
    plain,
    seconds,
)
from hdr_helpers.lab.scenes import chapel_scene

CURVES = (("gamma 2.2, a guess", BRIGHT_MARK, ""), ("the camera's true curve", "#009E73", "//"))
PREVIEW = 800  # pixels across of a single photograph
TILE = 320  # pixels across of a photograph on a contact sheet
TOO_DARK, TOO_BRIGHT = NOISE + 1, CLIPPED  # pixel values below and from which a JPEG says nothing to rely on


def strip_figure(bracket, title=None, cols=5):
    """All photographs of a bracket as a contact sheet."""
    scale = min(1, TILE / bracket.images[0].shape[1])
    images = bracket.in_8_bits().images
    small = [cv2.resize(i, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) for i in images]
    return pictures_figure(small, [seconds(t) for t in bracket.times], cols, title)


def clipping_overlay(image):
    """A photograph, (H, W, 3) uint8, with rising stripes where it is too bright, falling where too dark."""
    rows, cols = np.ogrid[: image.shape[0], : image.shape[1]]
    marked = image.copy()
    dark, bright = unusable(image)
    marked[bright & ((rows + cols) % 8 < 4)] = (230, 159, 0)
    marked[dark & ((rows - cols) % 8 < 4)] = (0, 114, 178)
    return marked


def _small(image, width: int):
    """A picture at most so wide, shrunk without averaging, so that what is clipped stays clipped."""
    scale = min(1, width / image.shape[1])
    return cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)


def histogram_frame(image):
    """A photograph with its unusable pixels striped, beside its histograms.

    image : (H, W, 3) uint8
    Returns a Figure, and fill(image, time), which puts a photograph of that size into it.
    """
    fig, (left, right) = new_figure(1, 2, 3.7, width_ratios=[1.4, 1])
    bare(left)
    shown = left.imshow(_small(image, PREVIEW))
    left.set_title("striped: too dark (blue) or too bright (orange)", fontsize=10)
    lines = _draw_histogram(right, image)
    right.set(xlabel="pixel value", ylabel="share of pixels (%)")
    legend = right.legend(frameon=False, loc="upper center")
    usable, message = right.set_title("", fontsize=10), headline(fig, "")

    def fill(image, time):
        shown.set_data(clipping_overlay(_small(image, PREVIEW)))
        for line, share in zip(lines, _histogram(image), strict=True):
            line.set_ydata(share)
        usable.set_text(f"{usable_share(image):.0%} of the pixels usable")
        message.set_text(f"exposure time {seconds(time)}")
        return [shown, *lines, *right.spines.values(), legend, usable, message]

    return fig, fill


def usable_share(image) -> float:
    """Share of the pixels of a photograph, (H, W, 3) uint8, that are usable in all three channels."""
    return 1 - float(np.logical_or(*unusable(image)).mean())


def unusable(image) -> tuple[np.ndarray, np.ndarray]:
    """Where a photograph, (H, W, 3) uint8, is too dark, and where too bright, in any channel: two (H, W) bool."""
    red, green, blue = cv2.split(image)
    darkest, brightest = cv2.min(cv2.min(red, green), blue), cv2.max(cv2.max(red, green), blue)
    return darkest < TOO_DARK, brightest >= TOO_BRIGHT


def clipping_strip_figure(bracket, which):
    """Photographs of a bracket in a row, their unusable pixels striped, above their histograms.

    which : indices of the photographs
    """
    bracket = bracket.in_8_bits()
    aspect = bracket.images[0].shape[0] / bracket.images[0].shape[1]
    fig, axes = new_figure(2, len(which), WIDTH / len(which) * aspect + 2.5, height_ratios=[1, 1.2])
    for i, (above, below) in zip(which, axes.T, strict=True):
        image = bracket.images[i]
        bare(above)
        above.imshow(clipping_overlay(_small(image, TILE)))
        above.set_title(seconds(bracket.times[i]), fontsize=10)
        _draw_histogram(below, image)
        below.set(xticks=(0, 128, 255), xlabel="pixel value", ylabel="share of pixels (%)")
        below.label_outer()
    axes[1, 0].legend(frameon=False, fontsize=9)
    headline(fig, "As the time grows, the histogram moves from the dark end to the bright one")
    return fig


def _draw_histogram(ax, image):
    """Share of pixels at each value, on a logarithmic scale, with the unusable values shaded. Returns the lines."""
    lines = [
        ax.plot(share, color=colour, ls=style, label=name)[0]
        for (name, colour, style, _), share in zip(CHANNELS, _histogram(image), strict=True)
    ]
    ax.axvspan(0, TOO_DARK, color=DARK_MARK, alpha=0.25)
    ax.axvspan(TOO_BRIGHT, 255, color=BRIGHT_MARK, alpha=0.35)
    ax.set(ylim=(0.01, 100), yscale="log", xlim=(0, 255))
    plain(ax)
    return lines


def _histogram(image) -> list[np.ndarray]:
    """Share of the pixels at each value, (256,), in per cent, for red, green and blue."""
    counts = [np.bincount(image[..., c].ravel(), minlength=256) for c in range(3)]
    return [count / count.sum() * 100 for count in counts]


def transfer_figure(bracket, j):
    """What the pixel values of photograph j became in the next one, and in those after it."""
    images, times = [image[..., 1] for image in bracket.in_8_bits().images], bracket.times
    histograms = [np.bincount(image.ravel(), minlength=256) for image in images]
    joint = np.histogram2d(images[j + 1].ravel(), images[j].ravel(), bins=256, range=((0, 256), (0, 256)))[0]
    fig, (left, right) = new_figure(1, 2, 4.6)
    left.imshow(np.log1p(joint), origin="lower", cmap="Greys", extent=(0, 256, 0, 256))
    left.set_title("grey: all pixels; line: from the two histograms alone", fontsize=10)
    left.set_ylabel(f"pixel value at {seconds(times[j + 1])}")
    for ax, steps in ((left, (1,)), (right, (1, 2, 3))):
        for k, (colour, style, _) in zip(steps, THREE, strict=False):
            here, there = transfer(histograms[j], histograms[j + k])
            stops = np.log2(times[j + k] / times[j])
            ax.plot(
                here, there, color=colour, ls=style, lw=2.5, label=f"{seconds(times[j + k])}: {stops:.1f} stops longer"
            )
        ax.plot((0, 256), (0, 256), color=ACCENT, ls="-.", label="equal exposures")
        ax.set(xlabel=f"pixel value at {seconds(times[j])} (green)", xlim=(0, 256), ylim=(0, 256), aspect="equal")
        ax.legend(frameon=False, loc="lower right", fontsize=9)
    right.set(ylabel="pixel value in the other photograph")
    right.set_title("the longer the exposure, the further from equal", fontsize=10)
    headline(fig, "Pixels that are equal in one photograph are equal in the next; a longer time lifts the curve")
    return fig


def iso_figure():
    """A dim part of the chapel twice, equally bright, the second time from a sixteenth of the photons."""
    part = chapel_scene()[220:340, 180:360]
    camera = Camera(jpeg_quality=None)
    cameras = camera, replace(camera, full_well=camera.full_well / 16)  # fewer photons to a pixel value
    pictures = [c.photograph(0.15 * part / part.mean(), frame=0) for c in cameras]
    titles = ["ISO 100, 1/4 s", "ISO 1600, 1/64 s"]
    return pictures_figure(
        pictures, titles, title="The same brightness from a sixteenth of the light: noise, most of all in the dark"
    )


def pixel_figure(bracket, points, title="One curve for each pixel, at a different place on the axis of time"):
    """Up to three pixels followed through all exposures. points : name -> (row, column)"""
    bracket = bracket.in_8_bits()
    fig, (left, right) = new_figure(1, 2, 3.7, width_ratios=[1.3, 1])
    bare(left)
    left.imshow(bracket.images[len(bracket) // 2 + 1])
    for (name, (row, col)), (colour, style, marker) in zip(points.items(), THREE, strict=False):
        left.plot(col, row, marker, ms=11, mfc="none", mec="white", mew=4)
        left.plot(col, row, marker, ms=11, mfc="none", mec=colour, mew=2)
        label = left.annotate(name, (col, row), (10, 8), textcoords="offset points", color="white", weight="bold")
        label.set_path_effects([patheffects.withStroke(linewidth=3, foreground=INK)])
        values = [image[row, col, 1] for image in bracket.images]
        right.plot(bracket.times, values, marker + style, color=colour, label=name)
    right.set(xscale="log", xlabel="exposure time (s)", ylabel="pixel value (green)", ylim=(-5, 262))
    right.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1), ncols=3)
    plain(right)
    headline(fig, title)
    return fig


def one_photo_figure(bracket, errors):
    """What each photograph alone says of the scene; errors as one_photo_errors gives them."""
    labels = [seconds(t) for t in bracket.times]
    fig, (left, right) = new_figure(1, 2, 3.4)
    bars = left.bar(labels, [100 * usable_share(image) for image in bracket.images], color=DARK_MARK, edgecolor=INK)
    left.bar_label(bars, fmt="%.0f%%", fontsize=9)
    left.set(ylabel="usable pixels (%)", ylim=(0, 105))
    left.set_title("what each photograph holds", fontsize=10)
    places = np.arange(len(labels))
    for shift, (name, colour, hatch), wrong in zip((-0.2, 0.2), CURVES, zip(*errors, strict=True), strict=True):
        worst = [error.p95 for error in wrong]
        right.bar(places + shift, worst, 0.4, color=colour, hatch=hatch, edgecolor=INK, label=name)
    right.set(ylabel="error, 95th percentile (stops)", xticks=places, xticklabels=labels, ylim=(0, 7.5))
    right.legend(frameon=False, fontsize=9, loc="upper right")
    right.set_title("how wrong it is when taken for the whole scene", fontsize=10)
    for ax in (left, right):
        ax.tick_params(axis="x", rotation=45)
        plain(ax)
        ax.grid(False)
    headline(fig, "Neither the range nor the curve can be had from one photograph")
    return fig
