"""Stage 4: equation 6, and a sensible answer where it divides 0 by 0."""

import cv2
import numpy as np
import pytest

from hdr_helpers.align import align_mtb, crop_common
from hdr_helpers.crf import fitted_weights, hat_weights, recover_crf
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.metrics import radiance_error
from hdr_helpers.load import Bracket, load_bracket
from hdr_helpers.merge import clipping, merge_debevec, merge_opencv, write_hdr
from hdr_helpers.tonemap import luminance

HAT = hat_weights()


def equation_6(images, times, crf, w):
    """The radiance and the sum of weights, in float64, a channel at a time."""
    Z = np.array(images)
    g = np.stack([crf[c][Z[..., c]] for c in range(3)], axis=-1)
    log_times = np.log(times)[:, None, None, None]
    with np.errstate(invalid="ignore"):
        return np.exp((w[Z] * (g - log_times)).sum(axis=0) / w[Z].sum(axis=0)), w[Z].sum(axis=0)


@pytest.mark.parametrize("w", [HAT, hat_weights(17, 250), HAT + 1], ids=["hat", "fitted", "hat+1"])
def test_the_radiance_is_equation_6(small_bracket, w):
    images = [np.minimum(image, 249) for image in small_bracket.images]  # white has a rule of its own
    crf = small_bracket.truth.crf + np.array([[0.5], [0], [-1]])  # channels differ
    expected, weight = equation_6(images, small_bracket.times, crf, w)
    radiance = merge_debevec(images, small_bracket.times, crf, w)
    assert np.mean(weight > 0) > 0.9
    np.testing.assert_allclose(radiance[weight > 0], expected[weight > 0], rtol=1e-5)
    assert radiance.dtype == np.float32


def test_twice_the_times_halves_the_radiance(small_bracket):
    crf = small_bracket.truth.crf
    once, twice = (merge_debevec(small_bracket.images, small_bracket.times * k, crf) for k in (1, 2))
    np.testing.assert_allclose(twice, once / 2, rtol=1e-5)


@pytest.mark.parametrize("w", [None, HAT])
def test_the_order_of_photographs_changes_nothing(w):
    light = np.geomspace(1e-3, 1, 3000).reshape(50, 60, 1) * [1, 0.7, 0.5]
    images = [np.uint8(255 * np.clip(light * t, 0, 1) ** 0.45) for t in (0.05, 0.2, 0.8)]
    crf = np.tile(np.log(np.maximum(np.arange(256), 0.5) / 128) / 0.45, (3, 1))
    forward = merge_debevec(images, (0.05, 0.2, 0.8), crf, w)
    np.testing.assert_allclose(merge_debevec(images[::-1], (0.8, 0.2, 0.05), crf, w), forward, rtol=1e-4)


@pytest.mark.parametrize("dropped", range(5))
def test_dropping_one_exposure_leaves_the_mid_tones_where_they_were(small_bracket, dropped):
    keep = [i for i in range(5) if i != dropped]
    crf, w = small_bracket.truth.crf, hat_weights(0, 250)
    images, times = [small_bracket.images[i] for i in keep], small_bracket.times[keep]
    ratio = merge_debevec(images, times, crf, w) / merge_debevec(small_bracket.images, small_bracket.times, crf, w)
    mid_tones = np.any([(image > 60) & (image < 200) for image in images], axis=0)
    assert np.abs(np.log2(ratio[mid_tones])).max() < 0.25
    assert abs(np.log2(np.median(ratio[mid_tones]))) < 0.02


def test_one_photograph_merges_to_its_own_exposure_over_time(small_bracket):
    image, crf = small_bracket.images[2], small_bracket.truth.crf
    radiance = merge_debevec([image], [0.1], crf)
    np.testing.assert_allclose(radiance[..., 1], np.exp(crf[1][image[..., 1]]) / 0.1, rtol=1e-5)


# ------------------------------------------------------------------------------- nothing is usable


@pytest.mark.parametrize("values, bound", [((0, 0, 0), 2.0), ((255, 255, 255), 0.02)])
def test_clipped_everywhere_gives_the_nearest_bound(values, bound):
    # Black in every exposure: darker than the longest can show. White: brighter than the shortest can.
    crf = np.tile(np.linspace(-6, 3, 256), (3, 1))
    images = [np.full((4, 5, 3), value, np.uint8) for value in values]
    radiance = merge_debevec(images, (0.02, 0.2, 2.0), crf, HAT)
    np.testing.assert_allclose(radiance, np.exp(crf[0][values[0]]) / bound, rtol=1e-2)


def test_the_size_of_all_weights_together_changes_nothing(small_bracket):
    crf, w = small_bracket.truth.crf, fitted_weights(small_bracket.images)
    results = [merge_debevec(small_bracket.images, small_bracket.times, crf, w * size) for size in (1, 1e-6, 1e6)]
    for other in results[1:]:
        np.testing.assert_allclose(other, results[0], rtol=1e-4)


@pytest.mark.parametrize("value, masked, bound", [(255, 0, 0.2), (255, 2, 0.02), (0, 2, 0.2), (0, 0, 2.0)])
def test_where_the_nearest_bound_is_masked_the_next_one_decides(value, masked, bound):
    crf = np.tile(np.linspace(-6, 3, 256), (3, 1))
    images = [np.full((4, 5, 3), value, np.uint8)] * 3
    valid = [np.full((4, 5), k != masked) for k in range(3)]
    radiance = merge_debevec(images, (0.02, 0.2, 2.0), crf, HAT, valid)
    np.testing.assert_allclose(radiance, np.exp(crf[0][value]) / bound, rtol=1e-2)


@pytest.mark.parametrize("w", [None, HAT, HAT + 1])
def test_the_radiance_is_finite_and_positive_whatever_the_values(w):
    extremes = np.array(np.meshgrid(*[[0, 1, 128, 249, 254, 255]] * 3), np.uint8).reshape(3, 1, -1, 1)
    radiance = merge_debevec(extremes.repeat(3, axis=3), (0.01, 0.1, 1), np.linspace([-7] * 3, [4] * 3, 256).T, w)
    assert np.all(np.isfinite(radiance))
    assert np.all(radiance > 0)


@pytest.mark.parametrize("known", [True, False], ids=["true curve", "recovered curve"])
def test_a_sun_clipped_in_every_exposure_stays_the_brightest(known):
    ramp = np.geomspace(2e-4, 0.5, 96 * 96).reshape(96, 96, 1) * [1, 0.8, 0.6]
    inside = np.hypot(*np.mgrid[-48:48, -60:36]) < 9
    scene = np.where(inside[..., None], 1e4, ramp)
    camera, times = Camera(seed=8), np.array([1, 4, 16, 64.0])
    bracket = Bracket(tuple(camera.photograph(scene * t, i) for i, t in enumerate(times)), times, tuple("abcd"))
    crf = camera.crf() if known else recover_crf(bracket).crf
    radiance = merge_debevec(bracket.images, times, crf)
    away = cv2.dilate(inside.astype(np.uint8), np.ones((17, 17))) == 0  # beyond what JPEG smears over the edge
    assert np.all(radiance[inside].min(axis=0) > radiance[away].max(axis=0))


# ----------------------------------------------------------------------- against truth and OpenCV


def test_the_chapel_is_at_least_as_near_to_truth_as_opencvs(chapel):
    ours = merge_debevec(chapel.images, chapel.times, recover_crf(chapel).crf)
    bgr, times = [np.ascontiguousarray(i[..., ::-1]) for i in chapel.images], chapel.times.astype(np.float32)
    response = cv2.createCalibrateDebevec().process(bgr, times)
    theirs = cv2.createMergeDebevec().process(bgr, times, response)[..., ::-1]
    ours, theirs = (radiance_error(radiance, chapel.truth.radiance) for radiance in (ours, theirs))
    assert ours.median <= theirs.median
    assert ours.p95 <= theirs.p95
    assert ours.median < 0.04


@pytest.mark.parametrize("times_type", [np.float32, np.float64, list])
def test_merge_opencv_is_opencvs_own_whatever_the_type_of_times(small_bracket, times_type):
    bgr = [np.ascontiguousarray(image[..., ::-1]) for image in small_bracket.images]
    response = np.exp(small_bracket.truth.crf[::-1].T)[:, None].astype(np.float32)
    expected = cv2.createMergeDebevec().process(bgr, small_bracket.times.astype(np.float32), response.copy())
    times = list(small_bracket.times) if times_type is list else small_bracket.times.astype(times_type)
    ours = merge_opencv(small_bracket.images, times, small_bracket.truth.crf)
    np.testing.assert_allclose(ours, expected[..., ::-1], rtol=1e-5)


def test_merge_opencv_without_a_curve_is_opencvs_linear_one(small_bracket):
    bgr = [np.ascontiguousarray(image[..., ::-1]) for image in small_bracket.images]
    expected = cv2.createMergeDebevec().process(bgr, small_bracket.times.astype(np.float32))
    np.testing.assert_allclose(merge_opencv(small_bracket.images, small_bracket.times), expected[..., ::-1], rtol=1e-5)


def test_the_memorial_agrees_with_its_published_radiance_map(real):
    reference = cv2.imread(str(real("memorial") / "reference.hdr"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    bracket = load_bracket(real("memorial"))
    aligned = align_mtb(bracket.images)
    images = crop_common(aligned.images, aligned.shifts)
    crf = recover_crf(Bracket(images, bracket.times, bracket.names)).crf
    ours, theirs = luminance(merge_debevec(images, bracket.times, crf)), luminance(reference)
    valid = theirs > 0
    assert np.corrcoef(np.log(ours[valid]), np.log(theirs[valid]))[0, 1] >= 0.99


# ------------------------------------------------------------------------------ clipping and files


def test_clipping_counts_a_pixel_when_one_channel_is_lost():
    images = [np.full((10, 20, 3), value, np.uint8) for value in (90, 120)]
    images[0][0, :3, 1] = 0
    images[0][1, 0] = 255
    for image in images:
        image[5, :10, 2], image[6, :5] = 255, 0
    shares = clipping(images)
    np.testing.assert_allclose(shares.too_dark, [8 / 200, 5 / 200])
    np.testing.assert_allclose(shares.too_bright, [11 / 200, 10 / 200])
    assert (shares.everywhere_dark, shares.everywhere_bright) == (5 / 200, 10 / 200)


def test_an_hdr_file_reads_back_within_rgbes_precision(tmp_path):
    rng = np.random.default_rng(3)
    radiance = np.exp(rng.uniform(-9, 9, (40, 50, 1)) + rng.uniform(-1, 1, (40, 50, 3))).astype(np.float32)
    write_hdr(tmp_path / "map.hdr", radiance)
    read = cv2.imread(str(tmp_path / "map.hdr"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    assert np.all(np.abs(read - radiance) <= radiance.max(axis=2, keepdims=True) / 128)
    assert [path.name for path in tmp_path.iterdir()] == ["map.hdr"]  # no .part is left


def test_an_hdr_file_that_can_not_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    (tmp_path / "map.hdr").write_bytes(b"old")
    monkeypatch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(OSError("the disk is gone")))
    with pytest.raises(OSError, match="the disk is gone"):
        write_hdr(tmp_path / "map.hdr", np.ones((4, 4, 3)))
    assert (tmp_path / "map.hdr").read_bytes() == b"old"


@pytest.mark.parametrize(
    "change, message",
    [
        ({"times": (1,)}, "got 1 for 2"),
        ({"times": (1, 0)}, "positive seconds"),
        ({"times": (1, np.nan)}, "positive seconds"),
        ({"images": []}, "got 2 for 0"),
        ({"images": [np.zeros((4, 5, 3), np.uint8), np.zeros((5, 4, 3), np.uint8)]}, r"one size.*\(5, 4, 3\)"),
        ({"images": [np.zeros((4, 5, 3))] * 2}, "uint8.*float64"),
        ({"crf": np.zeros((256, 3))}, r"crf must be \(3, 256\) and finite; got \(256, 3\)"),
        ({"crf": np.full((3, 256), np.nan)}, "finite"),
        ({"w": np.ones(255)}, "256 weights"),
        ({"w": -np.ones(256)}, "none negative"),
        ({"w": np.zeros(256)}, "not all 0"),
    ],
)
def test_merging_refuses_what_does_not_fit(change, message):
    images = [np.full((4, 5, 3), value, np.uint8) for value in (90, 120)]
    with pytest.raises(ValueError, match=message):
        merge_debevec(**({"images": images, "times": (1, 2), "crf": np.zeros((3, 256))} | change))
