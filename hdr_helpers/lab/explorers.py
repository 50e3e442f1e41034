"""Explorers: pictures with sliders. Each has a static figure beside it in its notebook.

Every explorer draws into one Image widget, so nothing stacks up or flickers when a slider moves. A picture widget can't
have alt text: the line above the picture says in words and units what there is to see.

Nothing here holds moves back, because the browser does: until the kernel has drawn a slider's last value it sends no
other, and then only the newest. The faster a picture is drawn, the more of them are seen.
"""

import html
import inspect
import time
from functools import cache, partial

import cv2
import ipywidgets as widgets
import numpy as np

from hdr_helpers.align import bitmaps
from hdr_helpers.crf import (
    fitted_weights,
    gaussian_weights,
    gsolve,
    hat_weights,
    noise_weights,
    recover_crf,
    sample_pixels,
    uniform_weights,
    whole_white,
)
from hdr_helpers.lab.figures import (
    Live,
    data_on_curve_frame,
    hand_figure,
    histogram_frame,
    jpeg_bytes,
    seconds,
    unusable,
    viewed_at,
)
from hdr_helpers.lab.metrics import crf_rmse
from hdr_helpers.papers.ward2003 import one_level_finer
from hdr_helpers.tonemap import OPERATORS, to_8bit, tonemap

LARGEST = 1024  # pixels, the longer side of what an explorer shows: more would not be seen
PREVIEW = 560  # the same where much is computed while a slider moves: as wide as the controls
STEP_SECONDS = 0.5  # between the steps of what an explorer shows step by step
UNITS = {"contrast": "to 1", "stops": "of exposure"}  # all other parameters of operators are plain numbers
CONTROL = {"style": {"description_width": "190px"}, "layout": {"width": "560px"}}
# Of a name, by buttons: JupyterLab takes the arrow keys from a menu, and leaves Tab and Enter to buttons.
CHOICE = {"style": {"description_width": "190px", "button_width": "auto"}, "layout": {"width": "auto"}}


def _explorer(draw, controls: dict, extra=()):
    """Controls above a picture. draw(**values) returns a picture as figures.jpeg_bytes takes it, and a line of text."""
    # At its own size: a VBox would stretch it to the width of the page.
    image = widgets.Image(format="jpeg", layout={"align_self": "flex-start", "max_width": "100%"})
    line, drawn = widgets.HTML(), {}

    def redraw(_=None):
        values = {name: control.value for name, control in controls.items()}
        if values == drawn:  # controls that moved together are one move
            return
        try:
            picture, line.value = draw(**values)
        except ValueError as refused:  # in a widget nobody would see it
            line.value = html.escape(str(refused))
            return
        image.value = jpeg_bytes(picture)
        drawn.update(values)

    for control in controls.values():
        control.observe(redraw, names="value")
    redraw()
    return widgets.VBox([*controls.values(), *extra, line, image])


def _small(radiance, most: int):
    """A radiance map, its longer side at most so many pixels."""
    scale = most / max(radiance.shape[:2])
    return radiance if scale >= 1 else cv2.resize(radiance, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)


def exposure_explorer(bracket):
    """One photograph of the bracket at a time, its unusable pixels striped, with its histogram."""
    images = dict(zip(bracket.times, bracket.in_8_bits().images, strict=True))
    options = [(seconds(t), t) for t in bracket.times]
    slider = widgets.SelectionSlider(
        options=options, value=bracket.times[len(options) // 2], description="exposure time", **CONTROL
    )
    live = Live(*histogram_frame(bracket.in_8_bits().images[0]))

    @cache
    def draw(time):
        dark, bright = unusable(images[time])
        said = f"<b>{1 - (dark | bright).mean():.0%}</b> of the pixels usable, {dark.mean():.0%} too dark, "
        return live(images[time], time), f"{seconds(time)}: {said}{bright.mean():.0%} too bright"

    return _explorer(draw, {"time": slider})


def align_explorer(fixed, moving, reach=24):
    """Align two photographs, (H, W, 3) uint8, by hand: bring the coloured pixels of their bitmaps to vanish.

    A button lets MTB do it, from the smallest level of the pyramid to the largest, the sliders going along.
    Of large photographs the middle is shown, where a pixel can be seen.
    """
    grays = [cv2.cvtColor(i, cv2.COLOR_RGB2GRAY) for i in (fixed, moving)]
    middle = tuple(slice(max(0, (n - LARGEST) // 2), (n + LARGEST) // 2) for n in grays[0].shape)
    pair = [tuple(bits[middle] for bits in bitmaps(gray)) for gray in grays]
    right = widgets.IntSlider(0, -reach, reach, description="right (px)", **CONTROL)
    down = widgets.IntSlider(0, -reach, reach, description="down (px)", **CONTROL)
    button = widgets.Button(description="Let MTB do it", tooltip="search from the coarsest level to the finest")

    def draw(dx, dy):
        picture = hand_figure(*pair, (dx, dy))
        coloured = (picture[..., 0] != picture[..., 2]).mean()
        return picture, f"<b>{coloured:.2%}</b> of the pixels disagree, moved by {dx:+d} px right and {dy:+d} px down"

    def move(dx, dy):
        with right.hold_trait_notifications(), down.hold_trait_notifications():
            right.value, down.value = dx, dy

    def solve(_):
        button.disabled = True
        move(0, 0)
        for shift in pyramid_walk(*grays, reach):
            time.sleep(STEP_SECONDS)
            move(*shift)
        button.disabled = False

    button.on_click(solve)
    return _explorer(draw, {"dx": right, "dy": down}, [button])


def pyramid_walk(fixed, moving, reach) -> list[tuple[int, int]]:
    """The shift of moving, (dx, dy) in pixels of the full picture, that MTB holds after each level of its pyramid.

    fixed, moving : (H, W) uint8; reach : the largest shift looked for, pixels each way
    """
    levels = int(np.ceil(np.log2(reach + 1)))  # a pixel each way at every level adds up to reach
    shift, steps = (0, 0), []
    for level in reversed(range(levels)):
        size = fixed.shape[1] >> level, fixed.shape[0] >> level
        pair = [bitmaps(cv2.resize(gray, size, interpolation=cv2.INTER_AREA)) for gray in (fixed, moving)]
        shift = one_level_finer(*pair, shift)
        steps.append((shift[0] << level, shift[1] << level))
    return steps


def crf_explorer(bracket, channel=1):
    """The response curve from few or many samples, rough or smooth, with other weights, with exposures left out."""
    smoothness = [k * decade for decade in (0.1, 1, 10, 100, 1000) for k in (1, 2, 5)] + [10_000]
    lam = widgets.SelectionSlider(
        options=[(f"{value:g}", value) for value in smoothness], value=50, description="smoothness (lambda)", **CONTROL
    )
    n = widgets.SelectionSlider(
        options=[5, 10, 20, 50, 100, 200, 500, 1000], value=50, description="samples N (pixels)", **CONTROL
    )
    every = widgets.SelectionSlider(
        options=[("every photograph", 1), ("every second", 2), ("every fourth", 4)],
        value=1, description="exposures", **CONTROL,
    )  # fmt: skip

    weight = widgets.ToggleButtons(
        options=[("hat (Debevec)", "hat"), ("Gaussian (Robertson)", "gaussian"), ("uniform", "uniform"),
                 ("1 / g' (Mitsunaga)", "noise"), ("hat to 0 and 255", "paper's hat")],
        description="weights", **CHOICE,
    )  # fmt: skip
    bracket = bracket.in_8_bits()
    settled = [whole_white(image) for image in bracket.images]
    g = recover_crf(bracket).crf[channel]
    shapes = {"hat": hat_weights, "gaussian": gaussian_weights, "uniform": uniform_weights,
              "noise": partial(noise_weights, g)}  # fmt: skip
    weights = {
        (name, e): fitted_weights(bracket.images[::e], shape=s) for name, s in shapes.items() for _, e in every.options
    }
    weights |= {("paper's hat", e): hat_weights() for _, e in every.options}
    # The axes stay where they are, so that it is the curve that moves; a wild one leaves them.
    live = Live(*data_on_curve_frame((bracket.log_times[0], bracket.log_times[-1]), (g.min(), g.max())))

    @cache
    def samples(n, every):
        rows, cols = sample_pixels(settled[::every], n)
        return np.stack([image[rows, cols, channel] for image in settled[::every]], axis=1)

    def draw(lam, n, weight, every):
        Z, B = samples(n, every), bracket.log_times[::every]
        g, log_E = gsolve(Z, B, lam, weights[weight, every])
        picture = live(Z, B, g, log_E, f"{n} samples in {len(B)} photographs, lambda {lam:g}")
        if bracket.truth is None:
            return picture, f"from 5 to 250 the curve spans <b>{(g[250] - g[5]) / np.log(2):.1f} stops</b>"
        error = crf_rmse(g[None], bracket.truth.crf[channel][None])[0]
        return picture, f"error against the truth: <b>{error:.3f} stops</b> (RMS over values 5 to 250)"

    return _explorer(draw, {"lam": lam, "n": n, "weight": weight, "every": every})


def radiance_explorer(radiance):
    """A radiance map behind an exposure slider, as a photograph taken afterwards would show it."""
    small = _small(radiance, LARGEST)
    slider = widgets.FloatSlider(0, min=-12, max=6, step=0.5, description="exposure (stops)", **CONTROL)

    def draw(stops):
        picture = to_8bit(viewed_at(small, stops))
        # Rounded: at the middle of its way the browser's slider stands at -1.8e-15.
        return picture, f"exposed by {round(stops, 1) + 0:+g} stops: {_clipped(picture)}"

    return _explorer(draw, {"stops": slider})


def _clipped(picture) -> str:
    """Shares of black and of white pixels in a picture, (H, W, 3) uint8, as judging.clipped_share counts them."""
    red, green, blue = cv2.split(picture)
    brightest = cv2.max(cv2.max(red, green), blue)
    return f"<b>{(brightest == 0).mean():.1%}</b> of the pixels black, <b>{(brightest == 255).mean():.1%}</b> white"


def _log_slider(value, steps, readout):
    """So many steps of a tenth of a decade down and up from a value: the browser's slider stands on whole steps."""
    middle = np.log10(value)
    ends = {"min": middle - 0.1 * steps, "max": middle + 0.1 * steps}
    return widgets.FloatLogSlider(value, step=0.1, readout_format=readout, **ends)


def tonemap_explorer(radiance):
    """The operators and their parameters, on a small copy of the radiance map; what an operator lacks is not shown."""
    small = _small(radiance, PREVIEW)
    operator = widgets.ToggleButtons(options=list(OPERATORS), value="reinhard", description="operator", **CHOICE)
    controls = {
        "gamma": widgets.FloatSlider(2.2, min=1, max=4, step=0.1),
        "saturation": widgets.FloatSlider(0.8, min=0, max=1.5, step=0.05),
        "contrast": _log_slider(30, 10, ".1f"),
        "stops": widgets.FloatSlider(0, min=-4, max=10, step=0.5),
        "intensity": widgets.FloatSlider(1, min=-8, max=8, step=0.5),
        "light_adapt": widgets.FloatSlider(0.5, min=0, max=1, step=0.05),
        "color_adapt": widgets.FloatSlider(0, min=0, max=1, step=0.05),
        "key": _log_slider(0.18, 12, ".3g"),
        "bias": widgets.FloatSlider(0.85, min=0.5, max=1, step=0.01),
        "scale": widgets.FloatSlider(0.6, min=0.3, max=1, step=0.02),
    }
    for name, control in controls.items():
        control.description = f"{name} ({UNITS[name]})" if name in UNITS else name
        control.style.description_width, control.layout.width = "190px", "560px"

    def draw(operator, **values):
        has = inspect.signature(OPERATORS[operator]).parameters
        for name, control in controls.items():
            control.layout.display = None if name in has else "none"
        mine = {name: value for name, value in values.items() if name in has}
        picture = to_8bit(tonemap(small, operator, **mine))
        return picture, f"{operator}: {_clipped(picture)}"

    return _explorer(draw, {"operator": operator, **controls})
