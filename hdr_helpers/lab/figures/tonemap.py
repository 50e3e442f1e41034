"""Figures of stage 5: why a screen needs a tone curve."""

import numpy as np

from hdr_helpers.lab.figures.style import ACCENT, INK, MUTED, THREE, headline, new_figure, plain
from hdr_helpers.tonemap import luminance


def eight_bits_figure(radiance):
    """Histogram of a scene's luminance in stops, with the range that one 8-bit picture can show."""
    stops = np.log2(np.maximum(luminance(radiance), 1e-12) / np.median(luminance(radiance)))
    fig, ax = new_figure(1, 1, 3.0)
    ax.hist(stops.ravel(), bins=np.arange(-10, 16, 0.25), color=THREE[1][0], alpha=0.8, density=True)
    top = ax.get_ylim()[1]
    ax.set_ylim(0, 1.2 * top)
    ax.axvspan(-5.5, 2.5, color=THREE[0][0], alpha=0.3)
    ax.annotate("8 stops: a screen of 256 to 1", (-1.5, 1.08 * top), ha="center", color=INK)
    ax.set(xlabel="stops above the median luminance", ylabel="share of pixels per stop")
    plain(ax)
    headline(fig, "The scene is more than twice as wide as the screen")
    return fig


def curve_figure(operators, stops=(-10, 10)):
    """Tone curves: display value against scene luminance in stops. operators : name -> function of (n,) luminance"""
    fig, ax = new_figure(1, 1, 3.4)
    light = np.exp2(np.linspace(*stops, 400)) * 0.18
    looks = [*THREE, (ACCENT, "-.", "d"), (MUTED, "-", "v")]
    for (name, curve), (colour, style, marker) in zip(operators.items(), looks, strict=False):
        ax.plot(np.log2(light / 0.18), curve(light), style, color=colour, marker=marker, markevery=40, label=name)
    ax.set(
        xlabel="scene luminance (stops above middle grey)",
        ylabel="display value",
        ylim=(-0.03, 1.06),
        xticks=range(*stops, 2),
    )
    ax.legend(frameon=False)
    plain(ax)
    headline(fig, "Reinhard's curve bends where clipping breaks off")
    return fig
