"""Ghosts: what moves is in the merge once, where the reference has it; what stands still is left alone."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from hdr_helpers.align import align_mtb, crop_bracket, remove_ghosts
from hdr_helpers.lab import data
from hdr_helpers.lab.brackets import HANDHELD_TIMES, shoot_handheld
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.metrics import moving_error
from hdr_helpers.lab.scenes import cloister_scene, random_scene
from hdr_helpers.load import load_bracket
from hdr_helpers.merge import merge_debevec
from hdr_helpers.papers.kang2003 import register_locally

TIMES = [float(t) for t in HANDHELD_TIMES]


def merged(bracket, crf):
    return merge_debevec(bracket.images, bracket.times, crf, valid=bracket.valid).radiance


@pytest.fixture(scope="module")
def handheld():
    bracket = data.handheld()
    return crop_bracket(bracket, align_mtb(bracket.images))


def wanderer(seed, camera=None):
    """A patterned disc, as bright as the middle of a random scene, that wanders while five photographs are shot."""
    scene, rng = random_scene(seed, (300, 420), stops=12), np.random.default_rng(seed)
    pattern = np.exp(0.6 * cv2.GaussianBlur(rng.standard_normal(scene.shape), (0, 0), 3) * 8).astype(np.float32)
    moments = []
    for k in range(5):
        disc = cv2.circle(np.zeros(scene.shape[:2], np.uint8), (90 + 55 * k, 150 - 12 * k), 34, 1, -1) > 0
        body = np.roll(pattern, (-12 * k, 55 * k), axis=(0, 1)) * np.exp(np.log(scene).mean())
        moments.append(np.where(disc[..., None], body, scene))
    return (camera or Camera(seed=seed)).shoot(moments, TIMES, moment=0)


def test_where_monks_walk_the_error_falls_more_than_ninefold(handheld):
    ghosts = remove_ghosts(handheld)
    assert ghosts.reference == 0  # the one in whose moment the truth is, chosen because it is white nowhere
    before, after = (moving_error(merged(b, handheld.truth.crf), handheld.truth) for b in (handheld, ghosts.bracket))
    assert after.moving < before.moving / 9
    assert after.still == pytest.approx(before.still, rel=0.01)


def test_an_error_also_falls_eightfold_with_other_noise_on_a_tripod_and_in_another_order():
    camera = Camera(seed=77)
    for order in (0, 1, 2, 3, 4), (2, 0, 4, 1, 3):
        bracket = camera.shoot([cloister_scene()[k] for k in order], TIMES, moment=0)
        ghosts = remove_ghosts(bracket, 0)
        before, after = (moving_error(merged(b, bracket.truth.crf), bracket.truth) for b in (bracket, ghosts.bracket))
        assert after.moving < before.moving / 8


@pytest.mark.parametrize("seed", range(4))
def test_in_scenes_nobody_has_seen_the_error_falls_at_least_fivefold(seed):
    bracket = wanderer(seed)
    ghosts = remove_ghosts(bracket, 0)
    before, after = (moving_error(merged(b, bracket.truth.crf), bracket.truth) for b in (bracket, ghosts.bracket))
    assert after.moving < before.moving / 5
    assert after.still < before.still * 1.05


@pytest.mark.parametrize("reference", range(5))
def test_things_are_where_the_reference_has_them(reference):
    moments, camera = cloister_scene(), Camera(seed=5)
    bracket = camera.shoot(moments, TIMES, moment=reference)
    ghosts = remove_ghosts(bracket, reference)
    assert ghosts.reference == reference
    assert np.array_equal(ghosts.bracket.images[reference], bracket.images[reference])
    assert np.all(ghosts.bracket.valid[reference])
    radiance = merged(ghosts.bracket, bracket.truth.crf)
    errors = [
        moving_error(radiance, replace(bracket.truth, radiance=np.asarray(moment, np.float32))).moving
        for moment in moments
    ]
    assert np.argmin(errors) == reference


def test_where_nothing_moves_nothing_is_touched(chapel):
    still = Camera(seed=9).shoot(cloister_scene()[2], TIMES)
    for bracket in (chapel, still):
        ghosts = remove_ghosts(bracket)
        assert not ghosts.moved.any()
        assert all(a is b for a, b in zip(ghosts.bracket.images, bracket.images, strict=True))
        assert all(mask.all() for mask in ghosts.bracket.valid)
        assert ghosts.reference == len(bracket) // 2


def test_only_what_moved_loses_its_say(handheld):
    ghosts = remove_ghosts(handheld)
    near = cv2.dilate(handheld.truth.moved.view(np.uint8), np.ones((15, 15))) > 0
    lost = ~np.logical_and.reduce(ghosts.bracket.valid)
    assert np.mean(lost & ~near) < 0.002
    for image, mask, before in zip(ghosts.bracket.images, ghosts.bracket.valid, handheld.images, strict=True):
        changed = np.any(image != before, axis=2)
        assert np.all(mask[changed])  # what was warped was warped in order to speak
        assert np.mean(changed & ~near) < 0.001


def test_sixteen_bits_are_judged_like_eight(handheld):
    deep = replace(handheld, images=tuple(image.astype(np.uint16) * 257 for image in handheld.images))
    found, plain = remove_ghosts(deep), remove_ghosts(handheld)
    assert found.reference == plain.reference
    for a, b in zip(found.bracket.valid, plain.bracket.valid, strict=True):
        assert np.mean(a != b) < 1e-3
    assert all(image.dtype == np.uint16 for image in found.bracket.images)


def test_what_was_not_valid_stays_so_and_has_no_influence(handheld):
    valid = [np.ones(handheld.images[0].shape[:2], bool) for _ in handheld.images]
    for mask in valid:
        mask[:40] = False
    noise = np.random.default_rng(0).integers(0, 256, (40, *handheld.images[0].shape[1:])).astype(np.uint8)
    images = [image.copy() for image in handheld.images]
    for k, image in enumerate(images):
        image[:40] = np.roll(noise, k * 7, axis=1)
    _, masks = register_locally(images, 1, valid)
    assert not any(mask[:40].any() for mask in masks)
    assert np.mean([mask[60:120].mean() for mask in masks]) > 0.99


def test_the_input_is_not_changed(handheld):
    before = [image.copy() for image in handheld.images]
    register_locally(handheld.images, 2)
    assert all(np.array_equal(a, b) for a, b in zip(before, handheld.images, strict=True))


def test_a_photograph_that_has_nothing_in_its_place_has_no_say():
    images = list(Camera(seed=1).shoot(cloister_scene()[0], TIMES[1:4]).images)
    images[2] = 255 - images[2][::-1, ::-1]
    _, masks = register_locally(images, 1)
    assert masks[0].all()
    assert masks[1].all()
    assert not masks[2].any()


@pytest.mark.parametrize("size", [(1, 1), (3, 16), (15, 15), (40, 20)])
@pytest.mark.parametrize("values", [(10, 100, 200), (0, 0, 0), (255, 255, 255), (0, 255, 0)])
def test_tiny_and_constant_pictures_are_no_problem(size, values):
    images = [np.full((*size, 3), value, np.uint8) for value in values]
    registered, masks = register_locally(images, 1)
    assert masks[1].all()
    assert all(np.array_equal(a, b) for a, b in zip(registered, images, strict=True))


def test_bad_input_is_refused_in_a_sentence(handheld):
    with pytest.raises(ValueError, match="0 to 4; got 5"):
        register_locally(handheld.images, 5)
    with pytest.raises(ValueError, match="one size and one type"):
        register_locally([handheld.images[0], handheld.images[1][:-1]], 0)
    with pytest.raises(ValueError, match="uint8 or uint16"):
        register_locally([image / 255 for image in handheld.images], 0)
    with pytest.raises(ValueError, match="one mask of"):
        register_locally(handheld.images, 0, [np.ones((3, 3), bool)] * 5)


def test_another_camera_and_seed_give_the_same_picture_of_the_cloister():
    bracket = shoot_handheld(Camera(seed=4, response=((2.2, 30.0, 0.3), (2.2, 30.0, 0.3), (2.2, 30.0, 0.3))))
    aligned = crop_bracket(bracket, align_mtb(bracket.images))
    ghosts = remove_ghosts(aligned)
    before, after = (moving_error(merged(b, aligned.truth.crf), aligned.truth) for b in (aligned, ghosts.bracket))
    assert after.moving < before.moving / 8


# ---------------------------------------------------------------------------------- real cameras


def test_the_man_with_the_racket_is_one_man(real):
    bracket = load_bracket(real("pingpong"))
    aligned = crop_bracket(bracket, align_mtb(bracket.images))
    ghosts = remove_ghosts(aligned)
    # The racket is held low in the middle photograph alone, and high in the first.
    low, high = np.s_[900:980, 470:580], np.s_[150:280, 400:560]
    assert ghosts.reference == 1
    for k, where in ((0, low), (2, low), (0, high)):
        assert ghosts.bracket.valid[k][where].mean() < 0.1
    assert 0.1 < ghosts.moved.mean() < 0.5
    assert any(np.any(a != b) for a, b in zip(ghosts.bracket.images, aligned.images, strict=True))  # flow found some


def test_real_tripod_sets_are_hardly_touched(real):
    for name, most in (("window", 0.1), ("frobisher", 0.02), ("memorial", 0.1)):
        bracket = load_bracket(real(name))
        assert remove_ghosts(bracket).moved.mean() < most, name
