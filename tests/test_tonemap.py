"""Stage 5: every operator, whatever radiance map it is given."""

import inspect

import cv2
import numpy as np
import pytest

from hdr_helpers.lab.scenes import chapel_scene
from hdr_helpers.tonemap import OPERATORS, dynamic_range_stops, luminance, to_8bit, tonemap, write_picture

every_operator = pytest.mark.parametrize("operator", sorted(OPERATORS))
PARAMETERS = [
    (operator, parameter.name, parameter.default)
    for operator, function in sorted(OPERATORS.items())
    for parameter in list(inspect.signature(function).parameters.values())[1:]
]


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


@pytest.mark.parametrize("operator", sorted(set(OPERATORS) - {"mantiuk"}))
def test_tiny_pictures_are_no_problem(operator):
    light = np.random.default_rng(0).uniform(1, 2, (5, 7, 3)).astype(np.float32)
    for part in (light, light[:1], light[:, :1], light[:1, :1]):
        assert tonemap(part, operator).shape == part.shape


def test_a_picture_too_small_for_mantiuks_pyramid_is_refused_with_its_size():
    with pytest.raises(ValueError, match="mantiuk can't tone-map 7 x 1 pixels"):
        tonemap(np.random.default_rng(0).uniform(1, 2, (1, 7, 3)), "mantiuk")


@pytest.mark.parametrize("operator, name, default", PARAMETERS, ids=[f"{o}-{n}" for o, n, _ in PARAMETERS])
def test_every_parameter_changes_the_picture(radiance, operator, name, default):
    changed = tonemap(radiance, operator, **{name: 0.7 * default or 0.5})
    assert np.abs(changed - tonemap(radiance, operator)).max() > 0.01


@every_operator
def test_more_gamma_brightens(radiance, operator):
    assert tonemap(radiance, operator, gamma=2.6).mean() > tonemap(radiance, operator, gamma=1.8).mean() + 0.01


def test_gamma_shows_what_is_brighter_never_darker():
    ramp = np.geomspace(1e-6, 10, 6000, dtype=np.float32).reshape(60, 100, 1).repeat(3, axis=2)
    assert np.all(np.diff(tonemap(ramp, "gamma")[..., 0].ravel()) >= 0)
    assert np.all(np.diff(to_8bit(tonemap(ramp, "gamma", stops=2))[..., 0].ravel().astype(int)) >= 0)


def test_an_unknown_operator_is_told_which_exist(radiance):
    with pytest.raises(ValueError) as problem:
        tonemap(radiance, "reinhart")
    assert all(name in str(problem.value) for name in ["reinhart", *OPERATORS])


def test_the_dynamic_range_of_two_lights_is_their_ratio_in_stops():
    two = np.full((20, 20, 3), 3.0, np.float32)
    two[:10] *= 2**11
    assert dynamic_range_stops(two) == pytest.approx(11, abs=1e-4)


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
