"""Measures of a tone-mapped picture that fall when something known is taken from it."""

import cv2
import numpy as np
import pytest
from scipy.stats import norm

from hdr_helpers.lab.judging import (
    SCALES,
    clipped_share,
    detail_kept,
    extreme_regions,
    judge,
    local_fidelity,
    statistical_naturalness,
    structural_fidelity,
    tmqi,
)
from hdr_helpers.tonemap import luminance, tonemap


@pytest.fixture(scope="module")
def radiance(chapel):
    return chapel.truth.radiance


@pytest.fixture(scope="module")
def picture(radiance):
    """A picture in which all detail is visible: the logarithm of each channel, stretched."""
    log = np.log(radiance)
    return ((log - log.min()) / np.ptp(log)).astype(np.float32)


def blurred_in(picture, region):
    """The picture with the detail in a region taken out, the rest untouched."""
    smooth = cv2.GaussianBlur(picture, (0, 0), 12)
    return np.where(region[..., None], smooth, picture)


def test_black_is_0_in_all_channels_and_white_is_255_in_one():
    ldr = np.full((10, 10, 3), 0.5)
    ldr[0, :3] = 0
    ldr[1, :4] = (0, 0, 0.3)  # a strong blue is no black
    ldr[2, :5, 0] = 1.2
    ldr[3, :6] = 0.0019  # rounds to 0
    assert clipped_share(ldr) == (0.09, 0.05)


def test_the_extreme_regions_are_the_darkest_and_the_brightest_places(radiance):
    dark, bright = extreme_regions(radiance)
    light = luminance(radiance)
    assert dark.mean() == pytest.approx(0.05, abs=0.001) and bright.mean() == pytest.approx(0.05, abs=0.001)
    assert np.median(light[dark]) < np.percentile(light, 5)
    assert np.median(light[bright]) > np.percentile(light, 95)


def test_a_picture_that_shows_all_keeps_nearly_all(radiance, picture):
    kept = detail_kept(picture, radiance)
    assert 0.9 < kept.dark <= 1 and 0.9 < kept.bright <= 1


@pytest.mark.parametrize("where", ["dark", "bright"])
def test_detail_taken_from_a_region_lowers_its_measure_and_no_other(radiance, picture, where):
    regions = dict(zip(("dark", "bright"), extreme_regions(radiance), strict=True))
    full, less = detail_kept(picture, radiance), detail_kept(blurred_in(picture, regions[where]), radiance)
    other = {"dark": "bright", "bright": "dark"}[where]
    assert getattr(less, where) < getattr(full, where) - 0.2
    assert getattr(less, other) == pytest.approx(getattr(full, other), abs=1e-9)


def test_a_region_of_one_value_has_kept_nothing_and_a_reversed_one_too(radiance, picture):
    dark, _ = extreme_regions(radiance)
    assert detail_kept(np.where(dark[..., None], 0.1, picture), radiance).dark < 0.01
    assert max(detail_kept(1 - picture, radiance)) < 0.1


def test_less_contrast_keeps_less_once_it_is_below_a_grey_level(radiance, picture):
    kept = [detail_kept(0.4 + share * picture, radiance).dark for share in (0.5, 0.1, 0.02, 0.004)]
    assert kept[0] > 0.8
    assert np.all(np.diff(kept) < 0) and kept[-1] < 0.1


def test_detail_of_less_than_half_a_grey_level_is_lost_as_it_is_on_the_screen(radiance, picture):
    assert detail_kept((128 + 0.4 * (2 * picture - 1)) / 255, radiance) == (0, 0)


def test_strong_contrasts_do_not_outvote_fine_detail():
    grain = np.random.default_rng(0).standard_normal((80, 120))
    log_light = np.repeat([0.0, 8.0], 60) + grain * np.repeat([1.0, 0.15], 40)[:, None]  # coarse above, fine below
    fine = 0.5 + 0.1 * np.where(np.arange(80)[:, None] < 40, 0, grain)
    kept = detail_kept(fine[..., None].repeat(3, axis=2), np.exp(log_light)[..., None].repeat(3, axis=2), share=50)
    assert 0.4 < kept.dark < 0.6


def test_noise_hides_detail(radiance, picture):
    rng = np.random.default_rng(0)
    kept = [detail_kept(picture + s * rng.standard_normal(picture.shape), radiance).dark for s in (0, 0.03, 0.1, 0.3)]
    assert np.all(np.diff(kept) < -0.05)


def test_a_scene_without_contrast_has_nothing_to_lose():
    assert detail_kept(np.full((40, 50, 3), 0.5), np.full((40, 50, 3), 2.0)) == (1, 1)


@pytest.mark.parametrize("factor", [1e-5, 7.0, 1e6])
def test_the_scale_of_the_radiance_map_does_not_matter(radiance, picture, factor):
    one, other = judge(picture, radiance), judge(picture, radiance * np.float32(factor))
    np.testing.assert_allclose(other.detail, one.detail, atol=1e-4)
    np.testing.assert_allclose(other.tmqi, one.tmqi, atol=1e-4)


def test_pixels_that_are_no_light_do_not_break_the_measures(radiance, picture):
    broken = radiance.copy()
    broken[100, 100:104] = np.array([np.nan, np.inf, -1, 0])[:, None]
    one, other = judge(picture, radiance), judge(picture, broken)
    np.testing.assert_allclose(other.detail, one.detail, atol=0.02)
    np.testing.assert_allclose(other.tmqi, one.tmqi, atol=0.02)


def test_gamma_alone_shows_less_of_the_chapel_than_durand(radiance):
    gamma, durand = (judge(tonemap(radiance, operator), radiance) for operator in ("gamma", "durand"))
    assert gamma.detail.dark < durand.detail.dark - 0.3
    assert gamma.tmqi.fidelity < durand.tmqi.fidelity - 0.1
    assert gamma.tmqi.naturalness < durand.tmqi.naturalness - 0.3
    assert gamma.tmqi.quality < durand.tmqi.quality - 0.1


def test_a_picture_of_one_grey_is_worth_little_and_all_measures_stay_in_0_to_1(radiance, picture):
    flat = tmqi(np.full_like(picture, 0.45), radiance)
    assert flat.fidelity < 0.35 and flat.naturalness < 0.01
    for ldr in (picture, 1 - picture, np.zeros_like(picture), np.ones_like(picture)):
        assert all(0 <= value <= 1 for value in tmqi(ldr, radiance))
        assert all(0 <= value <= 1 for value in detail_kept(ldr, radiance))


def test_more_blur_and_more_noise_lower_the_fidelity(radiance, picture):
    sharp = structural_fidelity(picture, radiance)
    blurred = [structural_fidelity(cv2.GaussianBlur(picture, (0, 0), s), radiance) for s in (1, 3, 9)]
    rng = np.random.default_rng(0)
    noisy = [structural_fidelity(picture + s * rng.standard_normal(picture.shape), radiance) for s in (0.05, 0.2)]
    assert np.all(np.diff([sharp, *blurred]) < -0.01)
    assert np.all(np.diff([sharp, *noisy]) < -0.02)


def test_a_scene_that_the_screen_can_show_whole_has_fidelity_1():
    scene = np.random.default_rng(0).integers(0, 256, (200, 220, 1)).repeat(3, axis=2)
    assert structural_fidelity(scene / 255, scene) > 0.9
    assert structural_fidelity(1 - scene / 255, scene) < 0.1


def test_local_fidelity_is_the_papers_equation_window_by_window():
    rng = np.random.default_rng(3)
    picture, scene = rng.uniform(100, 103, (20, 23)), rng.uniform(0, 1e6, (20, 23))
    weights = np.outer(*[np.exp(-0.5 * (np.arange(-5, 6) / 1.5) ** 2)] * 2)
    weights /= weights.sum()
    threshold = 128 / (1.4 * 260 * (0.0192 + 0.114 * 8) * np.exp(-((0.114 * 8) ** 1.1)))
    result = local_fidelity(picture, scene, 8)
    assert result.shape == (10, 13)
    for y, x in [(0, 0), (4, 7), (9, 12)]:
        a, b = scene[y : y + 11, x : x + 11], picture[y : y + 11, x : x + 11]
        a, b = a - np.sum(weights * a), b - np.sum(weights * b)
        s_a, s_b, s_ab = (np.sum(weights * v) for v in (a * a, b * b, a * b))
        seen = [norm.cdf((np.sqrt(v) - threshold) / (threshold / 3)) for v in (s_a, s_b)]
        expected = (2 * seen[0] * seen[1] + 0.01) / (seen[0] ** 2 + seen[1] ** 2 + 0.01)
        expected *= (s_ab + 10) / (np.sqrt(s_a * s_b) + 10)
        assert result[y, x] == pytest.approx(expected, abs=1e-4)


def test_fidelity_is_made_of_five_scales_each_seen_at_half_the_frequency():
    rng = np.random.default_rng(5)
    scene = np.exp(rng.standard_normal((176, 192))).astype(np.float32)
    ldr = (scene / (1 + scene) + 0.02 * rng.standard_normal(scene.shape)).astype(np.float32)
    fidelity = structural_fidelity(ldr[..., None].repeat(3, axis=2), scene[..., None].repeat(3, axis=2))
    grey, light, expected = np.rint(np.clip(ldr, 0, 1) * 255.0), scene.astype(np.float64), 1.0
    light = (light - light.min()) / np.ptp(light) * (2**32 - 1)
    for frequency, say in zip((16, 8, 4, 2, 1), (0.0448, 0.2856, 0.3001, 0.2363, 0.1333), strict=True):
        expected *= local_fidelity(grey, light, frequency).mean() ** say
        grey, light = (cv2.resize(a, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for a in (grey, light))
    assert fidelity == pytest.approx(expected, abs=1e-3)


def test_a_flat_bright_patch_has_no_structure_by_rounding():
    scene = np.full((20, 20), 4.2e9)
    np.testing.assert_allclose(local_fidelity(np.full((20, 20), 200.0), scene, 16), 1, atol=1e-6)


def test_the_scales_of_fidelity_share_one_say():
    assert sum(SCALES) == pytest.approx(1, abs=1e-3)


def test_naturalness_is_1_for_the_usual_picture_and_falls_on_every_side_of_it():
    def picture(mean, contrast):
        blocks = np.indices((121, 121)).sum(axis=0) % 2 * 2 - 1.0
        return ((mean + contrast * blocks) / 255)[..., None].repeat(3, axis=2)

    usual = statistical_naturalness(picture(116, 17.5))
    assert usual > 0.98
    for other in (picture(60, 17.5), picture(170, 17.5), picture(116, 8), picture(116, 35)):
        assert statistical_naturalness(other) < 0.6 * usual


@pytest.mark.parametrize("size", [(160, 300), (300, 160), (10, 10)])
def test_a_picture_too_small_for_five_scales_is_refused_with_its_size(size):
    with pytest.raises(ValueError, match=f"{size[1]} x {size[0]}"):
        structural_fidelity(np.zeros((*size, 3)), np.ones((*size, 3)))


def test_161_pixels_are_enough():
    scene = np.random.default_rng(0).uniform(0, 1, (161, 161, 3))
    assert 0 < structural_fidelity(scene, scene) <= 1


def test_sizes_that_differ_and_maps_without_light_are_refused(radiance, picture):
    for measure in (detail_kept, tmqi):
        with pytest.raises(ValueError, match="one size"):
            measure(picture[:-1], radiance)
    with pytest.raises(ValueError, match="no light"):
        detail_kept(picture, np.zeros_like(radiance))
    with pytest.raises(ValueError, match="5 x 200"):
        statistical_naturalness(picture[:200, :5])
