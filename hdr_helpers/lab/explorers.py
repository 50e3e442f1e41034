"""Explorers: pictures with sliders. Each has a static figure beside it in its notebook.

Every explorer draws into one Image widget, so nothing stacks up or flickers when a slider moves.
"""

import inspect
import time
from functools import partial

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
)
from hdr_helpers.lab.figures import (
    data_on_curve_figure,
    hand_figure,
    histogram_figure,
    jpeg_bytes,
    seconds,
    viewed_at,
)
from hdr_helpers.lab.metrics import crf_rmse
from hdr_helpers.papers.ward2003 import one_level_finer
from hdr_helpers.tonemap import OPERATORS, expose_for_screen, tonemap

PREVIEW = 640  # pixels across in explorers that compute while a slider moves
STEP_SECONDS = 0.5  # between the steps of what an explorer shows step by step
CONTROL = {"style": {"description_width": "190px"}, "layout": {"width": "560px"}}


def _explorer(draw, controls: dict, extra=()):
    """Controls above a picture. draw(**values) returns JPEG bytes, or JPEG bytes and a line of text."""
    # At its own size: a VBox would stretch it to the width of the page.
    image = widgets.Image(format="jpeg", layout={"align_self": "flex-start", "max_width": "100%"})
    line = widgets.HTML()

    def redraw(_=None):
        drawn = draw(**{name: control.value for name, control in controls.items()})
        image.value, line.value = drawn if isinstance(drawn, tuple) else (drawn, "")

    for control in controls.values():
        control.observe(redraw, names="value")
    redraw()
    return widgets.VBox([*controls.values(), *extra, line, image])


def exposure_explorer(bracket):
    """One photograph of the bracket at a time, its unusable pixels striped, with its histogram."""
    images = bracket.in_8_bits().images
    drawn = {t: jpeg_bytes(histogram_figure(i, t)) for i, t in zip(images, bracket.times, strict=True)}
    options = [(seconds(t), t) for t in bracket.times]
    slider = widgets.SelectionSlider(
        options=options, value=bracket.times[len(options) // 2], description="exposure time", **CONTROL
    )
    return _explorer(lambda time: drawn[time], {"time": slider})


def align_explorer(fixed, moving, reach=24):
    """Align two photographs, (H, W, 3) uint8, by hand: bring the coloured pixels of their bitmaps to vanish.

    A button lets MTB do it, from the smallest level of the pyramid to the largest, the sliders going along.
    """
    grays = [cv2.cvtColor(i, cv2.COLOR_RGB2GRAY) for i in (fixed, moving)]
    pair = [bitmaps(gray) for gray in grays]
    right = widgets.IntSlider(0, -reach, reach, description="right (px)", **CONTROL)
    down = widgets.IntSlider(0, -reach, reach, description="down (px)", **CONTROL)
    button = widgets.Button(description="Let MTB do it", tooltip="search from the coarsest level to the finest")

    def draw(dx, dy):
        picture = hand_figure(*pair, (dx, dy))
        coloured = (picture[..., 0] != picture[..., 2]).mean()
        return jpeg_bytes(picture), f"<b>{coloured:.2%}</b> of the pixels disagree at ({dx:+d}, {dy:+d})"

    def solve(_):
        right.value = down.value = 0
        for dx, dy in pyramid_walk(*grays, reach):
            time.sleep(STEP_SECONDS)
            right.value, down.value = dx, dy

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
    lam = widgets.FloatLogSlider(50, base=10, min=-1, max=4, step=0.25, description="smoothness (lambda)", **CONTROL)
    n = widgets.SelectionSlider(
        options=[5, 10, 20, 50, 100, 200, 500, 1000], value=50, description="samples (N)", **CONTROL
    )
    every = widgets.SelectionSlider(
        options=[("every photograph", 1), ("every second", 2), ("every fourth", 4)],
        value=1, description="exposures", **CONTROL,
    )  # fmt: skip

    weight = widgets.Dropdown(
        options=[("hat (Debevec)", "hat"), ("Gaussian (Robertson)", "gaussian"), ("uniform", "uniform"),
                 ("1 / g' (Mitsunaga)", "noise"), ("hat to 0 and 255", "paper's hat")],
        description="weights", **CONTROL,
    )  # fmt: skip
    g = recover_crf(bracket).crf[channel]
    shapes = {"hat": hat_weights, "gaussian": gaussian_weights, "uniform": uniform_weights,
              "noise": partial(noise_weights, g)}  # fmt: skip
    weights = {
        (name, e): fitted_weights(bracket.images[::e], shape=s) for name, s in shapes.items() for _, e in every.options
    }
    weights |= {("paper's hat", e): hat_weights() for _, e in every.options}

    def draw(lam, n, weight, every):
        images, B = bracket.images[::every], bracket.log_times[::every]
        rows, cols = sample_pixels(images, n)
        Z = np.stack([image[rows, cols, channel] for image in images], axis=1)
        g, log_E = gsolve(Z, B, lam, weights[weight, every])
        title = f"{n} samples in {len(images)} photographs, lambda {lam:.3g}"
        picture = jpeg_bytes(data_on_curve_figure(Z, B, g, log_E, title))
        if bracket.truth is None:
            return picture
        error = crf_rmse(g[None], bracket.truth.crf[channel][None])[0]
        return picture, f"error against the truth: <b>{error:.3f} stops</b> (RMS over values 5 to 250)"

    return _explorer(draw, {"lam": lam, "n": n, "weight": weight, "every": every})


def radiance_explorer(radiance):
    """A radiance map behind an exposure slider, as a photograph taken afterwards would show it."""
    stops = widgets.FloatSlider(0, min=-12, max=6, step=0.5, description="exposure (stops)", **CONTROL)
    return _explorer(lambda stops: jpeg_bytes(viewed_at(radiance, stops)), {"stops": stops})


def tonemap_explorer(radiance):
    """The operators and their parameters, on a small copy of the radiance map; what an operator lacks is not shown."""
    height, width = radiance.shape[:2]
    size = (PREVIEW, round(PREVIEW * height / width))
    small = expose_for_screen(cv2.resize(radiance, size, interpolation=cv2.INTER_AREA))
    operator = widgets.Dropdown(
        options=list(OPERATORS),
        value="reinhard",
        description="operator",
        **CONTROL,
    )
    controls = {
        "gamma": widgets.FloatSlider(2.2, min=1, max=4, step=0.1),
        "saturation": widgets.FloatSlider(0.8, min=0, max=1.5, step=0.05),
        "contrast": widgets.FloatLogSlider(30, min=0.5, max=3, step=0.1),
        "stops": widgets.FloatSlider(0, min=-4, max=10, step=0.5),
        "intensity": widgets.FloatSlider(1, min=-8, max=8, step=0.5),
        "light_adapt": widgets.FloatSlider(0.5, min=0, max=1, step=0.05),
        "color_adapt": widgets.FloatSlider(0, min=0, max=1, step=0.05),
        "key": widgets.FloatLogSlider(0.18, min=-2, max=0.5, step=0.1),
        "bias": widgets.FloatSlider(0.85, min=0.5, max=1, step=0.01),
        "scale": widgets.FloatSlider(0.6, min=0.3, max=1, step=0.02),
    }
    for name, control in controls.items():
        control.description = name
        control.style.description_width, control.layout.width = "190px", "560px"

    def draw(operator, **values):
        has = inspect.signature(OPERATORS[operator]).parameters
        for name, control in controls.items():
            control.layout.display = None if name in has else "none"
        return jpeg_bytes(tonemap(small, operator, **{name: value for name, value in values.items() if name in has}))

    return _explorer(draw, {"operator": operator, **controls})
