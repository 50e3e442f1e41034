"""Stage 5: every operator, whatever radiance map it is given."""

import warnings

import cv2
import numpy as np
import pytest

from hdr_helpers.lab.scenes import chapel_scene
from hdr_helpers.tonemap import (
    OPERATORS,
    dynamic_range_stops,
    expose_for_screen,
    luminance,
    to_8bit,
    tonemap,
    write_picture,
)

every_operator = pytest.mark.parametrize("operator", sorted(OPERATORS))


@pytest.fixture(scope="module")
def radiance():
    return chapel_scene()[100:220, 200:360]


@every_operator
def test_the_picture_is_finite_in_0_to_1_and_not_flat(radiance, operator):
    ldr = tonemap(radiance, operator)
    assert ldr.dtype == np.float32
    assert ldr.shape == radiance.shape
    assert ldr.min() >= 0 and ldr.max() <= 1  # false for NaN, too
    assert np.ptp(np.percentile(ldr, [5, 95])) > 0.1


@every_operator
def test_the_same_call_gives_the_same_picture_and_leaves_its_input_alone(radiance, operator):
    given = radiance.copy()
    first = tonemap(given, operator)
    assert np.array_equal(tonemap(given, operator), first)
    assert np.array_equal(given, radiance)


@every_operator
@pytest.mark.parametrize("factor", [2.0**-20, 0.003, 7, 2.0**20])
def test_scaling_the_radiance_leaves_the_picture_alone(radiance, operator, factor):
    scaled = tonemap(radiance * np.float32(factor), operator)
    np.testing.assert_allclose(scaled, tonemap(radiance, operator), atol=2e-3)


@every_operator
def test_one_absurdly_bright_pixel_does_not_change_the_others(radiance, operator):
    absurd = radiance.copy()
    absurd[60, 80] *= 1e6
    change = np.abs(tonemap(absurd, operator) - tonemap(radiance, operator))
    change[55:66, 75:86] = 0  # its neighbours may notice
    assert change.mean() < 0.01


@every_operator
def test_pixels_that_are_no_light_count_as_black_or_as_the_brightest(radiance, operator):
    broken = radiance.copy()
    brightest = radiance.max()
    for row, (value, meaning) in enumerate([(np.nan, 0), (-3, 0), (-np.inf, 0), (np.inf, brightest)]):
        broken[row, :9] = value
        radiance = radiance.copy()
        radiance[row, :9] = meaning
    given = broken.copy()
    assert np.array_equal(tonemap(given, operator), tonemap(radiance, operator))
    assert np.array_equal(given, broken, equal_nan=True)


@every_operator
@pytest.mark.parametrize("value", [0.0, np.nan, -1.0, np.inf])
def test_a_map_without_any_light_gives_a_black_picture(operator, value):
    assert not tonemap(np.full((20, 30, 3), value, np.float32), operator).any()


@every_operator
def test_a_map_of_one_light_gives_a_picture_of_one_grey(operator):
    ldr = tonemap(np.full((40, 50, 3), 3.5, np.float32), operator)
    assert np.ptp(ldr) < 1e-3


@every_operator
@pytest.mark.parametrize("shape", [(5, 7), (1, 7), (5, 1), (2, 2), (1, 1)])
def test_tiny_pictures_are_no_problem(operator, shape):
    light = np.random.default_rng(0).uniform(1, 2, (*shape, 3)).astype(np.float32)
    ldr = tonemap(light, operator)
    assert ldr.shape == light.shape
    assert ldr.min() >= 0 and ldr.max() <= 1


@pytest.mark.parametrize("value", [0.0, np.nan, -1.0])
@pytest.mark.parametrize(
    "operator, parameters", [*((name, {}) for name in OPERATORS), ("reinhard", {"light_adapt": 1})]
)
def test_black_rows_at_the_start_leave_the_rest_as_bright_as_it_was(radiance, operator, parameters, value):
    bordered = radiance.copy()
    bordered[:2] = value
    change = np.abs(tonemap(bordered, operator, **parameters) - tonemap(radiance, operator, **parameters))[2:]
    assert change.mean() < 0.01


def test_exposing_for_the_screen_leaves_finite_numbers_from_0_to_1_with_white_at_the_percentile(radiance):
    broken = radiance.copy()
    broken[0, :4] = np.array([np.nan, -3, -np.inf, np.inf])[:, None]
    scaled = expose_for_screen(broken)
    assert scaled.min() >= 0 and scaled.max() <= 1
    grey = luminance(radiance)[..., None].repeat(3, axis=2)
    assert np.percentile(expose_for_screen(grey), 99.9) == pytest.approx(1, abs=1e-4)


def test_mantiuks_black_is_black_and_a_scene_that_fits_the_screen_is_hardly_stretched(radiance):
    shown = luminance(tonemap(radiance, "mantiuk", gamma=1))
    assert np.percentile(shown, 0.1) < 0.005
    flat = np.full((60, 90, 3), 0.2, np.float32)
    flat[:, 45:] = 1
    light = luminance(tonemap(flat, "mantiuk", gamma=1))
    assert 0.14 < light[30, 10] / light[30, 80] <= 0.2


@every_operator
def test_one_black_pixel_leaves_its_neighbours_in_their_colours(operator):
    light = np.random.default_rng(0).uniform(0.4, 1, (30, 40, 3)).astype(np.float32)
    spotted = light.copy()
    spotted[0, 0] = 0
    assert np.abs(tonemap(spotted, operator) - tonemap(light, operator))[:, 10:].max() < 0.03


@every_operator
def test_the_type_of_the_numbers_does_not_matter_nor_that_they_are_too_large_or_small_for_32_bits(radiance, operator):
    plain = tonemap(radiance, operator)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for factor in (1, 1e60, 1e-60):
            np.testing.assert_allclose(tonemap(radiance.astype(np.float64) * factor, operator), plain, atol=2e-3)
        whole = np.rint(radiance / radiance.max() * 60000)
        np.testing.assert_allclose(
            tonemap(whole.astype(np.uint16), operator), tonemap(whole.astype(np.float32), operator), atol=1e-5
        )


def test_a_new_operator_is_one_line_in_the_table(radiance, monkeypatch):
    monkeypatch.setitem(OPERATORS, "square", lambda radiance, strength=1.0: strength * radiance**2)
    assert np.array_equal(tonemap(radiance, "square"), tonemap(radiance, "gamma", gamma=0.5))
    with pytest.raises(ValueError, match="strength of square must be a number"):
        tonemap(radiance, "square", strength=np.nan)


@every_operator
@pytest.mark.parametrize("wrong", [np.ones((4, 5)), np.ones((4, 5, 4)), np.ones((0, 5, 3)), np.ones((4, 5, 3), "U1"),
                                   np.ones((4, 5, 3), complex), None, []])  # fmt: skip
def test_what_is_no_radiance_map_is_refused_in_a_sentence(operator, wrong):
    with pytest.raises(ValueError, match=r"A radiance map must be \(H, W, 3\) numbers"):
        tonemap(wrong, operator)


@pytest.mark.parametrize("range_of_scene", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("operator, parameters", [
    ("gamma", {}), ("gamma", {"stops": 3}),
    ("reinhard", {}), ("reinhard", {"intensity": 8}), ("reinhard", {"intensity": -8, "light_adapt": 0}),
    ("reinhard", {"light_adapt": 1, "color_adapt": 1}),
    ("reinhard_global", {}), ("reinhard_global", {"key": 2, "white": 0.5}),
    ("drago", {}), ("drago", {"bias": 0.8}), ("drago", {"bias": 1}),
])  # fmt: skip
def test_a_global_operator_shows_what_is_brighter_never_darker(operator, parameters, range_of_scene):
    ramp = np.geomspace(1 / range_of_scene, 1, 6000, dtype=np.float32)
    shuffled = np.random.default_rng(0).permutation(6000)
    scene = ramp[shuffled].reshape(60, 100, 1).repeat(3, axis=2)
    shown = np.empty_like(ramp)
    shown[shuffled] = tonemap(scene, operator, **parameters)[..., 1].ravel()
    assert np.diff(shown).min() >= -2e-6  # rounding of 32 bits
    assert np.diff(to_8bit(shown).astype(int)).min() >= 0
    assert np.ptp(shown) > 0.05


@pytest.mark.parametrize("scale", [0.5, 0.7, 0.9])
def test_opencvs_mantiuk_is_a_power_of_luminance_as_its_docstring_says(radiance, scale):
    scene = expose_for_screen(radiance)
    power = luminance(scene) ** (scale ** (1 / 0.4185))
    shown = OPERATORS["mantiuk"](scene, scale=scale, saturation=0, gamma=1)[..., 1]
    inside = shown > 1e-3
    line = np.polynomial.Polynomial.fit(power[inside], shown[inside], 1)  # a veil has been taken off
    assert np.abs(line(power[inside]) - shown[inside]).max() < 0.005


def test_an_unknown_operator_is_told_which_exist(radiance):
    with pytest.raises(ValueError) as problem:
        tonemap(radiance, "reinhart")
    assert all(name in str(problem.value) for name in ["reinhart", *OPERATORS])


def test_the_dynamic_range_of_two_lights_is_their_ratio_in_stops():
    two = np.full((20, 20, 3), 3.0, np.float32)
    two[:10] *= 2**11
    assert dynamic_range_stops(two) == pytest.approx(11, abs=1e-4)


def test_the_dynamic_range_looks_at_light_alone():
    two = np.full((20, 20, 3), 3.0, np.float32)
    two[:10] *= 2**11
    two[5, :4] = np.array([np.nan, np.inf, -1, 0])[:, None]
    assert dynamic_range_stops(two) == pytest.approx(11, abs=1e-4)
    with pytest.raises(ValueError, match="no light in it"):
        dynamic_range_stops(np.zeros((4, 5, 3)))


def test_luminance_is_that_of_rec_709():
    np.testing.assert_allclose(luminance(np.eye(3)[None]), [[0.2126, 0.7152, 0.0722]], rtol=1e-6)


def test_8_bits_are_clipped_and_never_wrap():
    assert to_8bit(np.array([-0.2, 0, 0.5, 1, 1.02, 1.6])).tolist() == [0, 0, 128, 255, 255, 255]


@pytest.mark.parametrize("name, most", [("p.png", 0), ("p.PNG", 0), ("p.jpg", 6)])
def test_a_picture_reads_back_in_its_colours(tmp_path, name, most):
    ldr = np.full((16, 24, 3), (0.8, 0.4, 1.3), np.float32)
    write_picture(tmp_path / name, ldr)
    read = cv2.imread(str(tmp_path / name))[..., ::-1].astype(int)
    assert np.abs(read - [204, 102, 255]).max() <= most
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_picture_is_not_written_under_a_name_that_promises_something_else(tmp_path):
    with pytest.raises(ValueError, match=r"p\.hdr.*\.png or \.jpg"):
        write_picture(tmp_path / "p.hdr", np.zeros((4, 4, 3)))
    assert not list(tmp_path.iterdir())
