"""Stage 3: the response, against the paper's own matrix, against truth, and under invariances."""

import tracemalloc

import cv2
import numpy as np
import pytest
import scipy.linalg

from hdr_helpers import crf
from hdr_helpers.crf import black_level, fitted_weights, gsolve, hat_weights, recover_crf, sample_pixels
from hdr_helpers.lab.metrics import crf_rmse
from hdr_helpers.load import load_bracket

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


def test_the_chapels_curve_is_at_least_as_near_to_truth_as_opencvs(chapel):
    crf = recover_crf(chapel).crf
    bgr = [np.ascontiguousarray(image[..., ::-1]) for image in chapel.images]
    response = cv2.createCalibrateDebevec().process(bgr, chapel.times.astype(np.float32))
    opencvs = np.log(response[:, 0, ::-1].T)
    assert np.all(crf_rmse(crf, chapel.truth.crf) <= crf_rmse(opencvs, chapel.truth.crf))
    assert crf_rmse(crf, chapel.truth.crf).max() < 0.05


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


def test_black_and_clipped_values_get_no_weight():
    w = hat_weights(17, 250)
    assert np.flatnonzero(w).tolist() == list(range(18, 250))
    assert np.all(np.diff(np.sign(np.diff(w[17:250]))) <= 0)  # up, then down


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
