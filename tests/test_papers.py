"""The reading list in code, against slow and plain versions of the same idea."""

import cv2
import numpy as np
import pytest

from hdr_helpers.papers.durand2002 import fast_bilateral, tonemap_durand


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


def test_saturation_0_is_grey_and_1_keeps_the_ratios_of_colours():
    radiance = np.full((30, 40, 3), (0.8, 0.4, 0.1), np.float32)
    assert np.ptp(tonemap_durand(radiance, saturation=0), axis=2).max() < 1e-5
    linear = tonemap_durand(radiance, saturation=1) ** 2.2
    np.testing.assert_allclose(linear[..., 0] / linear[..., 2], 8, rtol=1e-3)
