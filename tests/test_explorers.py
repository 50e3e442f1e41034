"""Every explorer shows another picture when a control that applies is moved."""

import ipywidgets as widgets
import numpy as np
import pytest

from hdr_helpers.lab import explorers


def controls(explorer):
    return [w for w in explorer.children if isinstance(w, widgets.Widget) and hasattr(w, "description")]


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
    moved = [c for c in controls(explorer) if not isinstance(c, (widgets.HTML, widgets.Button)) and not c.disabled]
    assert moved
    for control in reversed(moved):  # the choice of operator last: it decides which others apply
        before = picture(explorer)
        move(control)
        assert picture(explorer) != before, control.description


def test_the_tone_mapping_explorer_greys_out_what_the_operator_does_not_have(small_bracket):
    explorer = explorers.tonemap_explorer(small_bracket.truth.radiance)
    operator, gamma, saturation, contrast, *of_reinhard = [
        c for c in controls(explorer) if not isinstance(c, widgets.HTML)
    ]
    operator.value = "drago"
    assert [c.disabled for c in (gamma, saturation, contrast, *of_reinhard)] == [False, False, True, True, True, True]
    operator.value = "reinhard"
    assert [c.disabled for c in (gamma, saturation, contrast, *of_reinhard)] == [False, True, True, False, False, False]


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
