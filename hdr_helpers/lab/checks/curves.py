"""Checks of the end of notebook 3: the curves of three channels, and their plot."""

from functools import cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from hdr_helpers.crf import gsolve, hat_weights, sample_pixels
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.checks._running import Wrong
from hdr_helpers.lab.checks._todos import Todo
from hdr_helpers.lab.checks._words import array, close, described, finite, recognised, something

LEVELS = 256
NAMES = ("red", "green", "blue")


def _course_my_crf(images, B, lam, w, rows, cols):
    Z = np.array(images)[:, rows, cols]
    return np.array([gsolve(Z[..., c].T, B, lam, w)[0] for c in range(3)])


my_crf = Todo(
    "3.5",
    "my_crf",
    _course_my_crf,
    uses=("hat", "sample_values", "build_system", "my_gsolve"),
    barred=("crf",),
    hints=(
        "What do the three channels share, and what does each have of its own?",
        "my_gsolve returns two things; which of them is the curve?",
        "Three arrays (256,) become one (3, 256): which function of NumPy stacks them, and along which axis?",
    ),
    praise="Three curves. Before you plot them: where must they meet?",
)


@cache
def _bracket(seed, key):
    """The virtual camera's bracket, photographs of a scene with colours, and positions in it."""
    rng = np.random.default_rng((seed, 35, key))
    scene = np.exp2(rng.uniform(-5, 4, (40, 50, 1)) + rng.uniform(-1.5, 1.5, (40, 50, 3)) + [0.8, 0, -0.8])
    shot = Camera(seed=seed + key, jpeg_quality=None).shoot(scene, 0.01 * 2.5 ** np.arange(6))
    return shot, *sample_pixels(shot.images, 60, seed=seed)


@cache
def _solution(seed, key, lam, w):
    shot, rows, cols = _bracket(seed, key)
    return _course_my_crf(shot.images, shot.log_times, lam, np.array(w), rows, cols)


@my_crf.part(1, "The curves are an array (3, 256).")
def _(trial):
    shot, rows, cols = _bracket(trial.seed, 1)
    crf = array(trial.run(list(shot.images), shot.log_times, 20.0, hat_weights(), rows, cols), "crf", (3, LEVELS), "f")
    finite(crf, "crf")


@my_crf.part(2, "Each channel has its own curve, from the samples at rows and cols.")
def _(trial):
    for key, lam, w in ((1, 20.0, hat_weights()), (2, 40.0, hat_weights() + 1)):
        shot, rows, cols = _bracket(trial.seed, key)
        images, B = list(shot.images), shot.log_times
        crf = trial.run(images, B, lam, w, rows, cols)
        spec = _solution(trial.seed, key, lam, tuple(w))
        trial.compare("crf", crf, spec)
        if close(crf, spec, 3e-3):
            continue
        for c in range(3):
            if close(crf, np.tile(spec[c], (3, 1)), 3e-3):
                raise Wrong(f"All three curves are that of {NAMES[c]}: the channel has to change from one to the next.")
        if close(crf[0], spec[0], 3e-3) and not close(crf[1], spec[1], 3e-3) and not close(crf[2], spec[2], 3e-3):
            raise Wrong("Red is right, green and blue are not: something is kept from one channel to the next.")
        suspects = {
            "Red and blue are swapped: crf[0] belongs to channel 0, red.": spec[::-1],
            "It is exp(g) that is returned; crf holds g, a logarithm.": np.exp(spec),
            "The three curves were averaged; each channel has a response of its own.": np.tile(
                spec.mean(axis=0), (3, 1)
            ),
            "The seconds went in where their logarithm should.": _course_my_crf(images, np.exp(B), lam, w, rows, cols),
            "The weights are always the hat; use those that are given.": _course_my_crf(
                images, B, lam, hat_weights(), rows, cols
            ),
        }
        if np.abs(crf - shot.truth.crf)[:, 20:235].max() < 0.4:
            near = "These are curves of this camera, but not those of the samples at rows and cols with lam and w."
        else:
            near = "The curves are not those of the samples at rows and cols."
        raise Wrong(recognised(crf, suspects, near, 3e-3))


def _course_plot_curves(crf):
    from hdr_helpers.lab.figures.crf import CHANNELS

    fig = Figure(figsize=(9, 3.4), layout="constrained")
    ax = fig.add_subplot()
    for g, (name, colour, style, _) in zip(crf, CHANNELS, strict=True):
        ax.semilogy(np.exp(g), color=colour, linestyle=style, label=name)
    ax.set(xlabel="measured pixel value", ylabel="calibrated exposure")
    ax.legend(frameon=False)
    return fig


plot_curves = Todo(
    "3.6",
    "plot_curves",
    _course_plot_curves,
    barred=("crf",),
    hints=(
        "g is the logarithm of what? What has to be done to it before it is an exposure?",
        "Which method of an Axes makes its vertical axis logarithmic?",
        "crf[0] is red. Which argument of plot sets the colour, and which the name in the legend?",
        "Would someone who can't tell red from green read your plot? What else can differ between lines?",
    ),
    praise="A plot that can be read. Now compare the curves: which channel saturates first?",
)


def _plotted(trial):
    crf = np.sort(trial.rng(36).normal(0, 2, (3, LEVELS)), axis=1) + 0.3 * np.arange(3)[:, None]
    figure = trial.run(crf)
    if figure is None:
        raise Wrong("It returns None; hand back the Figure, and let the cell show it.")
    if isinstance(figure, tuple) and figure and isinstance(figure[0], Figure):
        raise Wrong("It returns a tuple; the Figure alone is asked for.")
    if isinstance(figure, Axes):
        raise Wrong("It returns the Axes; the Figure that holds them is asked for: ax.figure.")
    if not isinstance(figure, Figure):
        raise Wrong(f"It returns {described(figure)}; it should return a matplotlib Figure.")
    something(figure, "a Figure")
    return crf, figure, [line for ax in figure.axes for line in ax.lines]


def _order(crf, lines, f=np.exp):
    """For each channel the line that shows it, or None."""
    shown = [np.asarray(line.get_ydata(), dtype=np.float64) for line in lines]
    return [next((line for line, y in zip(lines, shown, strict=True) if close(y, f(g))), None) for g in crf]


@plot_curves.part(1, "It returns a Figure.")
def _(trial):
    _, figure, lines = _plotted(trial)
    if not figure.axes:
        raise Wrong("The Figure is empty; it has no axes.")
    if len(lines) < 3:
        raise Wrong(f"The Figure has {len(lines)} lines; one for each channel is asked for.")


@plot_curves.part(1, "It shows exp(g) against the pixel value, for all channels.")
def _(trial):
    crf, _, lines = _plotted(trial)
    found = _order(crf, lines)
    if None in found:
        if None not in _order(crf, lines, lambda g: g):
            raise Wrong("It shows g, the logarithm; asked for is the exposure, exp(g), on a logarithmic axis.")
        xs = [np.asarray(line.get_xdata(), dtype=np.float64) for line in lines]
        if all(any(close(x, np.exp(g)) for x in xs) for g in crf):
            raise Wrong("The axes are swapped: the pixel value goes to the right, the exposure up.")
        raise Wrong("The lines are not exp(g) of the three channels, each over its 256 pixel values.")
    for line in found:
        if not close(np.asarray(line.get_xdata(), dtype=np.float64), np.arange(LEVELS)):
            raise Wrong("The horizontal axis does not hold the pixel values 0 to 255.")


@plot_curves.part(1, "Each curve has the colour of its channel.")
def _(trial):
    crf, _, lines = _plotted(trial)
    found = _order(crf, lines)
    found = lines[:3] if None in found else found
    strongest = [int(np.argmax(to_rgb(line.get_color()))) for line in found]
    if strongest == [0, 1, 2]:
        return
    if strongest == [2, 1, 0]:
        raise Wrong("Red and blue are swapped: crf[0] is the curve of red, in RGB order.")
    if len({to_rgb(line.get_color()) for line in found}) == 1:
        raise Wrong("All curves have the same colour; give each that of its channel.")
    raise Wrong("The curves do not have the colours of their channels: say color='red' and so on, in the order of crf.")


@plot_curves.part(1, "The vertical axis is logarithmic, and axes and curves have names.")
def _(trial):
    _, figure, _ = _plotted(trial)
    axes = [ax for ax in figure.axes if ax.lines]
    if any(ax.get_yscale() == "linear" for ax in axes):
        raise Wrong(
            "The vertical axis is linear, so that all but the brightest values lie at the bottom; make it 'log'."
        )
    words = (
        [ax.get_ylabel() or figure.get_supylabel() for ax in axes],
        [ax.get_xlabel() or figure.get_supxlabel() for ax in axes],
    )
    if not any(words[0]) or not any(words[1]):
        raise Wrong("An axis has no label; a plot without them is a line without a meaning.")
    if any("log" in word.lower() and "exposure" in word.lower() for word in words[0]):
        raise Wrong("The axis is called a log exposure, but shows exp(g): that is an exposure.")
    if (
        not any(ax.get_legend() for ax in axes)
        and not figure.legends
        and not all(ax.texts or ax.get_title() for ax in axes)
    ):
        raise Wrong("There is no legend: give each line a label, then call legend().")
