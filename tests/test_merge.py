"""Stage 4: equation 6, and a sensible answer where it divides 0 by 0."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from hdr_helpers._merging import tables
from hdr_helpers._merging.noise import exposure_variance, frayed_white
from hdr_helpers.align import align_mtb, crop_bracket, crop_common
from hdr_helpers.crf import crf_opencv, fitted_weights, hat_weights, joint_histograms, recover_crf, whole_white
from hdr_helpers.lab.bound import best_possible
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.metrics import held_out, psnr_l, psnr_mu, radiance_error
from hdr_helpers.lab.scenes import random_scene
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
    radiance = merge_debevec(images, small_bracket.times, crf, w).radiance
    assert np.mean(weight > 0) > 0.9
    np.testing.assert_allclose(radiance[weight > 0], expected[weight > 0], rtol=1e-5)
    assert radiance.dtype == np.float32


def test_twice_the_times_halves_the_radiance(small_bracket):
    crf = small_bracket.truth.crf
    once, twice = (merge_debevec(small_bracket.images, small_bracket.times * k, crf).radiance for k in (1, 2))
    np.testing.assert_allclose(twice, once / 2, rtol=1e-5)


@pytest.mark.parametrize("w", [None, HAT])
def test_the_order_of_photographs_changes_nothing(w):
    light = np.geomspace(1e-3, 1, 3000).reshape(50, 60, 1) * [1, 0.7, 0.5]
    images = [np.uint8(255 * np.clip(light * t, 0, 1) ** 0.45) for t in (0.05, 0.2, 0.8)]
    crf = np.tile(np.log(np.maximum(np.arange(256), 0.5) / 128) / 0.45, (3, 1))
    forward = merge_debevec(images, (0.05, 0.2, 0.8), crf, w).radiance
    np.testing.assert_allclose(merge_debevec(images[::-1], (0.8, 0.2, 0.05), crf, w).radiance, forward, rtol=1e-4)


@pytest.mark.parametrize("dropped", range(5))
def test_dropping_one_exposure_leaves_the_mid_tones_where_they_were(small_bracket, dropped):
    keep = [i for i in range(5) if i != dropped]
    crf, w = small_bracket.truth.crf, hat_weights(0, 250)
    images, times = [small_bracket.images[i] for i in keep], small_bracket.times[keep]
    ratio = (
        merge_debevec(images, times, crf, w).radiance
        / merge_debevec(small_bracket.images, small_bracket.times, crf, w).radiance
    )
    mid_tones = np.any([(image > 60) & (image < 200) for image in images], axis=0)
    assert np.abs(np.log2(ratio[mid_tones])).max() < 0.25
    assert abs(np.log2(np.median(ratio[mid_tones]))) < 0.02


def test_one_photograph_merges_to_its_own_exposure_over_time(small_bracket):
    image, crf = small_bracket.images[2], small_bracket.truth.crf
    radiance = merge_debevec([image], [0.1], crf).radiance
    np.testing.assert_allclose(radiance[..., 1], np.exp(crf[1][image[..., 1]]) / 0.1, rtol=1e-5)


# ------------------------------------------------------------------------------- nothing is usable


@pytest.mark.parametrize("values, bound", [((0, 0, 0), 2.0), ((255, 255, 255), 0.02)])
def test_clipped_everywhere_gives_the_nearest_bound(values, bound):
    # Black in every exposure: darker than the longest can show. White: brighter than the shortest can.
    crf = np.tile(np.linspace(-6, 3, 256), (3, 1))
    images = [np.full((4, 5, 3), value, np.uint8) for value in values]
    radiance = merge_debevec(images, (0.02, 0.2, 2.0), crf, HAT).radiance
    np.testing.assert_allclose(radiance, np.exp(crf[0][values[0]]) / bound, rtol=1e-2)


def test_the_size_of_all_weights_together_changes_nothing(small_bracket):
    crf, w = small_bracket.truth.crf, fitted_weights(small_bracket.images)
    results = [
        merge_debevec(small_bracket.images, small_bracket.times, crf, w * size).radiance for size in (1, 1e-6, 1e6)
    ]
    for other in results[1:]:
        np.testing.assert_allclose(other, results[0], rtol=1e-4)


@pytest.mark.parametrize("value, masked, bound", [(255, 0, 0.2), (255, 2, 0.02), (0, 2, 0.2), (0, 0, 2.0)])
def test_where_the_nearest_bound_is_masked_the_next_one_decides(value, masked, bound):
    crf = np.tile(np.linspace(-6, 3, 256), (3, 1))
    images = [np.full((4, 5, 3), value, np.uint8)] * 3
    valid = [np.full((4, 5), k != masked) for k in range(3)]
    radiance = merge_debevec(images, (0.02, 0.2, 2.0), crf, HAT, valid).radiance
    np.testing.assert_allclose(radiance, np.exp(crf[0][value]) / bound, rtol=1e-2)


@pytest.mark.parametrize("w", [None, HAT, HAT + 1])
def test_the_radiance_is_finite_and_positive_whatever_the_values(w):
    extremes = np.array(np.meshgrid(*[[0, 1, 128, 249, 254, 255]] * 3), np.uint8).reshape(3, 1, -1, 1)
    radiance = merge_debevec(
        extremes.repeat(3, axis=3), (0.01, 0.1, 1), np.linspace([-7] * 3, [4] * 3, 256).T, w
    ).radiance
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
    radiance = merge_debevec(bracket.images, times, crf).radiance
    away = cv2.dilate(inside.astype(np.uint8), np.ones((17, 17))) == 0  # beyond what JPEG smears over the edge
    assert np.all(radiance[inside].min(axis=0) > radiance[away].max(axis=0))


# ----------------------------------------------------------------------- against truth and OpenCV


def test_the_chapel_is_at_least_as_near_to_truth_as_opencvs(chapel):
    ours = merge_debevec(chapel.images, chapel.times, recover_crf(chapel).crf).radiance
    bgr, times = [np.ascontiguousarray(i[..., ::-1]) for i in chapel.images], chapel.times.astype(np.float32)
    response = cv2.createCalibrateDebevec().process(bgr, times)
    theirs = cv2.createMergeDebevec().process(bgr, times, response)[..., ::-1]
    ours, theirs = (radiance_error(radiance, chapel.truth.radiance) for radiance in (ours, theirs))
    assert ours.median <= theirs.median
    assert ours.p95 <= theirs.p95
    assert ours.median < 0.04


CONDITIONS = {"light": {}, "low light": {"full_well": 2000.0, "read_noise": 10.0}}
TIMES = {16: 2.0 ** np.arange(-10, 6), 4: np.array([1 / 30, 1 / 4, 2.5, 15])}


@cache
def shot(condition, count, jpeg=None, seed=2):
    """A camera and its bracket of a scene with 18.5 stops."""
    camera = Camera(jpeg_quality=jpeg, non_uniformity=0.0, **CONDITIONS[condition])
    return camera, camera.shoot(random_scene(seed), TIMES[count])


@pytest.mark.parametrize("curve", ["true", "recovered"])
@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("count", TIMES)
def test_weights_by_noise_come_within_a_third_of_a_decibel_of_the_best_possible(condition, count, curve):
    camera, bracket = shot(condition, count)
    truth = bracket.truth.radiance
    crf = bracket.truth.crf if curve == "true" else recover_crf(bracket).crf
    best = psnr_mu(best_possible(camera, truth, bracket.times), truth)
    noise = psnr_mu(merge_debevec(bracket.images, bracket.times, crf).radiance, truth)
    hat = psnr_mu(merge_debevec(bracket.images, bracket.times, crf, fitted_weights(bracket.images)).radiance, truth)
    assert best - 0.3 < noise < best + 0.3
    assert hat < noise - 1


@pytest.mark.parametrize("count", TIMES)
def test_with_jpeg_weights_by_noise_stay_ahead_of_the_hat_and_above_51_decibel(count):
    _, bracket = shot("light", count, 95)
    truth, crf = bracket.truth.radiance, recover_crf(bracket).crf
    noise = merge_debevec(bracket.images, bracket.times, crf)
    hat = merge_debevec(bracket.images, bracket.times, crf, hat_weights())
    opencv = merge_opencv(bracket.images, bracket.times, crf_opencv(bracket))
    assert psnr_mu(noise.radiance, truth) > max(51, psnr_mu(hat.radiance, truth), psnr_mu(opencv, truth))
    assert psnr_l(noise.radiance, truth) > psnr_l(opencv, truth)
    assert "clipped pixels that are not quite white" in noise.weighting


def test_the_noise_of_the_camera_is_found_from_its_photographs():
    camera, bracket = shot("light", 16)
    joints = joint_histograms(bracket.images, [None] * 16, [(k, k + 1) for k in range(15)])
    crf = bracket.truth.crf
    exposure = np.exp(crf - crf[:, -1:])
    found = exposure_variance(joints, bracket.log_times, crf) * np.exp(-2 * crf[:, -1:])
    rounding = np.gradient(exposure, axis=1) ** 2 / 12
    expected = exposure / camera.full_well + (camera.read_noise / camera.full_well) ** 2 + rounding
    np.testing.assert_allclose(found[:, 5:], expected[:, 5:], rtol=0.15)


def test_only_jpeg_frays_white():
    for jpeg, frayed in ((None, False), (95, True), (85, True)):
        _, bracket = shot("light", 4, jpeg)
        joints = joint_histograms(bracket.images, [None] * 4, [(0, 1), (1, 2), (2, 3)])
        assert frayed_white(joints, bracket.log_times, bracket.truth.crf) == frayed


@pytest.mark.parametrize("mean", ["log", "linear", "log1p"])
def test_every_mean_finds_light_without_noise(mean):
    light = np.geomspace(1e-3, 1, 3000).reshape(50, 60, 1) * [1, 0.7, 0.5]
    times, deep = np.array([0.05, 0.2, 0.8]), np.iinfo(np.uint16).max
    images = [np.uint16(np.rint(deep * np.clip(light * t, 0, 1) ** 0.45)) for t in times]
    crf = np.tile(np.log(np.maximum(np.arange(256), 0.25) / 128) / 0.45, (3, 1))
    for w in (None, hat_weights(10, 250)):
        radiance = merge_debevec(images, times, crf, w, mean=mean).radiance
        ratio = radiance / light
        assert np.abs(np.log2(ratio / np.median(ratio)))[light.max(axis=2) > 0.01].max() < 0.03


def test_a_logarithmic_mean_of_noise_is_too_dark_and_a_linear_one_is_not():
    rng = np.random.default_rng(0)
    noisy = [np.uint8(np.clip(np.rint(20 + 8 * rng.standard_normal((200, 300, 3))), 1, 255)) for _ in range(2)]
    crf = np.tile(np.log(np.maximum(np.arange(256), 0.25)), (3, 1))  # a linear camera
    w, times = np.ones(256), (1.0, 1.0)
    linear, log = (merge_debevec(noisy, times, crf, w, mean=mean).radiance.mean() for mean in ("linear", "log"))
    assert linear == pytest.approx(np.mean(noisy), rel=1e-3)
    assert log < 0.98 * linear


def test_tiles_masks_and_white_give_what_a_plain_float64_implementation_gives(monkeypatch):
    rng = np.random.default_rng(1)
    images = [np.uint8(np.clip(cv2.GaussianBlur(rng.uniform(0, 255, (90, 130, 3)), (0, 0), 4) * f - 60 * f, 0, 255))
              for f in (0.8, 1.6, 3.0, 6.0, 12.0)]  # fmt: skip
    times, crf = np.array([1, 2, 4, 8, 16.0]), np.linspace([-5, -6, -4], [2, 3, 2.5], 256).T
    valid = [rng.random((90, 130)) < 0.9 for _ in images]
    valid[0][:40] = True
    w = rng.uniform(0.1, 3, (5, 3, 256))
    monkeypatch.setattr(tables, "TILE", (32, 48))
    for masks, settle in ((None, False), (valid, False), (None, True), (valid, True)):
        said = (crf - np.log(times)[:, None, None]).transpose(0, 2, 1)
        result, *_ = tables.mean_by_tables(
            images, said, w.transpose(0, 2, 1), lambda mean: np.exp(mean, out=mean), masks, settle
        )
        keep = masks or [None] * 5
        white = [image if not (settle and k) else whole_white(image, keep[k]) for k, image in enumerate(images)]
        total, mean = np.zeros((90, 130, 3)), np.zeros((90, 130, 3))
        for k, image in enumerate(white):
            for c in range(3):
                weight = w[k, c][image[..., c]] * (1 if masks is None else masks[k])
                total[..., c] += weight
                mean[..., c] += weight * (crf[c][image[..., c]] - np.log(times[k]))
        expected = np.exp(mean[total > 0] / total[total > 0])
        np.testing.assert_allclose(result[total > 0], expected, rtol=1e-5)


def test_what_was_clipped_or_black_in_every_photograph_is_counted():
    images = [np.full((70, 90, 3), value, np.uint8) for value in (90, 140)]
    for image in images:
        image[3, :7] = 255
        image[5, :4, 1] = 0
    merged = merge_debevec(images, (1, 2), np.tile(np.linspace(-6, 3, 256), (3, 1)), HAT)
    assert (merged.too_bright, merged.too_dark) == (7, 4)


def test_a_photograph_is_predicted_from_the_others(chapel):
    def merge(rest):
        crf = recover_crf(rest).crf
        return merge_debevec(rest.images, rest.times, crf).radiance, crf

    _, missed = held_out(chapel, 4, merge)
    assert np.isfinite(missed).mean() > 0.7
    assert np.nanmedian(np.abs(missed)) < 2  # pixel values; noise and JPEG alone make more than 1
    wrong = replace(chapel, times=np.where(np.arange(9) == 4, 1.3 * chapel.times, chapel.times))
    assert abs(np.nanmedian(held_out(wrong, 4, merge)[1])) > 4 * abs(np.nanmedian(missed))


@pytest.mark.parametrize("name", ["exposures", "frobisher", "memorial", "window"])
def test_a_real_photograph_is_predicted_from_the_others(real, name):
    bracket = load_bracket(real(name))
    aligned = crop_bracket(bracket, align_mtb(bracket.images, valid=bracket.valid))

    def merge(rest):
        crf = recover_crf(rest).crf
        return merge_debevec(rest.images, rest.times, crf, valid=rest.valid).radiance, crf

    _, missed = held_out(aligned, len(aligned) // 2, merge)
    assert np.isfinite(missed).mean() > 0.3
    assert np.nanmedian(np.abs(missed)) < 6  # pixel values


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
    ours, theirs = luminance(merge_debevec(images, bracket.times, crf).radiance), luminance(reference)
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
    "name, radiance, message",
    [
        ("map.png", np.ones((4, 5, 3)), r"map.png: this OpenCV writes radiance maps as \.hdr"),
        ("map.hdr", np.ones((4, 5)), r"\(H, W, 3\), finite and not negative; got shape \(4, 5\)"),
        ("map.hdr", np.full((4, 5, 3), np.inf), "finite"),
        ("map.hdr", -np.ones((4, 5, 3)), "not negative"),
    ],
)
def test_a_radiance_map_that_can_not_be_stored_is_refused_and_nothing_is_written(tmp_path, name, radiance, message):
    with pytest.raises(ValueError, match=message):
        write_hdr(tmp_path / name, radiance)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not cv2.haveImageWriter("map.exr"), reason="this OpenCV was built without OpenEXR")
def test_an_exr_file_reads_back_exactly(tmp_path):
    radiance = np.exp(np.random.default_rng(3).uniform(-9, 9, (40, 50, 3))).astype(np.float32)
    write_hdr(tmp_path / "map.exr", radiance)
    assert np.array_equal(cv2.imread(str(tmp_path / "map.exr"), cv2.IMREAD_UNCHANGED)[..., ::-1], radiance)


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
        ({"w": np.ones((5, 3, 256))}, r"\(P, 3, 256\); got shape \(5, 3, 256\)"),
        ({"w": np.zeros(256)}, "not all 0"),
        ({"mean": "median"}, "mean must be one of log, linear, log1p; got 'median'"),
    ],
)
def test_merging_refuses_what_does_not_fit(change, message):
    images = [np.full((4, 5, 3), value, np.uint8) for value in (90, 120)]
    with pytest.raises(ValueError, match=message):
        merge_debevec(**({"images": images, "times": (1, 2), "crf": np.zeros((3, 256))} | change))
