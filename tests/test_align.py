"""Stage 2: shifts that are known come back, and what can't be known is said to be doubtful."""

import numpy as np
import pytest

from hdr_helpers.align import align_mtb, bitmaps, crop_common, move_image
from hdr_helpers.lab.brackets import CHAPEL_TIMES
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.scenes import chapel_scene
from hdr_helpers.load import load_bracket


# Under seed 1 OpenCV's AlignMTB moves the darkest photograph by (43, -9) where (-9, -8) is right.
@pytest.mark.parametrize("seed", [1, 2])
def test_known_shifts_are_recovered_exactly(seed):
    moves = np.random.default_rng(seed).integers(-20, 21, (9, 2))
    found = align_mtb(Camera(seed=seed).shoot(chapel_scene(), CHAPEL_TIMES, moves).images)
    assert np.array_equal(found.shifts, moves[found.reference] - moves)
    assert not found.doubtful.any()


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


def test_aligning_refuses_different_sizes(small_bracket):
    with pytest.raises(ValueError, match="158 x 120 and 160 x 120"):
        align_mtb([small_bracket.images[0], small_bracket.images[1][:, 2:]])


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


# ---------------------------------------------------------------------------------- real cameras


@pytest.mark.parametrize("name, most", [("memorial", 0), ("window", 1)])
def test_photographs_known_to_be_registered_stay(real, name, most):
    assert np.abs(align_mtb(load_bracket(real(name)).images).shifts).max() <= most


def test_photographs_without_a_common_part_are_refused():
    with pytest.raises(ValueError, match="no part in common"):
        crop_common([np.zeros((100, 100, 3), np.uint8)] * 2, [(-60, 0), (60, 0)])
