"""Measures of error that find a known error and overlook what is free."""

from dataclasses import replace

import numpy as np
import pytest

from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.metrics import crf_rmse, moving_error, one_photo_errors, psnr_l, psnr_mu, radiance_error
from hdr_helpers.load import Truth

TRUTH = np.exp(np.random.default_rng(0).normal(0, 2, (40, 50, 3))).astype(np.float32)


def test_one_scale_a_channel_is_no_error():
    error = radiance_error(TRUTH * [3, 0.2, 40], TRUTH)
    assert error.p95 < 1e-5
    assert np.abs(error.stops).max() < 1e-5


def test_a_known_error_is_found_with_its_sign():
    wrong = TRUTH * 5
    wrong[:4] *= 2  # a tenth of the pixels, a stop too bright
    wrong[4] /= 8
    error = radiance_error(wrong, TRUTH)
    np.testing.assert_allclose(error.stops[:4], 1, atol=1e-5)
    np.testing.assert_allclose(error.stops[4], -3, atol=1e-5)
    assert error.median < 1e-5
    assert error.p95 == pytest.approx(1, abs=1e-5)


def test_pixels_outside_of_where_do_not_count():
    wrong = TRUTH.copy()
    wrong[:30] *= np.random.default_rng(1).uniform(0.5, 2, (30, 50, 3))
    where = np.zeros((40, 50), bool)
    where[30:] = True
    assert radiance_error(wrong, TRUTH, where).p95 < 1e-5 < radiance_error(wrong, TRUTH).p95


@pytest.mark.parametrize("value", [0, np.nan, np.inf, -1])
def test_pixels_without_a_usable_value_are_marked_and_do_not_count(value):
    broken = TRUTH * 2
    broken[3, 4] = value
    error = radiance_error(broken, TRUTH)
    assert np.argwhere(np.isnan(error.stops).all(axis=2)).tolist() == [[3, 4]]
    assert error.p95 < 1e-5


def test_the_gauge_of_a_curve_is_no_error():
    truth = Camera().crf()
    assert crf_rmse(truth + np.array([[1], [-2], [0.3]]), truth).max() < 1e-12


def test_a_known_error_of_a_curve_is_found_in_stops_in_its_channel():
    truth = Camera().crf()
    wrong = truth.copy()
    wrong[1] += 0.25 * np.log(2) * np.where(np.arange(256) % 2, 1, -1)
    np.testing.assert_allclose(crf_rmse(wrong, truth), [0, 0.25, 0], atol=1e-12)


def test_curve_errors_at_the_ends_do_not_count():
    truth = Camera().crf()
    wrong = truth.copy()
    wrong[:, :5] += 3
    wrong[:, 251:] -= 3
    assert crf_rmse(wrong, truth).max() == 0
    assert crf_rmse(wrong, truth, low=4).min() > 0.1


def test_psnr_rises_as_noise_falls():
    noise = np.random.default_rng(2).standard_normal(TRUTH.shape)
    values = [psnr_mu(TRUTH * np.exp(size * noise), TRUTH) for size in (0.4, 0.1, 0.02)]
    assert values[0] < values[1] - 6 and values[1] < values[2] - 6


def test_psnr_ignores_one_scale_a_channel_and_survives_broken_pixels():
    noisy = TRUTH * np.exp(0.1 * np.random.default_rng(3).standard_normal(TRUTH.shape))
    assert psnr_mu(noisy * [3, 0.2, 40], TRUTH) == pytest.approx(psnr_mu(noisy, TRUTH), abs=1e-6)
    noisy[0, 0] = np.nan
    noisy[0, 1] = np.inf
    noisy[0, 2] = 0
    assert np.isfinite(psnr_mu(noisy, TRUTH))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("measure", [psnr_mu, psnr_l])
def test_psnr_of_what_is_equal_is_infinite_without_a_warning(measure):
    truth = np.round(TRUTH * 4) / 4 + 1
    assert measure(truth, truth) == np.inf


def test_a_truth_that_does_not_know_what_moved_is_told_from_one_that_does():
    with pytest.raises(ValueError, match="moved is None"):
        moving_error(TRUTH, Truth(TRUTH, crf=None))


def test_guesses_from_one_photograph_are_the_same_from_16_bits():
    bracket = Camera(jpeg_quality=None).shoot(np.geomspace(0.01, 1, 3000).reshape(10, 100, 3), [0.1, 0.2])
    deep = replace(bracket, images=[image.astype(np.uint16) << 8 for image in bracket.images])
    medians = [[(a.median, b.median) for a, b in one_photo_errors(each)] for each in (bracket, deep)]
    assert medians[0] == medians[1]
