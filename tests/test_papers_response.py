"""Two papers that recover the response: from times that are roughly known, and from a single photograph."""

import cv2
import numpy as np
import pytest

from hdr_helpers.crf import crf_opencv, fitted_weights, gsolve, sample_pixels, whole_white
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.metrics import crf_rmse
from hdr_helpers.lab.scenes import random_scene
from hdr_helpers.papers.lin2004 import TYPICAL, edge_triples, inverse_responses, off_the_line, response_from_edges
from hdr_helpers.papers.mitsunaga_nayar1999 import radiometric_self_calibration

ALL = np.ones(256)
TIMES = (1 / 400, 1 / 100, 1 / 25, 1 / 6, 0.6, 2.5)  # seconds


def power_camera(offset, power):
    """Z (N, 3), times and the true g of a camera whose inverse response is (z + offset)^power, without rounding."""
    z = np.arange(0, (255 + offset) // 3 - offset + 1, 2)
    Z = np.stack([z, (3 * z + offset) // 2, 3 * z + 2 * offset], axis=1)  # z + offset times 1, 1.5 and 3
    light = (np.arange(256.0) + offset) ** power
    return Z, 0.01 * np.array([1, 1.5, 3]) ** power, np.log(np.maximum(light, 1e-9) / light[128])


def samples(bracket, n=20_000):
    """Z (N, P, 3) and weights of a bracket, as the course samples it."""
    images = [whole_white(image) for image in bracket.images]
    rows, cols = sample_pixels(images, n)
    return np.stack([image[rows, cols] for image in images], axis=1), fitted_weights(images)


@pytest.fixture(scope="module")
def noisy():
    """A bracket of six photographs without compression, with its truth, Z and w."""
    bracket = Camera(jpeg_quality=None, seed=5).shoot(random_scene(5), TIMES)
    return bracket, *samples(bracket)


def calibrated(bracket, Z, w, times=None, **options):
    """crf (3, 256) and refined times (3, P) of a bracket."""
    times = bracket.times if times is None else times
    found = [radiometric_self_calibration(Z[..., c], times, w, **options) for c in range(3)]
    return np.array([g for g, _ in found]), np.array([t for _, t in found])


@pytest.mark.parametrize("order", ["its own", "chosen"])
@pytest.mark.parametrize("offset, power", [(0, 2), (10, 1), (40, 2), (24, 3)])
def test_a_camera_that_is_a_polynomial_is_recovered_exactly(offset, power, order):
    Z, times, truth = power_camera(offset, power)
    g, refined = radiometric_self_calibration(Z, times, ALL, order=power if order == "its own" else None)
    np.testing.assert_allclose(g[1:], truth[1:], atol=1e-6)  # value 0 may stand for no light at all
    np.testing.assert_allclose(refined, times, rtol=1e-8)


def test_a_power_of_all_times_can_not_be_told_from_a_power_of_the_response():
    Z, times, truth = power_camera(40, 2)
    g, refined = radiometric_self_calibration(Z, np.sqrt(times), ALL)
    np.testing.assert_allclose(g, truth / 2, atol=1e-6)
    np.testing.assert_allclose(refined, np.sqrt(times), rtol=1e-8)


@pytest.mark.parametrize("factor", [0.8, 1.2])
@pytest.mark.parametrize("wrong", [0, 3, 5])
def test_one_wrong_time_is_set_right_and_does_not_turn_the_curve(noisy, wrong, factor):
    bracket, Z, w = noisy
    told = bracket.times.copy()
    told[wrong] *= factor
    crf, refined = calibrated(bracket, Z, w, told)
    believing = [gsolve(Z[..., c], np.log(told), 20 * np.sqrt(len(Z) / 100), w)[0] for c in range(3)]
    error = crf_rmse(crf, bracket.truth.crf)
    assert np.abs(refined / bracket.times - 1).max() < 0.03 and error.max() < 0.03
    assert np.all(error < crf_rmse(believing, bracket.truth.crf))


def test_twice_the_times_leaves_g_alone_and_doubles_the_refined_times(noisy):
    bracket, Z, w = noisy
    g, refined = radiometric_self_calibration(Z[..., 1], bracket.times, w)
    g2, refined2 = radiometric_self_calibration(Z[..., 1], 2 * bracket.times, w)
    np.testing.assert_allclose(g2, g, atol=1e-8)
    np.testing.assert_allclose(refined2, 2 * refined, rtol=1e-8)


def test_black_and_clipped_values_have_no_say(noisy):
    bracket, Z, w = noisy
    unusable = np.random.default_rng(0).choice(np.flatnonzero(w == 0), (3000, len(bracket)))
    half = np.where(np.arange(len(bracket)) % 2, Z[:3000, :, 0], unusable)  # a usable value with no usable neighbour
    g, refined = radiometric_self_calibration(Z[..., 0], bracket.times, w)
    for extra in unusable, half:
        g2, refined2 = radiometric_self_calibration(np.concatenate([Z[..., 0], extra]), bracket.times, w)
        np.testing.assert_array_equal(g2, g)
        np.testing.assert_array_equal(refined2, refined)


def test_the_chapels_curve_is_nearer_to_truth_than_opencvs(chapel):
    Z, w = samples(chapel)
    crf, refined = calibrated(chapel, Z, w)
    error = crf_rmse(crf, chapel.truth.crf)
    assert np.all(error < crf_rmse(crf_opencv(chapel), chapel.truth.crf))
    assert error.max() < 0.05
    assert np.abs(refined / chapel.times - 1).max() < 0.03


def test_the_order_that_is_chosen_is_nearly_the_best_one():
    camera = Camera(jpeg_quality=90, response=((1.8, 20, 0.3), (2.0, 40, 0.6), (2.2, 30, 0.3)), seed=2)
    bracket = camera.shoot(random_scene(2), TIMES)
    Z, w = samples(bracket)
    errors = [crf_rmse(calibrated(bracket, Z, w, order=n)[0], bracket.truth.crf) for n in range(4, 11)]
    chosen = crf_rmse(calibrated(bracket, Z, w)[0], bracket.truth.crf)
    assert np.all(chosen < np.min(errors, axis=0) + 0.02)
    # A low order can't follow this curve, and a high one follows the noise.
    assert chosen.mean() < 0.6 * min(errors[0].mean(), errors[-1].mean())


@pytest.mark.parametrize("order, brightest", [(4, 250), (7, 250), (10, 250), (10, 150)])
def test_a_polynomial_response_never_falls_and_keeps_its_gauge(noisy, order, brightest):
    bracket, Z, w = noisy
    crf, _ = calibrated(bracket, Z[::40], w * (np.arange(256) < brightest), order=order)
    assert np.all(np.diff(crf, axis=1) >= 0)
    assert np.all(crf[:, 128] == 0)


def test_two_photographs_leave_their_times_as_they_are(noisy):
    bracket, Z, w = noisy
    _, refined = radiometric_self_calibration(Z[:, 2:4, 0], bracket.times[2:4], w)
    np.testing.assert_allclose(refined, bracket.times[2:4], rtol=1e-12)


GOOD = dict(zip(("Z", "times"), power_camera(40, 2)[:2], strict=True)) | {"w": ALL, "order": 2}


@pytest.mark.parametrize(
    "bad, message",
    [
        ({"Z": GOOD["Z"].astype(float)}, "Z must hold integers in 0..255; got float64"),
        ({"Z": GOOD["Z"] + 256}, "Z must hold integers in 0..255; got int64 in 256"),
        ({"times": [1.0, 2.0]}, r"times \(P,\); got \(30, 3\) and \(2,\)"),
        ({"times": [1.0, 2.0, 2.0]}, r"positive seconds, ascending; got \[1.0, 2.0, 2.0\]"),
        ({"times": [1.0, 2.0, np.nan]}, "2.0, nan"),
        ({"w": ALL[1:]}, r"256 weights.*\(255,\)"),
        ({"w": 0 * ALL}, "not all 0"),
        ({"order": 2.5}, "order must be a whole number in 1..10; got 2.5"),
        ({"Z": GOOD["Z"] // 100 * 100, "w": ALL * (np.arange(256) > 99)}, "Photographs 1 and 2 share no pixel"),
        ({"Z": GOOD["Z"][:, ::-1]}, "from the shortest exposure to the longest"),
        ({"Z": GOOD["Z"][:, [0, 0, 0]], "order": None}, "No polynomial of order 1 to 10"),
    ],
)
def test_self_calibration_refuses_what_does_not_fit(bad, message):
    with pytest.raises(ValueError, match=message):
        radiometric_self_calibration(**(GOOD | bad))


VALUES = np.arange(256) / 255
MORE_CONTRAST = np.maximum(0.5 + np.arctanh((2 * VALUES - 1) * np.tanh(1.5)) / 3, 0)  # inverse of an S-shaped curve
CAMERAS = {
    "linear": VALUES ** [[1], [1], [1]],
    "power 1.4": VALUES ** [[1.4], [1.4], [1.4]],
    "power 2.4": VALUES ** [[2.4], [2.4], [2.4]],
    "more contrast": MORE_CONTRAST ** [[2.2], [2.2], [2.2]],
    "three powers": VALUES ** [[1.7], [2.0], [2.3]],
    "logarithmic": np.tile((30**VALUES - 1) / 29, (3, 1)),
}


def log_response(light):
    """crf (3, 256) of light (3, 256)."""
    g = np.log(np.maximum(light, light[:, 1:2] / 4))
    return g - g[:, 128:129]


def photograph(light, colours=None, seed=1):
    """Sixty plain patches a little out of focus, (240, 320, 3) uint8, of random colours or of those, (n, 3), given."""
    rng = np.random.default_rng(seed)
    colours = rng.uniform(20, 240, (60, 3)) if colours is None else np.asarray(colours)
    scene = np.full((240, 320, 3), colours[0], dtype=np.uint8)
    for k in range(60):
        x, y, width, height = rng.integers(0, [320, 240, 90, 90])
        scene[y : y + height + 25, x : x + width + 25] = colours[k % len(colours)]
    E = cv2.GaussianBlur(np.stack([light[c][scene[..., c]] for c in range(3)], axis=-1), (0, 0), 1.2)
    exact = np.stack([np.interp(E[..., c], light[c], np.arange(256)) for c in range(3)], axis=-1)
    return np.rint(np.clip(exact + rng.standard_normal(exact.shape), 0, 255)).astype(np.uint8)


@pytest.mark.parametrize("camera", CAMERAS)
def test_one_photograph_tells_much_more_than_what_is_typical(camera):
    light = CAMERAS[camera]
    truth, typical = log_response(light), log_response(inverse_responses(np.tile(TYPICAL, (3, 1))))
    crf = response_from_edges(photograph(light))
    error = crf_rmse(crf, truth, low=20)
    assert error.max() < 0.2
    assert error.mean() < 0.6 * crf_rmse(typical, truth, low=20).mean()
    assert np.all(np.diff(crf, axis=1) > 0) and np.all(crf[:, 128] == 0)


def test_a_linear_camera_is_found_to_be_nearly_linear():
    crf = response_from_edges(photograph(CAMERAS["linear"]))
    light = np.exp(crf - crf[:, 255:])
    assert np.abs(light - VALUES).max() < 0.03


def test_edge_pixels_lie_on_a_straight_line_in_light_and_beside_it_in_pixel_values():
    light = CAMERAS["power 2.4"]
    image = photograph(light)
    triples, places = edge_triples(image)
    assert len(triples) > 500
    assert np.array_equal(triples[:, 1], image[places[:, 0], places[:, 1]])
    bent, straight = (np.linalg.norm(off_the_line(triples, curves), axis=1) for curves in (CAMERAS["linear"], light))
    assert np.median(straight) < 2
    assert np.median(bent) > 4 * np.median(straight)


def mixtures(light, one, other):
    """Triples of two colours (3,), values 0..255, and what a camera makes of nine mixtures of their light."""
    ends = np.array([[np.interp(v, np.arange(256), light[c]) for c, v in enumerate(colour)] for colour in (one, other)])
    mixed = ends[0] + np.linspace(0.1, 0.9, 9)[:, None] * (ends[1] - ends[0])
    values = np.stack([np.interp(mixed[:, c], light[c], np.arange(256)) for c in range(3)], axis=-1)
    return np.stack([np.tile(one, (9, 1)), values, np.tile(other, (9, 1))], axis=1)


def test_no_edge_tells_the_scale_of_a_channel_or_a_constant_added_to_its_light():
    light = CAMERAS["three powers"]
    triples = mixtures(light, [40.0, 200, 90], [180.0, 60, 120])
    again = light * [[2], [3], [0.5]] + [[0.1], [0.0], [0.7]]
    np.testing.assert_allclose(off_the_line(triples, again), off_the_line(triples, light), atol=1e-9)
    assert np.abs(off_the_line(triples, light**1.5)).max() > 1


def test_a_grey_edge_says_nothing_and_an_edge_of_light_and_shade_nothing_of_a_common_power():
    light = CAMERAS["power 2.4"]
    grey = mixtures(light, [40.0, 40, 40], [200.0, 200, 200])
    shade = mixtures(light, [40.0, 20, 30], [200.0, 100, 150])
    for other in CAMERAS["linear"], CAMERAS["logarithmic"]:
        np.testing.assert_allclose(off_the_line(grey, other), 0, atol=1e-9)
    np.testing.assert_allclose(off_the_line(shade, CAMERAS["linear"]), 0, atol=0.1)
    assert np.abs(off_the_line(shade, CAMERAS["logarithmic"])).max() > 1


def test_a_thin_line_of_a_third_colour_is_no_mixture():
    image = np.full((40, 60, 3), (200, 60, 60), np.uint8)
    image[:, 30:] = 60, 60, 200
    for between, found in ((130, 60, 130), 40), ((130, 180, 130), 0):
        image[:, 30] = between
        assert len(edge_triples(image)[0]) == found


BENT, HUES, SHAPE = CAMERAS["power 2.4"], r"different hue: \d+, at least 30 are needed", r"must be \(H, W, 3\) uint8"
REFUSED = {
    "flat": (photograph(BENT, [[128, 90, 60]]), HUES),
    "grey": (photograph(BENT, [[v, v, v] for v in (30, 80, 130, 180, 230)]), HUES),
    "light and shade": (photograph(BENT, [[v, v / 2, v / 3] for v in (60, 110, 160, 210)]), HUES),
    "tiny": (np.zeros((1, 1, 3), np.uint8), HUES),
    "one channel": (np.zeros((20, 20), np.uint8), SHAPE),
    "fractions": (np.zeros((20, 20, 3)), SHAPE),
}


@pytest.mark.parametrize("image, message", REFUSED.values(), ids=REFUSED.keys())
def test_a_photograph_without_different_hues_is_refused(image, message):
    with pytest.raises(ValueError, match=message):
        response_from_edges(image)
