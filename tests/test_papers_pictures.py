"""Two papers that end in a picture: Reinhard's global operator 2002 and Mertens' exposure fusion 2007."""

import cv2
import numpy as np
import pytest

from hdr_helpers.lab.scenes import chapel_scene
from hdr_helpers.papers.mertens2007 import exposure_fusion, fusion_weights, quality_maps
from hdr_helpers.papers.reinhard2002 import compress, log_average, tonemap_reinhard_global

RAMP = np.geomspace(1e-4, 10, 6000, dtype=np.float32).reshape(60, 100, 1).repeat(3, axis=2)


@pytest.fixture(scope="module")
def radiance():
    return chapel_scene()[100:220, 200:360]


@pytest.fixture(scope="module")
def images(small_bracket):
    return small_bracket.images


# Reinhard, Stark, Shirley and Ferwerda 2002


def test_the_log_average_of_light_is_its_geometric_mean():
    assert log_average(np.array([1.0, 4.0, 2.0])) == pytest.approx(2)
    light = np.random.default_rng(0).lognormal(0, 2, 500)
    assert log_average(7 * light) == pytest.approx(7 * log_average(light))


def test_the_curve_halves_1_leaves_the_dark_alone_and_reaches_1_only_at_white():
    light = np.geomspace(1e-5, 1e5, 200)
    np.testing.assert_allclose(compress(light), light / (1 + light), rtol=1e-5)
    assert np.all(compress(light) < 1)
    np.testing.assert_allclose(compress(1e-4, white=3.0), 1e-4, rtol=1e-3)
    for white in (0.5, 3.0, 40.0):
        assert compress(white, white) == pytest.approx(1, abs=1e-6)
        assert compress(0.99 * white, white) < 1 < compress(1.01 * white, white)


@pytest.mark.parametrize("factor", [2.0**-40, 0.003, 7, 2.0**40])
def test_scaling_the_radiance_leaves_the_picture_alone(radiance, factor):
    scaled = tonemap_reinhard_global(radiance * np.float32(factor))
    np.testing.assert_allclose(scaled, tonemap_reinhard_global(radiance), atol=1e-5)


@pytest.mark.parametrize("parameters", [{}, {"key": 0.72}, {"white": 0.5}, {"white": np.inf}, {"saturation": 0}])
def test_brighter_never_becomes_darker(parameters):
    row = tonemap_reinhard_global(RAMP, **parameters)[..., 1].ravel()
    assert np.all(np.diff(row) >= -1e-6)
    assert np.ptp(row) > 0.5


def test_the_picture_is_in_0_to_1_and_its_input_is_left_alone(radiance):
    given = radiance.copy()
    ldr = tonemap_reinhard_global(given)
    assert np.array_equal(given, radiance)
    assert ldr.dtype == np.float32 and ldr.shape == radiance.shape
    assert 0 <= ldr.min() < 0.1 and 0.9 < ldr.max() <= 1


def test_a_grey_scene_is_shown_by_the_papers_equations():
    grey = np.random.default_rng(1).lognormal(0, 1, (40, 50)).astype(np.float32)
    scaled = 0.18 / np.exp(np.log(grey).mean()) * grey
    expected = np.minimum(scaled * (1 + scaled / 1.5**2) / (1 + scaled), 1) ** (1 / 2.2)
    ldr = tonemap_reinhard_global(grey[..., None].repeat(3, axis=2), white=1.5)
    np.testing.assert_allclose(ldr[..., 0], expected, atol=1e-5)


def test_each_parameter_pushes_the_way_it_says(radiance):
    def mean(**parameters):
        return tonemap_reinhard_global(radiance, **parameters).mean()

    assert mean(key=0.09) < mean(key=0.18) < mean(key=0.36)
    assert mean(white=0.5) > mean(white=5) > mean(white=np.inf)
    assert mean(gamma=1.8) < mean(gamma=2.6)


def test_without_white_the_brightest_is_white_and_infinite_white_never_is():
    ldr = tonemap_reinhard_global(RAMP)
    assert ldr.max() == pytest.approx(1, abs=1e-3) and np.mean(ldr > 0.999) < 0.01
    assert tonemap_reinhard_global(RAMP, white=np.inf).max() < 0.995


def test_saturation_0_is_grey_and_1_keeps_the_ratios_of_colours(radiance):
    assert np.ptp(tonemap_reinhard_global(radiance, saturation=0), axis=2).max() < 1e-5
    linear = tonemap_reinhard_global(radiance, key=0.02, saturation=1) ** 2.2
    inside = (linear.max(axis=2) < 0.99) & (linear.min(axis=2) > 1e-4)
    ratio = radiance[inside][:, 0] / radiance[inside][:, 2]
    np.testing.assert_allclose(linear[inside][:, 0] / linear[inside][:, 2], ratio, rtol=1e-2)


def test_one_absurdly_bright_pixel_does_not_change_the_others(radiance):
    absurd = radiance.copy()
    absurd[60, 80] *= 1e6
    change = np.abs(tonemap_reinhard_global(absurd) - tonemap_reinhard_global(radiance))
    change[60, 80] = 0
    assert change.max() < 0.01


def test_black_pixels_stay_black_and_change_no_others_much(radiance):
    broken = radiance.copy()
    broken[:2] = 0
    ldr = tonemap_reinhard_global(broken)
    assert not ldr[:2].any()
    assert np.abs(ldr[2:] - tonemap_reinhard_global(radiance)[2:]).max() < 0.1
    assert not tonemap_reinhard_global(np.zeros((4, 5, 3), np.float32)).any()


@pytest.mark.parametrize("wrong", [{"key": 0}, {"key": -0.18}, {"white": 0}, {"gamma": 0}, {"key": np.nan}])
def test_a_parameter_that_makes_no_picture_is_refused_by_name(radiance, wrong):
    (name,) = wrong
    with pytest.raises(ValueError, match=f"{name} must be above 0"):
        tonemap_reinhard_global(radiance, **wrong)


def test_a_radiance_map_of_another_form_is_refused():
    with pytest.raises(ValueError, match=r"\(H, W, 3\); got \(4, 5\)"):
        tonemap_reinhard_global(np.ones((4, 5)))


# Mertens, Kautz and Van Reeth 2007


@pytest.mark.parametrize("powers", [(1, 1, 1), (1, 1, 0), (0, 0, 1), (0.5, 0, 2)])
def test_fusion_is_opencvs_cut_to_0_to_1(images, powers):
    reference = cv2.createMergeMertens(*powers).process(list(images))
    difference = np.abs(exposure_fusion(images, *powers) - np.clip(reference, 0, 1))
    assert difference.mean() < 1e-4
    assert difference.max() < 0.01


def test_fusion_of_16_bits_is_that_of_8_bits(images):
    deep = [image.astype(np.uint16) * 257 for image in images]
    np.testing.assert_allclose(exposure_fusion(deep), exposure_fusion(images), atol=1e-3)


def test_the_order_of_the_photographs_does_not_matter(images):
    given = [image.copy() for image in images]
    backwards = exposure_fusion(given[::-1])
    np.testing.assert_allclose(backwards, exposure_fusion(images), atol=1e-4)
    assert all(np.array_equal(a, b) for a, b in zip(given, images, strict=True))


def test_one_photograph_alone_or_repeated_comes_back(images):
    for some in (images[2:3], [images[2]] * 3):
        np.testing.assert_allclose(exposure_fusion(some), images[2] / 255, atol=1e-5)


@pytest.mark.parametrize("size", [(1, 1), (5, 90), (60, 71)])
def test_flat_photographs_fuse_to_their_mean(size):
    flat = [np.full((*size, 3), value, np.uint8) for value in (30, 90, 210)]
    np.testing.assert_allclose(exposure_fusion(flat), 110 / 255, atol=1e-5)


def test_the_weights_of_a_pixel_add_up_to_1_and_prefer_the_well_exposed(images):
    weights = fusion_weights(images, contrast=0, saturation=0)
    assert weights.shape == (len(images), *images[0].shape[:2]) and weights.dtype == np.float32
    np.testing.assert_allclose(weights.sum(axis=0), 1, atol=1e-5)
    distance = [np.sum((image / 255 - 0.5) ** 2, axis=2) for image in images]
    of_heaviest = np.take_along_axis(np.array(distance), np.argmax(weights, axis=0)[None], axis=0)[0]
    np.testing.assert_allclose(of_heaviest, np.min(distance, axis=0), atol=1e-5)


def test_the_qualities_are_those_of_the_paper():
    image = np.full((9, 11, 3), (204, 51, 51), np.uint8)
    image[4, 5] = 255
    contrast, saturation, exposedness = quality_maps(image)
    assert np.unravel_index(np.argmax(contrast), contrast.shape) == (4, 5)
    grey = 0.299 * 0.8 + 0.701 * 0.2
    assert contrast[4, 5] == pytest.approx(4 * (1 - grey), abs=1e-4)
    assert contrast[0, 0] == pytest.approx(0, abs=1e-6)
    assert saturation[0, 0] == pytest.approx(np.std([0.8, 0.2, 0.2]), abs=1e-5) and saturation[4, 5] < 1e-6
    assert exposedness[0, 0] == pytest.approx(np.exp(-0.5 * 3 * (0.3 / 0.2) ** 2), abs=1e-5)


def test_a_quality_with_power_0_has_no_say(images):
    grey = [np.repeat(image[..., 1:2], 3, axis=2) for image in images]  # no saturation at all
    weights = fusion_weights(grey, saturation=0)
    assert weights.max() > 0.9
    np.testing.assert_allclose(fusion_weights(grey, saturation=1), 1 / len(images), atol=1e-4)


def test_what_an_invalid_pixel_holds_has_no_influence(images):
    valid = [np.ones(images[0].shape[:2], bool) for _ in images]
    valid[1][20:60, 30:90] = False
    valid[3][:, :17] = False
    noise = np.random.default_rng(0).integers(0, 256, images[0].shape, dtype=np.uint8)
    other = [np.where(mask[..., None], image, noise) for image, mask in zip(images, valid, strict=True)]
    assert np.array_equal(exposure_fusion(other, valid=valid), exposure_fusion(images, valid=valid))
    weights = fusion_weights(images, valid=valid)
    assert not weights[1][~valid[1]].any() and not weights[3][~valid[3]].any()
    np.testing.assert_allclose(weights.sum(axis=0), 1, atol=1e-5)


def test_a_mask_where_all_is_valid_changes_nothing(images):
    valid = [np.ones(images[0].shape[:2], bool)] * len(images)
    assert np.array_equal(exposure_fusion(images, valid=valid), exposure_fusion(images))


def test_a_photograph_that_is_nowhere_valid_is_left_out(images):
    valid = [np.full(images[0].shape[:2], k != 2) for k in range(len(images))]
    without = [image for k, image in enumerate(images) if k != 2]
    np.testing.assert_allclose(exposure_fusion(images, valid=valid), exposure_fusion(without), atol=1e-5)


def test_no_seam_shows_where_a_mask_ends(images):
    valid = [np.ones(images[0].shape[:2], bool) for _ in images]
    valid[2][:, 80:] = False
    masked = exposure_fusion(images, valid=valid)

    def step(picture):
        return np.abs(np.mean(np.diff(picture[:, 76:84].mean(axis=2), axis=1), axis=0)).max()

    assert step(masked) < step(exposure_fusion(images)) + 0.01


def test_a_pixel_that_is_valid_nowhere_continues_its_neighbours():
    ramp = np.linspace(20, 220, 60, dtype=np.uint8)[None, :, None].repeat(50, axis=0).repeat(3, axis=2)
    there = np.ones((50, 60), bool)
    there[20:30, 40:50] = False
    black = np.where(there[..., None], ramp, np.uint8(0))
    np.testing.assert_allclose(exposure_fusion([black] * 2, valid=[there] * 2), ramp / 255, atol=0.06)


@pytest.mark.parametrize(
    "images, valid, told",
    [
        ([], None, "none"),
        ([np.zeros((4, 5, 3))], None, "float64"),
        ([np.zeros((4, 5), np.uint8)], None, r"\(4, 5\)"),
        ([np.zeros((4, 5, 3), np.uint8), np.zeros((4, 6, 3), np.uint8)], None, r"\(4, 6, 3\)"),
        ([np.zeros((4, 5, 3), np.uint8)], [np.ones((5, 4), bool)], "valid must hold one mask"),
        ([np.zeros((4, 5, 3), np.uint8)], [], "valid must hold one mask"),
    ],
)
def test_photographs_that_can_not_be_fused_are_refused(images, valid, told):
    with pytest.raises(ValueError, match=told):
        exposure_fusion(images, valid=valid)
