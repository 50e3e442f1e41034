"""The reading list in code, against slow and plain versions of the same idea."""

import cv2
import numpy as np
import pytest

from hdr_helpers.papers.durand2002 import fast_bilateral, follow_edges, in_colour, tonemap_durand, where_lit


def edge(contrast, size=(80, 120), noise=0.1):
    """A step of the given height down the middle, with noise."""
    values = noise * np.random.default_rng(0).standard_normal(size)
    values[:, size[1] // 2 :] += contrast
    return values.astype(np.float32)


@pytest.mark.parametrize("sigma_space, within", [(3.0, 0.02), (4.0, 0.02), (6.0, 0.03), (10.0, 0.03)])
def test_the_fast_bilateral_filter_is_near_the_plain_one(sigma_space, within):
    values = edge(2.0)
    plain = cv2.bilateralFilter(values, 2 * int(4 * sigma_space) + 1, 0.4, sigma_space)
    assert np.abs(fast_bilateral(values, sigma_space) - plain).max() < within


def test_the_bilateral_filter_smooths_noise_and_keeps_an_edge_that_a_gaussian_smears():
    clean, values = edge(2.0, noise=0), edge(2.0)
    filtered = fast_bilateral(values, 4.0)
    assert np.abs(filtered - clean).std() < 0.3 * np.abs(values - clean).std()
    assert np.abs(filtered - clean).max() < 0.15
    assert np.abs(cv2.GaussianBlur(values, (0, 0), 4.0) - clean).max() > 0.8


@pytest.mark.parametrize("value", [-3.0, 0.0, 2.5])
@pytest.mark.parametrize("size", [(1, 1), (5, 90), (60, 70)])
def test_a_constant_picture_passes_unharmed(value, size):
    values = np.full(size, value, np.float32)
    np.testing.assert_allclose(fast_bilateral(values, 0.02 * max(size)), values, atol=1e-5)


def test_a_constant_added_to_the_values_is_only_added():
    values = edge(1.5)
    np.testing.assert_allclose(fast_bilateral(values + 8, 8.0), fast_bilateral(values, 8.0) + 8, atol=1e-4)


def test_a_wide_range_is_compressed_to_the_contrast_asked_for():
    radiance = np.repeat(10 ** edge(4.0, (100, 150), noise=0)[..., None], 3, axis=2) / 1e4
    light = tonemap_durand(radiance, contrast=30, saturation=1, gamma=2.2) ** 2.2
    assert light[50, 140, 1] / light[50, 10, 1] == pytest.approx(30, rel=0.02)


def test_a_range_that_fits_the_screen_is_not_stretched():
    radiance = np.repeat(10 ** edge(1.0, (100, 150), noise=0)[..., None], 3, axis=2) / 10
    light = tonemap_durand(radiance, contrast=30, saturation=1, gamma=2.2) ** 2.2
    assert light[50, 140, 1] / light[50, 10, 1] == pytest.approx(10, rel=0.02)


def test_detail_is_neither_lost_nor_amplified_where_the_base_is_compressed():
    grain = 0.02 * np.random.default_rng(1).standard_normal((100, 150))
    radiance = np.repeat(10 ** (edge(4.0, (100, 150), noise=0) + grain)[..., None], 3, axis=2) / 1e4
    log_light = 2.2 * np.log10(tonemap_durand(radiance.astype(np.float32), saturation=1, gamma=2.2)[..., 0])
    for side in (np.s_[:, 10:50], np.s_[:, 100:140]):
        assert log_light[side].std() == pytest.approx(grain[side].std(), rel=0.05)


@pytest.mark.parametrize("step, softness", [(1.5, 1.0), (2.0, 0.6), (2.0, 1.0), (3.0, 1.0), (3.0, 1.5)])
def test_no_line_is_drawn_along_an_edge_that_a_lens_has_softened(step, softness):
    log_light = np.repeat([-5, step - 5, 0], 100).astype(np.float32)  # two edges, five decades in all
    light = cv2.GaussianBlur(np.tile(10**log_light, (90, 1)), (0, 0), softness)
    row = tonemap_durand(np.repeat(light[..., None], 3, axis=2))[45, :, 1] * 255
    assert np.diff(row).min() > -3  # grey levels; a line would be 9 to 30 deep


def test_a_base_follows_an_edge_and_not_the_grain_beside_it():
    values, step = edge(2.0, noise=0.02), np.sign(edge(2.0, noise=0) - 1) + 1
    soft = cv2.GaussianBlur(values, (0, 0), 1.5)
    followed = follow_edges(step, soft, 4)
    off, was_off = (np.abs(base - soft)[:, 57:63].max() for base in (followed, step))
    assert off < 0.3 * was_off
    assert followed[:, 5:50].std() < 0.4 * soft[:, 5:50].std()


def test_saturation_0_is_grey_and_1_keeps_the_ratios_of_colours():
    radiance = np.full((30, 40, 3), (0.8, 0.4, 0.1), np.float32)
    assert np.ptp(tonemap_durand(radiance, saturation=0), axis=2).max() < 1e-5
    linear = tonemap_durand(radiance, saturation=1) ** 2.2
    np.testing.assert_allclose(linear[..., 0] / linear[..., 2], 8, rtol=1e-3)


def test_new_luminance_in_old_colours_is_the_plain_formula_and_black_stays_black():
    rng = np.random.default_rng(2)
    radiance, shown = rng.uniform(0.001, 1, (20, 30, 3)).astype(np.float32), rng.uniform(0, 1, (20, 30))
    light = radiance.mean(axis=2)
    expected = ((radiance / light[..., None]) ** 0.7 * shown[..., None]) ** (1 / 2.4)
    picture = in_colour(radiance, light, shown.astype(np.float32), 0.7, 2.4)
    np.testing.assert_allclose(picture, expected, rtol=1e-4, atol=1e-5)
    radiance[3, :4] = 0
    assert in_colour(radiance, light, shown.astype(np.float32), 0.7, 2.4)[3, :4].max() < 1 / 255


def test_pixels_are_lit_when_they_are_not_black_and_all_count_where_none_is():
    values, light = np.arange(4.0), np.array([0, 1e-6, 0.5, 1], np.float32)
    assert where_lit(values, light).tolist() == [2, 3]
    assert where_lit(values, 0 * light).tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize("size", [(240, 360), (243, 361)])
def test_a_wide_filter_works_in_blocks_and_the_result_looks_as_if_it_did_not(size):
    sigma = 40.0  # blocks of 2 x 2 begin at 32
    log_light = cv2.GaussianBlur(edge(3.0, size, noise=0.05), (0, 0), 1)

    def blur(picture):
        return cv2.GaussianBlur(picture, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)

    plain = np.zeros_like(log_light)  # at full size
    centres, step = np.linspace(log_light.min(), log_light.max(), 20, dtype=np.float32, retstep=True)
    for centre in centres:
        near = np.exp(-0.5 * ((log_light - centre) / 0.4) ** 2)
        smooth = centre + blur(near * (log_light - centre)) / np.maximum(blur(near), 1e-12)
        plain += np.maximum(1 - np.abs(log_light - centre) / step, 0) * smooth
    base = follow_edges(fast_bilateral(log_light, sigma), log_light, 6)
    difference = np.abs(base - follow_edges(plain, log_light, 6))
    assert difference.mean() < 0.01 and difference.max() < 0.06
