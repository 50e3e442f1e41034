"""Figures of stage 4: estimates of one pixel, radiance maps shown honestly, errors."""

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import TwoSlopeNorm

from hdr_helpers.lab.figures.style import (
    INK,
    MUTED,
    THREE,
    bare,
    headline,
    new_figure,
    pictures_figure,
    plain,
    seconds,
)
from hdr_helpers.tonemap import luminance, tonemap_gamma


def pixel_estimates_figure(bracket, crf, w, points):
    """What every photograph says of a pixel's log irradiance, and with what weight. points : name -> (row, col)"""
    fig, axes = new_figure(1, len(points), 3.5, sharey=False)
    for ax, (name, (row, col)), (colour, _, marker) in zip(axes, points.items(), THREE, strict=False):
        values = np.array([image[row, col, 1] for image in bracket.images])
        said = (crf[1, values] - bracket.log_times) / np.log(2)
        weight = w[values]
        ax.scatter(range(len(said)), said, s=12 + 2.2 * weight, marker=marker, color=colour, edgecolor=INK)
        for i, value in enumerate(values):
            ax.annotate(value, (i, said[i]), (0, 9), textcoords="offset points", ha="center", fontsize=8)
        mean = (weight * said).sum() / max(weight.sum(), 1e-9)
        ax.axhline(mean, color=MUTED, ls="--")
        ax.set(xticks=range(len(said)), xlim=(-0.6, len(said) - 0.4))
        ax.set_xticklabels([seconds(t) for t in bracket.times], rotation=60, fontsize=8)
        ax.set_title(name, fontsize=10)
        ax.margins(y=0.2)
        plain(ax)
    axes[0].set_ylabel("log2 E, by each photograph")
    headline(fig, "Photographs agree where they can see; large marks have large weights (numbers: pixel values)")
    return fig


def weights_figure(curves, times, title):
    """Weights of each pixel value, a panel for each of some photographs; the highest of all panels is 1.

    curves : name -> (P, 256) weights; times : (P,) seconds of these photographs
    """
    fig, axes = new_figure(1, len(times), 3.2, sharey=True)
    highest = {name: weights.max() for name, weights in curves.items()}
    for k, (ax, t) in enumerate(zip(axes, times, strict=True)):
        for (name, weights), (colour, style, _) in zip(curves.items(), THREE, strict=False):
            ax.plot(weights[k] / highest[name], style, color=colour, label=name)
        ax.set(xlabel="pixel value Z", yscale="log", ylim=(1e-6, 2))
        ax.set_title(seconds(t), fontsize=10)
        plain(ax)
    axes[0].set_ylabel("weight")
    axes[0].legend(frameon=False, loc="lower center")
    headline(fig, title)
    return fig


def held_out_figure(photograph, predicted, missed, title):
    """A photograph that was left out, its prediction from the others, and by how much they differ.

    photograph : (H, W, 3) uint8; predicted : (H, W, 3), 0..255; missed : (H, W, 3) difference, NaN where unusable
    """
    fig, (left, middle, right) = new_figure(1, 3, 2.9)
    for ax in (left, middle, right):
        bare(ax)
    left.imshow(photograph)
    left.set_title("the photograph that was left out", fontsize=10)
    middle.imshow(np.uint8(np.clip(predicted, 0, 255)))
    middle.set_title("predicted from the others", fontsize=10)
    colours = colormaps["PuOr_r"].with_extremes(bad="#888888")
    shown = right.imshow(missed.mean(axis=2), cmap=colours, norm=TwoSlopeNorm(0, -12, 12), interpolation="none")
    right.set_title("photograph minus prediction", fontsize=10)
    bar = fig.colorbar(shown, ax=right, shrink=0.8, pad=0.02, extend="both")
    bar.set_label("pixel values")
    headline(fig, title)
    return fig


def viewed_at(radiance, stops: float, gamma: float = 2.2):
    """A radiance map as a photograph would show it: exposed, clipped, gamma. (H, W, 3) float 0..1.

    stops : exposure; at 0 the median luminance is shown as 18% grey
    """
    middle = np.median(luminance(radiance))
    return tonemap_gamma(radiance * np.float32(0.18 / max(middle, 1e-12)), gamma, stops)


def honest_figure(radiance, title="One radiance map, four exposures of it: nothing is lost, only not shown"):
    """A radiance map at four exposures."""
    stops = (-8, -4, 0, 3)
    return pictures_figure(
        [viewed_at(radiance, s) for s in stops], [f"{s:+d} stops" if s else "0 stops" for s in stops], 4, title
    )


def false_colour_figure(stops, title, label="stops above the median luminance", limits=None):
    """A map of stops, (H, W), in false colour with a bar that can be read."""
    low, high = limits or np.percentile(stops[np.isfinite(stops)], [0.05, 99.95])
    fig, ax = new_figure(1, 1, 5.4)
    bare(ax)
    shown = ax.imshow(stops, cmap="cividis", vmin=low, vmax=high)
    bar = fig.colorbar(shown, ax=ax, shrink=0.85, pad=0.02)
    bar.set_label(label)
    bar.set_ticks(np.arange(np.ceil(low / 2) * 2, high, 2))
    headline(fig, title)
    return fig


def error_figure(errors, titles, title, limit=0.5):
    """Signed error maps in stops, side by side, one colour bar; grey where there is no value.

    errors : arrays (H, W, 3) or (H, W); three channels are averaged
    """
    fig, axes = new_figure(1, len(errors), 8.6 / len(errors) * 0.667 + 0.75, squeeze=False)
    colours = colormaps["PuOr_r"].with_extremes(bad="#888888")
    for ax, error, name in zip(axes[0], errors, titles, strict=True):
        bare(ax)
        flat = error.mean(axis=2) if error.ndim == 3 else error
        shown = ax.imshow(flat, cmap=colours, norm=TwoSlopeNorm(0, -limit, limit), interpolation="none")
        ax.set_title(name, fontsize=10)
    bar = fig.colorbar(shown, ax=axes, shrink=0.8, pad=0.02, extend="both")
    bar.set_label("error (stops)")
    headline(fig, title)
    return fig
