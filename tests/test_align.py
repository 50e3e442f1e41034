"""Stage 2: shifts and turns that are known come back, and what can't be known is said to be doubtful."""

from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest

from hdr_helpers._registering.correlation import correlated_shifts
from hdr_helpers._registering.motion import common_part, fit_motion
from hdr_helpers.align import Motion, align_mtb, bitmaps, crop_bracket, crop_common, move_image
from hdr_helpers.lab.brackets import CHAPEL_TIMES, HANDHELD_ROTATIONS, HANDHELD_SHIFTS
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.data import handheld
from hdr_helpers.lab.metrics import misplacement, radiance_error
from hdr_helpers.lab.scenes import chapel_scene, random_scene
from hdr_helpers.load import load_bracket
from hdr_helpers.merge import merge_debevec
from hdr_helpers.papers.ward2003 import disagreement, likely_shifts, overlap

SIXTEEN = 2.0 ** np.arange(16)  # one stop apart
FOUR = np.array([1 / 30, 0.25, 2.5, 15])


def random_bracket(seed, times, reach, turn=0.0, size=(384, 512)):
    """A scene nobody has seen, shot from the hand: shifts up to reach pixels, turns up to turn degrees."""
    rng = np.random.default_rng((seed, 41))
    margin = reach + int(np.ceil(Motion(degrees=turn).reach([n + 2 * reach + 20 for n in size])))
    scene = random_scene(seed, tuple(n + 2 * margin for n in size))
    if not turn:
        return Camera(seed=seed).shoot(scene, times, rng.integers(-reach, reach + 1, (len(times), 2)))
    turns = rng.uniform(-turn, turn, len(times))
    return Camera(seed=seed).shoot(scene, times, rng.uniform(-reach, reach, (len(times), 2)), turns)


# Under seed 1 OpenCV's AlignMTB moves the darkest photograph by (43, -9) where (-9, -8) is right.
@pytest.mark.parametrize("seed", [1, 2])
def test_known_shifts_are_recovered_exactly(seed):
    moves = np.random.default_rng(seed).integers(-20, 21, (9, 2))
    found = align_mtb(Camera(seed=seed).shoot(chapel_scene(), CHAPEL_TIMES, moves).images)
    assert np.array_equal(found.shifts, moves[found.reference] - moves)
    assert not found.rotations.any()
    assert not found.doubtful.any()


@pytest.mark.parametrize("reach, seeds", [(20, (0, 1, 2)), (50, (3, 4))])
def test_of_sixteen_exposures_none_is_misplaced_without_being_reported(reach, seeds):
    misplaced = 0
    for seed in seeds:
        bracket = random_bracket(seed, SIXTEEN, reach)
        found = align_mtb(bracket.images)
        off = misplacement(bracket, found) > 1
        assert not np.any(off & ~found.doubtful)
        misplaced += off.sum()
    assert misplaced <= 2 * len(seeds)  # the nearly white ones, in which there is next to nothing to see


@pytest.mark.parametrize("seed", range(4))
def test_of_four_exposures_all_are_where_they_belong(seed):
    bracket = random_bracket(seed, FOUR, 20)
    found = align_mtb(bracket.images)
    assert not found.doubtful.any()
    assert misplacement(bracket, found).max() == 0


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_turns_up_to_half_a_degree_are_found_and_removed(seed):
    bracket = random_bracket(seed, FOUR, 15, turn=0.5)
    found = align_mtb(bracket.images)
    expected = bracket.truth.rotations[found.reference] - bracket.truth.rotations
    np.testing.assert_allclose(found.rotations, expected, atol=0.05)
    assert not found.doubtful.any()
    assert misplacement(bracket, found).max() < 0.8
    assert misplacement(bracket, replace(found, rotations=0 * found.rotations)).max() > 1  # it mattered


def test_the_hand_held_bracket_is_registered_to_a_fraction_of_a_pixel_though_monks_walk_through_it():
    bracket = handheld()
    found = align_mtb(bracket.images)
    known = [Motion(*shift, turn).inverse() for shift, turn in zip(HANDHELD_SHIFTS, HANDHELD_ROTATIONS, strict=True)]
    np.testing.assert_allclose(found.shifts, [(m.dx, m.dy) for m in known], atol=0.15)
    np.testing.assert_allclose(found.rotations, [m.degrees for m in known], atol=0.02)
    assert not found.doubtful.any()


def test_no_curve_over_the_pixel_values_changes_the_answer():
    bracket = random_bracket(5, FOUR, 20)
    curve = np.rint(255 * (np.arange(256) / 255) ** 0.6).astype(np.uint8)
    plain, curved = align_mtb(bracket.images), align_mtb([cv2.LUT(image, curve) for image in bracket.images])
    assert np.array_equal(plain.shifts, curved.shifts)


def test_a_photograph_that_is_lost_does_not_break_the_chain():
    moves = np.random.default_rng(3).integers(-12, 13, (7, 2))
    bracket = Camera(seed=3).shoot(chapel_scene()[:400, :600], CHAPEL_TIMES[2:], moves)
    images = list(bracket.images)
    images[5] = np.random.default_rng(0).integers(0, 256, images[5].shape).astype(np.uint8)  # no photograph at all
    found = align_mtb(images)
    assert found.doubtful.tolist() == [False] * 5 + [True, False]
    assert found.matches[6].partner == 4
    others = [0, 1, 2, 3, 4, 6]
    assert np.array_equal(found.shifts[others], (moves[3] - moves)[others])
    assert np.array_equal(found.shifts[5], found.shifts[4])  # left beside its neighbour, not guessed
    assert "blocks agree" in found.doubt(5)
    assert not any(found.doubt(k) for k in others)


def test_every_match_says_how_sure_it_is():
    bracket = random_bracket(1, SIXTEEN, 20)
    found = align_mtb(bracket.images)
    assert found.matches[found.reference] is None
    for k, match in enumerate(found.matches):
        if match is not None:
            assert match.trusted == (not found.doubtful[k]) == (match.chance <= 1e-4)
            assert 0 <= match.agree <= match.blocks
    assert {match.percentile for match in found.matches if match} > {50}  # the median does not always do


def test_a_turn_that_a_photograph_can_not_tell_makes_it_doubtful_if_the_hand_turned_and_only_then():
    untold = {}
    for turn in 0.0, 0.5:
        found = align_mtb(random_bracket(2, SIXTEEN, 15, turn).images)
        assert bool(found.rotations.any()) == bool(turn)
        told = [match is None or match.turn_known or not match.trusted for match in found.matches]
        untold[turn] = np.flatnonzero(np.logical_not(told))
        assert np.all(found.doubtful[untold[turn]] == bool(turn))
        assert all(("turn" in found.doubt(k)) == bool(turn) for k in untold[turn])
    assert all(len(which) for which in untold.values())  # there are such photographs, nearly white ones


def test_pictures_of_different_scenes_are_never_believed_to_lie_on_each_other():
    scenes = [random_scene(seed, (256, 320)) for seed in range(8)]
    images = [Camera(seed=7).shoot(scene, FOUR[1:3]).images[k % 2] for k, scene in enumerate(scenes)]
    for first in range(8):
        for second in range(first):
            assert align_mtb([images[first], images[second]]).doubtful[0]


def test_a_border_that_is_not_valid_has_no_vote():
    bracket = Camera(seed=6).shoot(chapel_scene()[:300, :420], CHAPEL_TIMES[3:5], [(0, 0), (9, -7)])
    images, valid = [i.copy() for i in bracket.images], np.zeros(bracket.images[0].shape[:2], bool)
    valid[60:-60, 60:-60] = True
    pattern = np.random.default_rng(1).integers(0, 256, images[0].shape).astype(np.uint8)
    for image in images:
        image[~valid] = pattern[~valid]  # a strong pattern that stays where it is
    assert align_mtb(images).shifts[0].tolist() != [9, -7]
    found = align_mtb(images, valid=[valid, valid])
    assert found.shifts[0].tolist() == [9, -7]
    assert not found.doubtful.any()


def test_photographs_without_a_valid_pixel_are_doubtful_and_stay(small_bracket):
    nowhere = [np.zeros(image.shape[:2], bool) for image in small_bracket.images]
    found = align_mtb(small_bracket.images, valid=nowhere)
    assert found.doubtful.tolist() == [True, True, False, True, True]
    assert not found.shifts.any()


def test_16_bits_are_aligned_like_8_and_keep_their_values():
    bracket = random_bracket(2, FOUR, 20)
    deep = [image.astype(np.uint16) * 257 for image in bracket.images]
    found, plain = align_mtb(deep), align_mtb(bracket.images)
    assert np.array_equal(found.shifts, plain.shifts)
    for a, b in zip(found.images, plain.images, strict=True):
        assert a.dtype == np.uint16
        assert np.array_equal(a, b.astype(np.uint16) * 257)


def test_the_input_is_not_changed_and_what_need_not_move_is_not_copied():
    bracket = random_bracket(2, FOUR, 20)
    before = [image.copy() for image in bracket.images]
    found = align_mtb(bracket.images)
    assert all(np.array_equal(a, b) for a, b in zip(before, bracket.images, strict=True))
    assert found.images[found.reference] is bracket.images[found.reference]


def test_aligned_photographs_are_those_of_a_tripod():
    quiet = Camera(full_well=1e12, read_noise=0, non_uniformity=0, bits=16, jpeg_quality=None)
    radiance = chapel_scene()[:300, 200:600]
    moves = np.array([(3, -2), (-4, 5), (0, 0), (2, 6)])
    times = CHAPEL_TIMES[3:7]
    found = align_mtb(quiet.shoot(radiance, times, moves).images)
    steady = [image[6:-6, 6:-6] for image in quiet.shoot(radiance, times).images]
    for image, expected in zip(crop_common(found.images, found.shifts), crop_common(steady, found.shifts), strict=True):
        assert np.abs(image.astype(int) - expected).max() <= 1


def test_the_middle_photograph_stays_where_it_was(small_bracket):
    found = align_mtb(small_bracket.images)
    assert found.reference == 2
    assert np.array_equal(found.images[2], small_bracket.images[2])


@pytest.mark.parametrize("size, shift", [((560, 816), (40, 0)), ((240, 300), (20, 0)), ((240, 300), (-18, 12))])
def test_a_shift_that_small_pictures_can_not_show_is_found_or_doubtful(size, shift):
    # All are within max_shift, but not within reach of a pyramid that ends at 16 pixels.
    radiance = chapel_scene()[-size[0] :, -size[1] :]
    found = align_mtb(Camera(seed=4).shoot(radiance, CHAPEL_TIMES[4:6], [(0, 0), shift]).images)
    assert found.doubtful[0] or found.shifts[0].tolist() == list(shift)


@pytest.mark.parametrize("values", [(0, 0), (0, 255), (90, 200)])
def test_pictures_without_any_structure_are_doubtful_and_stay(values):
    found = align_mtb([np.full((64, 80, 3), value, np.uint8) for value in values])
    assert found.doubtful.tolist() == [True, False]
    assert not found.shifts.any()


def test_pictures_that_have_nothing_in_common_are_doubtful_and_stay():
    noise = np.random.default_rng(0).integers(0, 256, (3, 120, 160, 3)).astype(np.uint8)
    found = align_mtb(noise)
    assert found.doubtful.tolist() == [True, False, True]
    assert not found.shifts.any()


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (15, 15), (31, 33), (63, 65), (17, 300)])
def test_pictures_smaller_than_the_pyramid_are_no_problem(size):
    noise = np.random.default_rng(1).integers(0, 128, (*size, 3)).astype(np.uint8)
    found = align_mtb([noise, noise * 2])
    assert not found.shifts.any()
    assert all(image.shape == noise.shape for image in found.images)


def test_aligning_refuses_a_single_photograph(small_bracket):
    with pytest.raises(ValueError, match="at least two photographs; got 1"):
        align_mtb(small_bracket.images[:1])


@pytest.mark.parametrize("max_shift", [0, -3])
def test_aligning_refuses_to_look_nowhere(small_bracket, max_shift):
    with pytest.raises(ValueError, match="at least 1 pixel"):
        align_mtb(small_bracket.images, max_shift=max_shift)


@pytest.mark.parametrize(
    "image", [np.zeros((40, 50), np.uint8), np.zeros((40, 50, 3)), np.zeros((40, 50, 4), np.uint8)]
)
def test_aligning_refuses_what_is_no_photograph(image):
    with pytest.raises(ValueError, match=r"must be \(H, W, 3\), uint8 or uint16; got"):
        align_mtb([image, image])


def test_aligning_refuses_masks_that_do_not_fit(small_bracket):
    with pytest.raises(ValueError, match="one mask of"):
        align_mtb(small_bracket.images, valid=[np.ones((3, 3), bool)] * len(small_bracket))


def test_aligning_refuses_different_sizes(small_bracket):
    with pytest.raises(ValueError, match="158 x 120 and 160 x 120"):
        align_mtb([small_bracket.images[0], small_bracket.images[1][:, 2:]])


# ------------------------------------------------------------------------------------- motions


def test_a_motion_and_its_inverse_cancel_and_motions_add_up_in_order():
    points = np.random.default_rng(0).uniform(-300, 300, (20, 2))
    first, second = Motion(7, -3, 2), Motion(-1.5, 4, -0.7)
    np.testing.assert_allclose(first.inverse()(first(points)), points, atol=1e-9)
    np.testing.assert_allclose(second.after(first)(points), second(first(points)), atol=1e-9)


def test_a_turn_is_counter_clockwise_to_the_eye():
    ((x, y),) = Motion(degrees=90)(np.array([[1.0, 0.0]]))  # on the right
    np.testing.assert_allclose((x, y), (0, -1), atol=1e-12)  # y points down: now at the top


def test_fit_motion_recovers_a_motion_and_knows_its_error():
    rng = np.random.default_rng(1)
    points, motion = rng.uniform(-200, 200, (60, 2)), Motion(3.2, -1.4, 0.8)
    found = [fit_motion(points, motion(points) + rng.normal(0, 0.5, points.shape)) for _ in range(200)]
    degrees, errors = np.array([(m.degrees, error) for m, error in found]).T
    assert abs(degrees.mean() - 0.8) < 0.02
    np.testing.assert_allclose(errors.mean(), degrees.std(), rtol=0.2)


def test_move_image_takes_a_spot_where_the_motion_says():
    image = np.zeros((120, 160), np.float32)
    image[30, 120] = 1
    image = cv2.GaussianBlur(image, (0, 0), 2)
    middle = np.array([79.5, 59.5])
    moved = move_image(image, (3.3, -6.8), 5)
    y, x = np.indices(moved.shape)
    centre = np.array([(x * moved).sum(), (y * moved).sum()]) / moved.sum()
    np.testing.assert_allclose(centre, (Motion(3.3, -6.8, 5)(np.array([[120, 30]]) - middle) + middle)[0], atol=0.05)


@pytest.mark.parametrize("shift, degrees", [((2.4, -1.3), 0.0), ((5, 3), 0.7), ((-8.2, 4.1), -1.5)])
def test_interpolated_pictures_have_nothing_from_outside_within_their_common_part(shift, degrees):
    full, mask = np.full((90, 130, 3), 77, np.uint8), np.ones((90, 130), bool)
    part = common_part(full.shape, [(0, 0), shift], [0.0, degrees])
    assert np.all(move_image(full, shift, degrees)[part] == 77)
    assert np.all(move_image(mask, shift, degrees)[part])
    rows, cols = part
    assert rows.stop - rows.start > 90 - 2 * abs(shift[1]) - 6
    assert cols.stop - cols.start > 130 - 2 * abs(shift[0]) - 6


def test_crop_bracket_brings_the_truth_along():
    moves = [(3, -2), (-4, 5), (2, 1), (2, 6)]
    bracket = Camera(seed=2, jpeg_quality=None).shoot(chapel_scene()[:300, 200:600], CHAPEL_TIMES[3:7], moves)
    cut = crop_bracket(bracket, align_mtb(bracket.images))
    merged = merge_debevec(cut.images, cut.times, cut.truth.crf).radiance
    here, beside = (radiance_error(merged, np.roll(cut.truth.radiance, by, axis=1)).median for by in (0, 2))
    assert here < 0.05 < beside / 2


# ---------------------------------------------------------------------------- moving and cropping


@pytest.mark.parametrize("shift", [(0, 0), (3, 2), (-3, 2), (4, -1), (-2, -5), (12, 0), (0, -40)])
def test_move_image_moves_right_and_down_and_fills_with_zero(shift):
    image = np.random.default_rng(2).integers(1, 256, (9, 12, 3)).astype(np.uint8)
    moved = move_image(image, shift)
    for row, col in np.ndindex(9, 12):
        r, c = row - shift[1], col - shift[0]
        expected = image[r, c] if 0 <= r < 9 and 0 <= c < 12 else [0, 0, 0]  # nothing comes round the edge
        assert np.array_equal(moved[row, col], expected)


def test_crop_common_keeps_all_pixels_that_every_frame_shows_and_no_other():
    shifts = np.array([(3, -2), (0, 0), (-4, 1), (2, 5)])
    shown = [move_image(np.ones((30, 40), np.uint8), shift) for shift in shifts]
    assert crop_common(shown, shifts)[0].shape == (30 - 5 - 2, 40 - 3 - 4)
    assert np.all(crop_common(shown, shifts))
    assert np.sum(np.all(shown, axis=0)) == crop_common(shown, shifts)[0].size


def test_photographs_without_a_common_part_are_refused():
    with pytest.raises(ValueError, match="no part in common"):
        crop_common([np.zeros((100, 100, 3), np.uint8)] * 2, [(-60, 0), (60, 0)])


# --------------------------------------------------------------------------------------- bitmaps


@pytest.mark.parametrize("percentile", [50, 80])
def test_the_bitmap_does_not_change_with_exposure(percentile):
    gray = np.random.default_rng(3).integers(0, 90, (41, 40)).astype(np.uint8)
    longer = np.sqrt(500.0 * gray + 900).astype(np.uint8)  # up to 231; no two values become one
    assert len(np.unique(longer)) == len(np.unique(gray))
    assert np.array_equal(bitmaps(gray, percentile)[0], bitmaps(longer, percentile)[0])


def test_the_exclusion_bitmap_leaves_out_what_noise_could_flip():
    gray = np.arange(101, dtype=np.uint8)[None]  # the median is 50
    bright, clear = bitmaps(gray)
    assert np.flatnonzero(bright).tolist() == list(range(51, 101))
    assert np.flatnonzero(clear == 0).tolist() == list(range(46, 55))


def test_the_shift_with_the_least_xor_is_found_among_all(chapel):
    gray = cv2.resize(cv2.cvtColor(chapel.images[4], cv2.COLOR_RGB2GRAY), (96, 64), interpolation=cv2.INTER_AREA)
    noise = np.random.default_rng(2).integers(-2, 3, gray.shape)
    moving = np.clip(move_image(gray, (-7, 4)) + noise, 0, 255).astype(np.uint8)
    everywhere = np.full(gray.shape, 255, np.uint8)
    best, *_ = likely_shifts((gray, everywhere), (moving, everywhere), 50, 12)
    pair = bitmaps(gray), bitmaps(moving)
    every = {(dx, dy): disagreement(*pair, (dx, dy)) for dx in range(-12, 13) for dy in range(-12, 13)}
    assert best == min(every, key=every.get) == (7, -4)


def test_grey_values_guess_a_shift_though_half_of_what_is_to_see_has_left_the_frame():
    scene = np.full((200, 260), 255, np.uint8)
    for x, y in ((60, 50), (120, 90), (215, 60), (230, 170), (190, 140)):
        cv2.circle(scene, (x, y), 9, 90, -1)
    scene = cv2.GaussianBlur(scene, (0, 0), 3)
    fixed, moving = scene[30:150, 20:180], scene[22:142, 55:215]
    everywhere = np.full(fixed.shape, 255, np.uint8)
    for picture in (1, -1):  # dark spots on white, and lamps in the dark
        grays = [fixed, moving] if picture == 1 else [255 - fixed, 255 - moving]
        best, *_ = correlated_shifts(*((gray, everywhere) for gray in grays), 60)
        assert best == (35, -8)


def test_bitmaps_of_unrelated_pictures_disagree_as_chance_would():
    rng = np.random.default_rng(4)
    pair = [bitmaps(rng.integers(0, 256, (200, 300)).astype(np.uint8), 80) for _ in range(2)]
    assert abs(disagreement(*pair, (0, 0)) - 1) < 0.02
    assert disagreement(pair[0], pair[0], (0, 0)) == 0


# ---------------------------------------------------------------------------------- real cameras


@pytest.mark.parametrize("name, most", [("memorial", 0), ("window", 1)])
def test_photographs_known_to_be_registered_stay(real, name, most):
    assert np.abs(align_mtb(load_bracket(real(name)).images).shifts).max() <= most


def edges(image):
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    return np.log1p(np.hypot(cv2.Sobel(gray, -1, 1, 0), cv2.Sobel(gray, -1, 0, 1)))


def likeness(images, shifts):
    """How well the edges of neighbours match, 0 to 1, over the part that all show."""
    images = crop_common(images, shifts)
    return np.array([np.corrcoef(edges(a).ravel(), edges(b).ravel())[0, 1] for a, b in pairwise(images)])


def test_edges_of_a_real_hand_held_set_match_better_than_before_and_no_worse_than_by_opencv(real):
    images = load_bracket(real("hdr")).images
    found = align_mtb(images)
    assert not found.doubtful.any()
    by_opencv = [image.copy() for image in images]
    cv2.createAlignMTB().process(by_opencv, by_opencv)
    ours = likeness(found.images, found.shifts)
    assert np.all(ours > likeness(images, found.shifts) + 0.01)
    assert np.all(ours > likeness(by_opencv, found.shifts) - 0.001)


def test_a_phone_that_sagged_is_lifted(real):
    found = align_mtb(load_bracket(real("pixel7")).images)
    # Vertical shifts that cv2.findTransformECC, an aligner of another kind, finds from neighbour to neighbour.
    np.testing.assert_allclose(found.shifts[:, 1], (-0.7, 18.8, 13.9, 0, 5.9, -12.2), atol=1)
    assert not found.doubtful.any()


def test_a_turned_set_with_a_moving_man_is_registered(real):
    found = align_mtb(load_bracket(real("pingpong")).images)
    assert not found.doubtful.any()
    # A similarity that RANSAC finds in SIFT features: (33.7, 5.2) and 0.20 degrees, (50.4, 1.4) and 0.43 degrees.
    # Far things and near ones have moved by up to 10 pixels less and more; it is registered between them.
    np.testing.assert_allclose(found.shifts[[0, 2]], [(33.7, 5.2), (50.4, 1.4)], atol=6)
    np.testing.assert_allclose(found.rotations[[0, 2]], (0.20, 0.43), atol=0.15)


@pytest.mark.parametrize("shift", [(0, 0), (3, -2), (-5, 7), (11, 0), (0, -8), (30, -30)])
def test_two_pictures_overlap_where_the_same_points_lie_on_each_other_and_not_at_all_farther_apart(shift):
    rows, cols = np.mgrid[:8, :11]
    here, there = overlap((8, 11), shift)
    assert rows[here].shape == rows[there].shape
    assert rows[here].size == max(11 - abs(shift[0]), 0) * max(8 - abs(shift[1]), 0)
    assert np.all(cols[here] - cols[there] == shift[0]) and np.all(rows[here] - rows[there] == shift[1])
