"""Every explorer shows another picture when a control that applies is moved; figures show what they are given."""

import inspect
import re
import time

import cv2
import ipywidgets as widgets
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.backends.backend_agg import FigureCanvasAgg

from hdr_helpers.align import bitmaps
from hdr_helpers.crf import fitted_weights, gsolve, recover_crf, sample_pixels, whole_white
from hdr_helpers.lab import explorers, figures
from hdr_helpers.lab.judging import clipped_share, judge
from hdr_helpers.papers.mertens2007 import fusion_weights
from hdr_helpers.tonemap import OPERATORS, RANGES, tonemap

NAMES = ["exposure", "align", "crf", "radiance", "tonemap"]
# In encodings of a photograph of the course, of 2.5 to 3.5 ms each: what the moves of an explorer may cost, and those
# of its slowest control. That is twice what they do cost (exposures 16, durand's operator 27); to lay out and draw a
# whole figure for each move costs 70 and more.
QUICK, SLOWEST = 35, 60


def controls(explorer):
    return [w for w in explorer.children if isinstance(w, widgets.Widget) and hasattr(w, "description")]


def movable(explorer):
    """The controls that apply and have values, the choice of operator last: it decides which others apply."""
    return [c for c in controls(explorer) if not isinstance(c, (widgets.HTML, widgets.Button)) and is_shown(c)][::-1]


def named(control):
    """The parameter that a control stands for: its label without the unit."""
    return control.description.split(" (")[0]


def is_shown(control):
    return control.layout.display != "none"


def picture(explorer):
    (image,) = [w for w in explorer.children if isinstance(w, widgets.Image)]
    return image.value


def pixels(explorer):
    return decoded(picture(explorer))


def decoded(jpeg):
    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR_RGB).astype(int)


def said(explorer):
    (line,) = [w for w in explorer.children if isinstance(w, widgets.HTML)]
    return re.sub("<[^>]*>", "", line.value)


def all_values(control, at_most=20):
    """The values of a control from end to end, as many as a hand would stop at."""
    if isinstance(control, (widgets.SelectionSlider, widgets.ToggleButtons)):
        return [option[1] if isinstance(option, tuple) else option for option in control.options]
    values = np.linspace(control.min, control.max, at_most)
    values = control.min + np.rint((values - control.min) / control.step) * control.step
    if isinstance(control, widgets.FloatLogSlider):
        values = control.base**values
    return np.unique(values).tolist()


def moves(control, at_most=20):
    """Take a control through all its values and back to where it was, and yield after each move."""
    start = control.value
    for value in [*all_values(control, at_most), start]:
        if value != control.value:
            control.value = int(value) if isinstance(control, widgets.IntSlider) else value
            yield value


def every_move(explorer, at_most=20):
    """Take every control through its values, in the tone-mapping explorer for every operator: (label, value)."""
    chosen = [c for c in movable(explorer) if c.description == "operator"]
    for operator in all_values(chosen[0]) if chosen else [None]:
        if operator:
            chosen[0].value = operator
        for control in movable(explorer):
            for value in () if control in chosen else moves(control, at_most):
                yield f"{operator or ''} {control.description}".strip(), value
    for control in chosen:
        for value in moves(control):
            yield control.description, value


def move(control):
    """Set a control to a neighbouring value."""
    if isinstance(control, (widgets.SelectionSlider, widgets.ToggleButtons)):
        control.index = control.index - 1 if control.index else 1
    else:
        control.value = control.value + control.step if control.value < control.max else control.value - control.step


def make(name, bracket):
    radiance = bracket.truth.radiance
    return {
        "exposure": lambda: explorers.exposure_explorer(bracket),
        "align": lambda: explorers.align_explorer(*bracket.images[2:4]),
        "crf": lambda: explorers.crf_explorer(bracket),
        "radiance": lambda: explorers.radiance_explorer(radiance),
        "tonemap": lambda: explorers.tonemap_explorer(radiance),
    }[name]()


@pytest.mark.parametrize("name", NAMES)
def test_every_control_that_applies_changes_the_picture(name, small_bracket):
    explorer = make(name, small_bracket)
    assert movable(explorer)
    for control in movable(explorer):
        before = picture(explorer)
        move(control)
        assert picture(explorer) != before, control.description


@pytest.mark.parametrize("name", NAMES)
def test_each_move_draws_one_picture_into_the_same_widgets_and_leaves_no_figure_open(name, small_bracket):
    explorer, open_before = make(name, small_bracket), pyplot.get_fignums()
    children, drawn, sizes = explorer.children, [], set()
    (image,) = [w for w in children if isinstance(w, widgets.Image)]
    image.observe(lambda change: drawn.append(change["new"]), names="value")
    moved = 0
    for _ in every_move(explorer):
        moved += 1
        sizes.add(pixels(explorer).shape)
    # The choice of operator is also moved between what is listed; a move to a picture that looks the same is none.
    assert 0.8 * moved <= len(drawn) <= moved + len(OPERATORS)
    assert len(sizes) == 1  # the page does not jump
    assert explorer.children is children and not any(isinstance(w, widgets.Output) for w in children)
    assert pyplot.get_fignums() == open_before


@pytest.mark.parametrize("name", NAMES)
def test_a_move_costs_little_more_than_its_picture(name, chapel):
    """Ratios in one run, because milliseconds depend on the machine: those are in benchmarks/explore.py."""
    took, encoding, moving = {}, [], every_move(make(name, chapel), at_most=7)
    while True:
        began = time.process_time()  # not that of others who share the machine
        figures.jpeg_bytes(chapel.images[4])
        encoded = time.process_time()
        label, _ = next(moving, (None, None))
        if label is None:
            break
        took.setdefault(label, []).append(time.process_time() - encoded)
        encoding.append(encoded - began)
    assert np.median([second for seconds in took.values() for second in seconds]) < QUICK * np.median(encoding)
    for label, seconds in took.items():
        assert np.median(seconds) < SLOWEST * np.median(encoding), label


def drawn_in_full(figure):
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.array(canvas.buffer_rgba())[..., :3]


def assert_looks_like(explorer, shown):
    """The same picture, but for a pixel here and there: what is drawn again lies above the frame of its axes."""
    difference = np.abs(pixels(explorer) - decoded(figures.jpeg_bytes(np.asarray(shown))))
    assert difference.mean() < 0.1 and np.mean(difference > 8) < 0.001


def set_to(explorer, **values):
    for control in movable(explorer):
        for start, value in values.items():
            if control.description.startswith(start):
                control.value = value


def test_the_explorer_of_exposures_shows_each_as_if_it_were_drawn_in_full(small_bracket):
    explorer = make("exposure", small_bracket)
    for image, t in zip(small_bracket.images, small_bracket.times, strict=True):
        set_to(explorer, exposure=t)
        figure, fill = figures.histogram_frame(image)
        fill(image, t)
        assert_looks_like(explorer, drawn_in_full(figure))
        assert f"{figures.usable_share(image):.0%} of the pixels usable" in said(explorer)
        assert figures.seconds(t) in said(explorer)


def test_the_explorer_of_shifts_shows_the_static_figure_and_counts_in_pixels(small_bracket):
    fixed, moving = small_bracket.images[2:4]
    explorer = make("align", small_bracket)
    set_to(explorer, right=5, down=-3)
    pair = [bitmaps(cv2.cvtColor(i, cv2.COLOR_RGB2GRAY)) for i in (fixed, moving)]
    assert_looks_like(explorer, figures.hand_figure(*pair, (5, -3)))
    assert "moved by +5 px right and -3 px down" in said(explorer)


@pytest.mark.parametrize("lam, n, every", [(50, 50, 1), (5000, 5, 2), (0.1, 500, 4)])
def test_the_explorer_of_the_response_shows_the_static_figure_with_axes_that_stay(lam, n, every, small_bracket):
    explorer = make("crf", small_bracket)
    set_to(explorer, smoothness=lam, samples=n, exposures=every)
    images, B = [whole_white(i) for i in small_bracket.images[::every]], small_bracket.log_times[::every]
    rows, cols = sample_pixels(images, n)
    Z = np.stack([i[rows, cols, 1] for i in images], axis=1)
    g = recover_crf(small_bracket).crf[1]
    ends = small_bracket.log_times[[0, -1]], (g.min(), g.max())
    figure, fill = figures.data_on_curve_frame(*ends)
    found = gsolve(Z, B, lam, fitted_weights(small_bracket.images[::every]))
    fill(Z, B, *found, f"{n} samples in {len(B)} photographs, lambda {lam:g}")
    assert_looks_like(explorer, drawn_in_full(figure))
    # That frame, with its data's own limits, is what the static figure is.
    own, fill = figures.data_on_curve_frame((B.min(), B.max()), (found[0].min(), found[0].max()))
    fill(Z, B, *found, "as it is")
    static = figures.data_on_curve_figure(Z, B, *found, "as it is")
    np.testing.assert_array_equal(drawn_in_full(own), drawn_in_full(static))


def test_the_explorer_of_radiance_shows_the_pictures_of_the_static_figure(small_bracket):
    explorer = make("radiance", small_bracket)
    for stops, ax in zip((-8, -4, 0, 3), figures.honest_figure(small_bracket.truth.radiance).axes, strict=True):
        set_to(explorer, exposure=stops)
        shown = np.asarray(ax.images[0].get_array())
        assert_looks_like(explorer, shown)
        share = clipped_share(shown)
        assert said(explorer).endswith(f"{share.black:.1%} of the pixels black, {share.white:.1%} white")


def test_the_explorer_of_operators_shows_the_pictures_of_the_static_figure(small_bracket):
    explorer = make("tonemap", small_bracket)
    set_to(explorer, operator="drago")
    strip = figures.parameter_strip_figure(small_bracket.truth.radiance, "drago", "bias", (0.7, 0.95), saturation=0.3)
    for bias, ax in zip((0.7, 0.95), strip.axes, strict=True):
        set_to(explorer, saturation=0.3, bias=bias)
        assert_looks_like(explorer, ax.images[0].get_array())


@pytest.mark.parametrize("name", NAMES)
def test_controls_are_labelled_reached_by_the_keyboard_and_have_room_for_their_labels(name, small_bracket):
    explorer = make(name, small_bracket)
    for control in controls(explorer):
        if isinstance(control, (widgets.HTML, widgets.Button)):
            continue
        assert control.description and len(control.description) <= 27  # 190 px
        assert control.tabbable is not False and not control.disabled
        assert getattr(control, "readout", True)
        if hasattr(control, "step"):  # the browser's slider stands on whole steps only, and would show another value
            start = np.log10(control.value) if isinstance(control, widgets.FloatLogSlider) else control.value
            steps = (start - control.min) / control.step
            assert steps == pytest.approx(round(steps), abs=1e-6), control.description
    assert said(explorer)  # in words, for those who can't see the picture


def test_an_explorer_says_why_it_can_not_draw_and_goes_on(small_bracket, monkeypatch):
    explorer = make("crf", small_bracket)
    before = picture(explorer)

    def refuse(*_):
        raise ValueError("5 < 6")

    with monkeypatch.context() as broken:
        broken.setattr(explorers, "gsolve", refuse)
        set_to(explorer, samples=5)
        assert picture(explorer) == before and said(explorer) == "5 &lt; 6"
    set_to(explorer, samples=10)
    assert picture(explorer) != before and "stops" in said(explorer)


def test_large_pictures_are_made_small_and_of_photographs_the_middle_is_shown(small_bracket):
    wide = cv2.resize(small_bracket.truth.radiance, (1500, 900))
    assert pixels(explorers.radiance_explorer(wide)).shape == (614, 1024, 3)
    assert pixels(explorers.tonemap_explorer(wide)).shape == (336, 560, 3)
    pair = [cv2.resize(image, (1500, 900)) for image in small_bracket.images[2:4]]
    explorer = explorers.align_explorer(*pair)
    set_to(explorer, right=7)
    whole = figures.hand_figure(*(bitmaps(cv2.cvtColor(i, cv2.COLOR_RGB2GRAY)) for i in pair), (7, 0))
    middle = decoded(figures.jpeg_bytes(whole[:, 238:1262]))
    difference = np.abs(pixels(explorer) - middle)[:, 16:]  # at the left what is not shown would have come in
    assert pixels(explorer).shape == (900, 1024, 3) and np.mean(difference > 8) < 0.001


@pytest.mark.parametrize("operator", OPERATORS)
def test_the_tone_mapping_explorer_shows_only_what_the_operator_has(small_bracket, operator):
    explorer = explorers.tonemap_explorer(small_bracket.truth.radiance)
    chosen, *others = [c for c in controls(explorer) if not isinstance(c, widgets.HTML)]
    chosen.value = operator
    has = {named(c) for c in others if is_shown(c)}
    assert has == set(inspect.signature(OPERATORS[operator]).parameters) - {"radiance"} - {"detail", "white"}
    for control in others:
        if is_shown(control):
            before = picture(explorer)
            move(control)
            assert picture(explorer) != before, control.description


def test_the_tone_mapping_explorer_starts_with_the_defaults_and_in_range(small_bracket):
    explorer = explorers.tonemap_explorer(small_bracket.truth.radiance)
    defaults = {p.name: p.default for f in OPERATORS.values() for p in inspect.signature(f).parameters.values()}
    for control in controls(explorer):
        if named(control) in RANGES:
            ends = np.array([control.min, control.max])
            if isinstance(control, widgets.FloatLogSlider):
                ends = control.base**ends
            assert control.value == pytest.approx(defaults[named(control)] or control.value)
            assert RANGES[named(control)][0] <= ends[0] < ends[1] <= RANGES[named(control)][1]


@pytest.mark.parametrize("shift", [(-7, 3), (23, -17)])
def test_the_button_walks_the_sliders_to_the_shift_that_was_made(chapel, monkeypatch, shift):
    monkeypatch.setattr(explorers, "STEP_SECONDS", 0)
    fixed, moving = chapel.images[4], np.roll(chapel.images[5], (-shift[1], -shift[0]), axis=(0, 1))
    explorer = explorers.align_explorer(fixed, moving)
    right, down, button = [c for c in controls(explorer) if not isinstance(c, widgets.HTML)]
    (image,) = [w for w in explorer.children if isinstance(w, widgets.Image)]
    visited, drawn = [], []
    right.observe(lambda change: visited.append((right.value, down.value)), names="value")
    image.observe(lambda change: drawn.append(change["new"]), names="value")
    button.click()
    assert (right.value, down.value) == shift
    assert len(visited) > 1  # coarse first
    assert len(drawn) <= len(
        explorers.pyramid_walk(*(cv2.cvtColor(i, cv2.COLOR_RGB2GRAY) for i in (fixed, moving)), 24)
    )
    assert not button.disabled


def labels(figure):
    return " ".join(text.get_text() for ax in figure.axes for text in (ax.title, ax.xaxis.label))


def test_a_contact_sheet_names_every_operator_and_says_what_was_measured(chapel):
    figure = figures.contact_sheet_figure(chapel.truth.radiance)
    said = labels(figure)
    assert all(name in said for name in OPERATORS)
    judged = judge(tonemap(chapel.truth.radiance, "drago"), chapel.truth.radiance)
    assert f"dark {judged.detail.dark:.2f}, bright {judged.detail.bright:.2f}" in said
    two = figures.contact_sheet_figure({"a": np.zeros((20, 30, 3)), "b": np.ones((20, 30, 3))}, cols=2)
    assert labels(two).split() == ["a", "b"]


def test_a_strip_shows_one_parameter_at_each_value_with_the_others_as_given(small_bracket):
    radiance = small_bracket.truth.radiance
    figure = figures.parameter_strip_figure(radiance, "drago", "bias", (0.7, 0.9), saturation=0)
    shown = [ax.images[0].get_array() for ax in figure.axes]
    for picture, bias in zip(shown, (0.7, 0.9), strict=True):
        np.testing.assert_allclose(picture, tonemap(radiance, "drago", bias=bias, saturation=0), atol=1e-6)
    assert "bias = 0.7" in labels(figure)


def test_the_figures_of_exposure_fusion_show_every_map_on_one_scale(small_bracket):
    images = small_bracket.images
    weights = fusion_weights(images)
    maps = figures.quality_maps_figure(images).axes
    assert len(maps) == 5 * len(images)
    np.testing.assert_allclose(maps[-1].images[0].get_array(), weights[-1], atol=1e-6)
    assert {ax.images[0].get_clim() for ax in maps} == {(0, 1)}
    levels = figures.pyramid_figure(images[2], weights[2], 4).axes
    assert len(levels) == 3 * 4
    np.testing.assert_allclose(levels[4].images[0].get_array(), weights[2], atol=1e-6)
    assert np.ptp(levels[7].images[0].get_array()) < np.ptp(weights[2])  # coarse: smooth
