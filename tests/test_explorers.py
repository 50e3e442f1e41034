"""Every explorer shows another picture when a control that applies is moved; figures show what they are given."""

import inspect

import ipywidgets as widgets
import numpy as np
import pytest

from hdr_helpers.lab import explorers, figures
from hdr_helpers.lab.judging import judge
from hdr_helpers.papers.mertens2007 import fusion_weights
from hdr_helpers.tonemap import OPERATORS, RANGES, tonemap


def controls(explorer):
    return [w for w in explorer.children if isinstance(w, widgets.Widget) and hasattr(w, "description")]


def is_shown(control):
    return control.layout.display != "none"


def picture(explorer):
    (image,) = [w for w in explorer.children if isinstance(w, widgets.Image)]
    return image.value


def move(control):
    """Set a control to a neighbouring value."""
    if isinstance(control, (widgets.SelectionSlider, widgets.Dropdown)):
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


@pytest.mark.parametrize("name", ["exposure", "align", "crf", "radiance", "tonemap"])
def test_every_control_that_applies_changes_the_picture(name, small_bracket):
    explorer = make(name, small_bracket)
    moved = [c for c in controls(explorer) if not isinstance(c, (widgets.HTML, widgets.Button)) and is_shown(c)]
    assert moved
    for control in reversed(moved):  # the choice of operator last: it decides which others apply
        before = picture(explorer)
        move(control)
        assert picture(explorer) != before, control.description


@pytest.mark.parametrize("operator", OPERATORS)
def test_the_tone_mapping_explorer_shows_only_what_the_operator_has(small_bracket, operator):
    explorer = explorers.tonemap_explorer(small_bracket.truth.radiance)
    chosen, *others = [c for c in controls(explorer) if not isinstance(c, widgets.HTML)]
    chosen.value = operator
    has = {c.description for c in others if is_shown(c)}
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
        if control.description in RANGES:
            ends = np.array([control.min, control.max])
            if isinstance(control, widgets.FloatLogSlider):
                ends = control.base**ends
            assert control.value == pytest.approx(defaults[control.description] or control.value)
            assert RANGES[control.description][0] <= ends[0] < ends[1] <= RANGES[control.description][1]


@pytest.mark.parametrize("shift", [(-7, 3), (23, -17)])
def test_the_button_walks_the_sliders_to_the_shift_that_was_made(chapel, monkeypatch, shift):
    monkeypatch.setattr(explorers, "STEP_SECONDS", 0)
    fixed, moving = chapel.images[4], np.roll(chapel.images[5], (-shift[1], -shift[0]), axis=(0, 1))
    explorer = explorers.align_explorer(fixed, moving)
    right, down, button = [c for c in controls(explorer) if not isinstance(c, widgets.HTML)]
    visited = []
    right.observe(lambda change: visited.append(change["new"]), names="value")
    button.click()
    assert (right.value, down.value) == shift
    assert len(visited) > 1  # coarse first


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
