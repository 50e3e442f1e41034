"""Stage 3: the response, against the paper's own matrix, against truth, and under invariances."""

import itertools
import tracemalloc
from dataclasses import replace
from functools import cache, partial

import cv2
import numpy as np
import pytest
import scipy.linalg

from hdr_helpers import crf
from hdr_helpers.crf import (
    black_level,
    crf_opencv,
    fitted_weights,
    gaussian_weights,
    gsolve,
    hat_weights,
    noise_weights,
    recover_crf,
    sample_pixels,
    uniform_weights,
)
from hdr_helpers.lab.camera import FAMILIES
from hdr_helpers.lab.metrics import crf_rmse
from hdr_helpers.lab.scenes import random_scene
from hdr_helpers.load import Bracket, BracketError, load_bracket

HAT = hat_weights()
WEIGHTS = {
    "hat": HAT,
    "hat+1": HAT + 1,
    "uniform": np.ones(256),
    "random": np.random.default_rng(7).uniform(0.2, 3, 256),
}
B = np.log([1 / 250, 1 / 60, 1 / 15, 1 / 4, 1.3])


def gamma_samples(n, times=B, gamma=2.2, noise=0.0, seed=0):
    """(n, P) values and the true g of a camera with a gamma curve."""
    rng = np.random.default_rng(seed)
    log_E = rng.uniform(-times.max() - 5, -times.min(), n)
    exposure = np.exp(log_E[:, None] + times)
    Z = np.rint(np.clip(255 * exposure ** (1 / gamma) + noise * rng.standard_normal(exposure.shape), 0, 255))
    g = gamma * np.log(np.maximum(np.arange(256), 0.5) / 128)
    return Z.astype(int), g


def paper_solution(Z, B, lam, w):
    """The appendix of the paper: build A and b, solve by least squares."""
    n, p = Z.shape
    A, b = np.zeros((n * p + 1 + 254, 256 + n)), np.zeros(n * p + 1 + 254)
    for row, (i, j) in enumerate(np.ndindex(n, p)):
        weight = w[Z[i, j]]
        A[row, Z[i, j]], A[row, 256 + i], b[row] = weight, -weight, weight * B[j]
    A[n * p, 128] = 1
    for z in range(1, 255):
        A[n * p + z, z - 1 : z + 2] = lam * w[z] * np.array([1, -2, 1])
    x = scipy.linalg.lstsq(A, b, lapack_driver="gelsy")[0]
    return x[:256], x[256:]


@pytest.mark.parametrize("lam", [0.7, 20, 300])
@pytest.mark.parametrize("w", WEIGHTS.values(), ids=WEIGHTS.keys())
def test_gsolve_is_the_least_squares_solution_of_the_papers_matrix(w, lam):
    Z, _ = gamma_samples(37, noise=3)
    g, log_E = gsolve(Z, B, lam, w)
    expected_g, expected_log_E = paper_solution(Z, B, lam, w)
    seen = w[Z].max(axis=1) > 0
    assert np.abs(g - expected_g).max() < 1e-8
    assert np.abs(log_E - expected_log_E)[seen].max() < 1e-8
    assert g[128] == 0


def test_strong_smoothness_costs_no_digits():
    Z, _ = gamma_samples(37, noise=3)
    w = WEIGHTS["uniform"]
    assert np.abs(gsolve(Z, B, 1e5, w)[0] - paper_solution(Z, B, 1e5, w)[0]).max() < 1e-8


def test_how_many_pixels_are_worked_on_at_a_time_changes_nothing(monkeypatch):
    Z, _ = gamma_samples(203, noise=3)
    g, log_E = gsolve(Z, B, 20, HAT)
    for chunk in 1, 10, 203:
        monkeypatch.setattr(crf, "CHUNK", chunk)
        again, log_E_again = gsolve(Z, B, 20, HAT)
        np.testing.assert_allclose(again, g, atol=1e-10)
        np.testing.assert_allclose(log_E_again, log_E, atol=1e-10)


def test_memory_does_not_grow_with_the_number_of_pixels():
    peaks = []
    for count in 2 * crf.CHUNK, 8 * crf.CHUNK:
        Z = np.random.default_rng(1).integers(0, 256, (count, 3)).astype(np.uint8)
        tracemalloc.start()
        _, log_E = gsolve(Z, np.log([0.1, 1, 10]), 20, HAT)
        peaks.append(tracemalloc.get_traced_memory()[1] - log_E.nbytes)
        tracemalloc.stop()
    assert peaks[1] < 1.1 * peaks[0]


def test_times_may_repeat():
    repeated = np.log([0.1, 0.1, 1, 1, 1])
    Z, _ = gamma_samples(41, repeated, noise=4)
    expected_g, expected_log_E = paper_solution(Z, repeated, 10, HAT + 1)
    g, log_E = gsolve(Z, repeated, 10, HAT + 1)
    assert np.abs(g - expected_g).max() < 1e-8
    assert np.abs(log_E - expected_log_E).max() < 1e-8


def test_twice_the_times_leaves_g_alone_and_halves_the_irradiance():
    Z, _ = gamma_samples(80, noise=2)
    g, log_E = gsolve(Z, B, 20, HAT)
    g2, log_E2 = gsolve(Z, B + np.log(2), 20, HAT)
    np.testing.assert_allclose(g2, g, atol=1e-10)
    np.testing.assert_allclose(log_E2, log_E - np.log(2), atol=1e-10)


def test_the_order_of_photographs_and_of_pixels_changes_nothing():
    Z, _ = gamma_samples(80, noise=2)
    rng = np.random.default_rng(1)
    photos, pixels = rng.permutation(len(B)), rng.permutation(len(Z))
    g, log_E = gsolve(Z, B, 20, HAT)
    g2, log_E2 = gsolve(Z[pixels][:, photos], B[photos], 20, HAT)
    np.testing.assert_allclose(g2, g, atol=1e-10)
    np.testing.assert_allclose(log_E2, log_E[pixels], atol=1e-10)


@pytest.mark.parametrize("w", WEIGHTS.values(), ids=WEIGHTS.keys())
def test_a_logarithmic_camera_is_recovered_exactly(w):
    # g is a straight line: no rounding of pixel values, no cost of smoothness, so any lam and w must find it.
    step, start = np.array([0, 25, 60, 110]), np.random.default_rng(2).integers(1, 144, 101)
    g, log_E = gsolve(start[:, None] + step, 0.02 * step, 30, w)
    np.testing.assert_allclose(g, 0.02 * (np.arange(256) - 128), atol=1e-9)
    np.testing.assert_allclose(log_E, 0.02 * (start - 128), atol=1e-9)


def test_a_gamma_camera_is_recovered_within_rounding():
    Z, truth = gamma_samples(3000)
    g, _ = gsolve(Z, B, 30, HAT)
    assert np.abs(g - truth)[10:250].max() < 0.02


def test_values_never_observed_are_filled_in_smoothly():
    Z, _ = gamma_samples(400)
    Z = Z[(Z.min(axis=1) > 0) & (Z.max(axis=1) < 140)]
    g, _ = gsolve(Z, B, 5, HAT)
    assert np.all(np.isfinite(g))
    assert np.abs(np.diff(g, 2))[140:].max() < 1e-3


def test_pixels_clipped_in_every_photograph_say_nothing_and_do_no_harm():
    Z, _ = gamma_samples(60, noise=2)
    Z = Z[HAT[Z].max(axis=1) > 0]
    clipped = np.repeat([[0], [255]], len(B), axis=1)
    g, log_E = gsolve(np.concatenate([Z, clipped]), B, 20, HAT)
    expected_g, expected_log_E = gsolve(Z, B, 20, HAT)
    np.testing.assert_allclose(g, expected_g, atol=1e-10)
    np.testing.assert_allclose(log_E[:-2], expected_log_E, atol=1e-10)
    assert np.all(np.isnan(log_E[-2:]))


GOOD = {"Z": np.full((4, 3), 100), "B": B[:3], "lam": 20, "w": HAT}


@pytest.mark.parametrize(
    "bad, message",
    [
        ({"Z": GOOD["Z"].astype(float)}, "Z must hold integers in 0..255; got float64"),
        ({"Z": GOOD["Z"] + 156}, "Z must hold integers in 0..255; got int64 in 256..256"),
        ({"Z": -GOOD["Z"]}, "in -100..-100"),
        ({"Z": GOOD["Z"][0]}, r"got \(3,\), \(3,\)"),
        ({"B": B[:4]}, r"one log time for each column; got \(4, 3\), \(4,\)"),
        ({"B": np.zeros(3)}, "two different log exposure times"),
        ({"B": np.log([0, 1, 2], where=[False, True, True], out=np.full(3, np.nan))}, "B must be finite"),
        ({"lam": 0}, "lam must be positive; got 0"),
        ({"lam": np.nan}, "lam must be positive; got nan"),
        ({"w": HAT[1:]}, r"256 weights.*\(255,\)"),
        ({"w": -HAT}, "none negative"),
        ({"w": 0 * HAT}, "not all 0"),
    ],
)
def test_gsolve_refuses_what_does_not_fit(bad, message):
    with pytest.raises(ValueError, match=message):
        gsolve(**(GOOD | bad))


# ----------------------------------------------------------------------------------- whole curves


COUNTS = {4: [1 / 30, 1 / 4, 2.5, 15], 16: 2.0 ** np.arange(-10, 6)}
KINDS = list(itertools.product(FAMILIES, COUNTS))


@cache
def shot(family, count, jpeg=None):
    """A bracket of a scene with 18.5 stops. A converter of 12 bits would leave no smooth truth in the dark."""
    return FAMILIES[family](jpeg_quality=jpeg, bits=16).shoot(random_scene(5, (384, 576)), COUNTS[count])


def opencvs(bracket):
    """OpenCV's CalibrateDebevec, called directly, on BGR as it is used to."""
    bgr = [np.ascontiguousarray(image[..., ::-1]) for image in bracket.images]
    response = cv2.createCalibrateDebevec().process(bgr, bracket.times.astype(np.float32))
    return np.log(response[:, 0, ::-1].T.astype(np.float64))


@pytest.mark.parametrize("family, count", KINDS)
def test_noise_hardly_moves_the_curve_by_a_tenth_of_what_it_does_to_opencvs(family, count):
    bracket = shot(family, count)
    ours, theirs = (crf_rmse(curve, bracket.truth.crf).mean() for curve in (recover_crf(bracket).crf, opencvs(bracket)))
    assert ours <= theirs / 10


@pytest.mark.parametrize("jpeg, factor", [(95, 2), (85, 1.5)])
@pytest.mark.parametrize("family, count", KINDS)
def test_with_jpeg_the_curve_is_nearer_to_the_truth_than_opencvs(family, count, jpeg, factor):
    bracket = shot(family, count, jpeg)
    ours, theirs = (crf_rmse(curve, bracket.truth.crf).mean() for curve in (recover_crf(bracket).crf, opencvs(bracket)))
    assert ours <= theirs / factor


def test_the_chapels_curve_is_nearer_to_the_truth_than_opencvs(chapel):
    ours, theirs = (crf_rmse(curve, chapel.truth.crf) for curve in (recover_crf(chapel).crf, opencvs(chapel)))
    assert np.all(ours < theirs / 5)
    assert ours.max() < 0.02


def test_more_photographs_pixels_and_noise_leave_the_standard_errors_honest():
    # A standard error is a promise: the truth lies within it about 68 times of 100.
    shares = []
    for family, count in KINDS:
        bracket = shot(family, count)
        response = recover_crf(bracket)
        others = np.flatnonzero((np.arange(256) >= 5) & (np.arange(256) <= 250) & (np.arange(256) != 128))
        shares.append((np.abs(response.crf - bracket.truth.crf) <= response.errors)[:, others].mean())
    assert 0.58 < np.mean(shares) < 0.8
    assert min(shares) > 0.35


def test_less_evidence_gives_larger_standard_errors():
    whole = shot("video standards", 4)
    few = thinned(whole, np.s_[::6, ::6])
    seen = np.s_[:, 10:120]
    assert np.median(recover_crf(few).errors[seen] / recover_crf(whole).errors[seen]) > 1.5
    # Above 150 nothing was seen: what is said there is a guess, and says so.
    dark = replace(whole, images=tuple(np.minimum(image, 150) for image in whole.images), truth=None)
    errors = recover_crf(dark).errors
    assert errors[:, 240].min() > 10 * errors[:, 100].max()


def thinned(bracket, pixels, photographs=slice(None)):
    images = tuple(np.ascontiguousarray(image[pixels]) for image in bracket.images[photographs])
    return Bracket(images, bracket.times[photographs], bracket.names[photographs])


def spread(curves):
    """(3,) how far curves lie apart, RMS in stops over the values 5..250, the gauge removed."""
    stops = np.array(curves)[..., 5:251] / np.log(2)
    stops -= stops.mean(axis=2, keepdims=True)
    return np.sqrt(np.mean((stops - stops.mean(axis=0)) ** 2, axis=(0, 2)))


@pytest.mark.parametrize("jpeg", [None, 95])
@pytest.mark.parametrize("family, count", KINDS)
def test_the_curve_stays_where_size_half_or_photographs_change(family, count, jpeg):
    bracket = shot(family, count, jpeg)
    variants = [bracket, *(thinned(bracket, pixels) for pixels in (
        np.s_[::2, ::2], np.s_[1::3, 1::3], np.s_[:192], np.s_[192:], np.s_[:, :288], np.s_[:, 288:]))]  # fmt: skip
    variants += [thinned(bracket, np.s_[:], photographs) for photographs in (slice(1, None), slice(-1))]
    ours = [recover_crf(variant).crf for variant in variants]
    theirs = [opencvs(variant) for variant in variants]
    assert np.mean(spread(ours)) <= np.mean(spread(theirs)) / 5


def test_how_often_every_pixel_is_repeated_changes_nothing_in_the_smoothness():
    bracket = shot("film", 4)
    repeated = thinned(bracket, np.s_[np.repeat(np.arange(384), 3)])
    assert spread([recover_crf(b).crf for b in (bracket, repeated)]).max() < 5e-4


def test_what_is_masked_says_nothing(small_bracket):
    h, w = small_bracket.images[0].shape[:2]
    right = np.broadcast_to(np.arange(w) >= w // 3, (h, w))
    rng = np.random.default_rng(0)
    spoiled = tuple(
        np.where(right[..., None], image, rng.integers(0, 256, image.shape, np.uint8)) for image in small_bracket.images
    )
    masked = recover_crf(replace(small_bracket, images=spoiled, valid=(right,) * len(spoiled)))
    alone = recover_crf(thinned(small_bracket, np.s_[:, w // 3 :]))
    np.testing.assert_allclose(masked.crf[:, 10:], alone.crf[:, 10:], atol=1e-9)


def test_twice_the_times_leaves_the_curve_alone(small_bracket):
    twice = replace(small_bracket, times=2 * small_bracket.times)
    np.testing.assert_allclose(recover_crf(twice).crf, recover_crf(small_bracket).crf, atol=1e-9)


def test_what_is_too_small_for_transfer_functions_is_solved_by_least_squares(chapel):
    tiny = thinned(chapel, np.s_[::60, ::60])
    response, whole = recover_crf(tiny), recover_crf(chapel)
    assert "least squares" in response.method
    assert "transfer" in whole.method
    assert crf_rmse(response.crf, chapel.truth.crf).max() < 0.15
    assert np.median(response.errors) > 3 * np.median(whole.errors)


@pytest.mark.parametrize("value", [0, 255])
def test_a_bracket_without_usable_pixels_is_refused(value):
    images = tuple(np.full((20, 30, 3), value, np.uint8) for _ in range(3))
    with pytest.raises(ValueError, match="No pixel has two different usable values"):
        recover_crf(Bracket(images, np.array([1.0, 2, 4]), ("a", "b", "c")))


@pytest.mark.parametrize("lam", [0, -1, np.nan])
def test_a_smoothness_that_is_not_positive_is_refused(small_bracket, lam):
    with pytest.raises(ValueError, match="lam must be positive; got"):
        recover_crf(small_bracket, lam)


def test_one_exposure_is_no_bracket(small_bracket):
    with pytest.raises(BracketError, match="at least two photographs with different exposure times"):
        Bracket(small_bracket.images[:1], small_bracket.times[:1], small_bracket.names[:1])


def test_times_that_do_not_match_are_refused(small_bracket):
    with pytest.raises(BracketError, match="there must be one of each for every exposure"):
        Bracket(small_bracket.images, small_bracket.times[:-1], small_bracket.names)


@pytest.mark.parametrize("lam", [1, 1e-3, 100])
def test_a_recovered_curve_never_falls_and_keeps_its_gauge(small_bracket, lam):
    crf = recover_crf(small_bracket, lam).crf
    assert crf.shape == (3, 256)
    assert np.all(np.diff(crf, axis=1) >= 0)
    assert np.all(crf[:, 128] == 0)


def test_more_smoothness_gives_a_smoother_curve(small_bracket):
    bend = [np.sum(np.diff(recover_crf(small_bracket, lam).crf[:, 10:], 2) ** 2) for lam in (0.01, 0.1, 1)]
    assert bend[0] > bend[1] > bend[2]


# --------------------------------------------------------------------------- weights and samples


def test_the_hat_of_the_paper():
    expected = [z if z <= 127 else 255 - z for z in range(256)]  # equation 4 with Zmin = 0, Zmax = 255
    assert np.array_equal(hat_weights(), expected)


GAMMA = 2.2 * np.log(np.maximum(np.arange(256), 0.5) / 128)
SHAPES = {"hat": hat_weights, "gaussian": gaussian_weights, "uniform": uniform_weights,
          "noise": partial(noise_weights, GAMMA)}  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_black_and_clipped_values_get_no_weight(shape):
    w = shape(17, 250)
    assert np.flatnonzero(w).tolist() == list(range(18, 250))
    assert np.all(np.diff(np.sign(np.diff(w[18:250]))) <= 0)  # up, then down, or level


def test_the_gaussian_is_that_of_robertson():
    w = gaussian_weights()
    expected = np.exp(-4 * (np.array([64, 127, 191]) - 127.5) ** 2 / 127.5**2)
    np.testing.assert_allclose(w[[64, 127, 191]], expected)
    np.testing.assert_allclose(w[1:255], w[254:0:-1])


def test_noise_weights_are_the_error_in_light_of_one_pixel_value_turned_over():
    w = noise_weights(GAMMA)
    np.testing.assert_allclose(w[[50, 100, 200]] / w[100], [0.5, 1, 2], rtol=1e-3)  # of a gamma camera g' is 2.2 / z
    flat = GAMMA.copy()
    flat[100:120] = flat[100]
    assert noise_weights(flat)[105] == 0


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_every_shape_finds_the_curve_of_a_gamma_camera(shape):
    Z, truth = gamma_samples(3000)
    g, _ = gsolve(Z, B, 5, shape(4, 250))
    assert np.abs(g - truth)[10:250].max() < 0.03


@pytest.mark.parametrize("black", [0, 1, 17, 40])
def test_the_black_level_is_found(black):
    light = np.concatenate([np.zeros(2000), np.geomspace(1e-4, 1, 6000)]).reshape(80, 100, 1)
    light = np.random.default_rng(0).permuted(light, axis=1).repeat(3, axis=2)
    bracket = [np.rint(black + (255 - black) * np.clip(light * t, 0, 1) ** 0.45).astype(np.uint8) for t in (1, 4, 16)]
    assert black_level(bracket) == black


def test_a_camera_without_a_black_level_has_none(chapel):
    assert black_level(chapel.images) == 0


def test_fitted_weights_trust_neither_noise_nor_black_nor_clipped_values(chapel):
    lifted = [np.maximum(image, 30) for image in chapel.images]
    assert np.flatnonzero(fitted_weights(chapel.images)).tolist() == list(range(5, 250))
    assert np.flatnonzero(fitted_weights(lifted)).tolist() == list(range(31, 250))


def test_the_black_level_of_the_scanned_memorial_is_found(real):
    # Its blacks are 16 to 18; grain may add a few levels.
    assert 16 <= black_level(load_bracket(real("memorial")).images) <= 21


@pytest.mark.parametrize("n", [1, 100, 997, 160 * 120])
def test_samples_are_distinct_pixels_of_the_picture(small_bracket, n):
    rows, cols = sample_pixels(small_bracket.images, n)
    assert len(set(zip(rows.tolist(), cols.tolist(), strict=True))) == n
    assert rows.min() >= 0 and rows.max() < 120
    assert cols.min() >= 0 and cols.max() < 160


def test_samples_meet_every_brightness_evenly(small_bracket):
    brightness = np.sum(small_bracket.images, axis=(0, 3), dtype=int)
    edges = np.percentile(brightness, range(10, 100, 10))
    hits = np.bincount(np.searchsorted(edges, brightness[sample_pixels(small_bracket.images, 200)]), minlength=10)
    assert hits.min() >= 15  # 20 would be perfectly even


def test_the_same_seed_gives_the_same_samples_and_another_one_others(small_bracket):
    first, again, other = (sample_pixels(small_bracket.images, 50, seed) for seed in (4, 4, 5))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_more_samples_than_pixels_are_refused(small_bracket):
    with pytest.raises(ValueError, match="19201 pixels were asked for; the photographs have 19200"):
        sample_pixels(small_bracket.images, 19201)


def test_another_method_of_opencv_is_refused_and_the_two_are_named(chapel):
    with pytest.raises(ValueError, match="debevec, robertson; got 'mertens'"):
        crf_opencv(chapel, "mertens")
