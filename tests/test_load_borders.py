"""Borders that are no photograph, from loading to the radiance map; and 16 bits on the same way."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from photographs import known

from hdr_helpers.__main__ import main
from hdr_helpers.align import align_mtb, crop_bracket, move_image, unaligned
from hdr_helpers.crf import fitted_weights, recover_crf, sample_pixels
from hdr_helpers.lab.brackets import CHAPEL_TIMES, handheld_chapel
from hdr_helpers.lab.camera import Camera, sensitivity
from hdr_helpers.lab.metrics import radiance_error
from hdr_helpers.lab.scenes import chapel_scene
from hdr_helpers.load import Bracket, BracketError, load_bracket
from hdr_helpers.merge import clipping, merge_debevec
from hdr_helpers.tonemap import luminance

BLUE, BLACK, WHITE, GREY = (0, 0, 255), (0, 0, 0), (255, 255, 255), (128, 128, 128)


def border(shape, shift):
    """Where a photograph of this shape still is one after a shift, (H, W) bool."""
    return move_image(np.ones(shape[:2], np.uint8), shift) > 0


def filled(images, valid, colour):
    """The images with this colour, or these colours, wherever they aren't valid."""
    return [
        np.where(v[..., None], image, np.array(colour, image.dtype)) for image, v in zip(images, valid, strict=True)
    ]


def write(folder, images, times, suffix=".png"):
    """A folder with these photographs and a list of their times."""
    folder.mkdir(exist_ok=True)
    options = {".png": [cv2.IMWRITE_PNG_COMPRESSION, 1], ".jpg": [cv2.IMWRITE_JPEG_QUALITY, 92]}[suffix]
    for i, image in enumerate(images):
        cv2.imwrite(str(folder / f"a_{i}{suffix}"), np.ascontiguousarray(image[..., ::-1]), options)
    (folder / "t.txt").write_text(
        "".join(f"a_{i}{suffix} {seconds!r}\n" for i, seconds in enumerate(map(float, times)))
    )
    return folder


# --------------------------------------------------------------------------------- what is a border


FRAMES = [0, 2, 3, 5, 6, 8]  # of the hand-held chapel: each has moved by five pixels or more


@cache
def aligned():
    """Photographs of the hand-held chapel, moved back onto each other, and where they are valid; with times."""
    bracket = handheld_chapel()
    shifts = -bracket.truth.shifts[FRAMES]
    images = [move_image(bracket.images[frame], shift) for frame, shift in zip(FRAMES, shifts, strict=True)]
    return images, [border(images[0].shape, shift) for shift in shifts], bracket.times[FRAMES]


def against_light(j, colour):
    """Share of the border of photograph j in which its colour can't be light, going by the other photographs."""
    images, valid, _ = aligned()
    odd = np.zeros(np.count_nonzero(~valid[j]), bool)
    for k in set(range(len(images))) - {j}:
        excess = (images[k][~valid[j]].astype(int) - colour) * np.sign(j - k)
        odd |= valid[k][~valid[j]] & (excess > 32).any(axis=1)
    return odd.mean()


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
@pytest.mark.parametrize("colour", [BLUE, BLACK, WHITE, GREY], ids=["blue", "black", "white", "grey"])
def test_a_border_is_found_to_a_hundredth_of_the_frame(tmp_path, colour, suffix):
    images, valid, times = aligned()
    found = load_bracket(write(tmp_path / "set", filled(images, valid, colour), times, suffix)).valid
    for j, (mask, true) in enumerate(zip(found, valid, strict=True)):
        # Black where shorter exposures are black too may be night, white where longer ones are white may be
        # the sun. Such borders do no harm: neither black nor white has any weight.
        if colour in (BLACK, WHITE) and against_light(j, colour) < 0.6:
            assert np.mean(true & ~mask) <= 0.01, j
        else:
            assert np.mean(mask != true) <= 0.01, j


@pytest.mark.parametrize("colour, told", [(BLACK, {4, 5}), (WHITE, {0, 1, 2, 3})], ids=["black", "white"])
def test_most_black_and_white_borders_can_be_told_from_night_and_sun(colour, told):
    assert {j for j in range(len(FRAMES)) if against_light(j, colour) >= 0.6} == told


def test_a_lamp_that_clips_at_the_edge_of_every_exposure_is_no_border(tmp_path):
    bracket = handheld_chapel()
    dark = np.ones(bracket.images[0].shape[:2], dtype=bool)
    dark[:, :60] = False
    images = filled(bracket.images, [dark] * len(bracket), BLUE)
    assert load_bracket(write(tmp_path / "set", images, bracket.times)).valid is None


def test_swapped_times_are_doubted_and_make_no_borders(tmp_path, chapel):
    times = chapel.times.copy()
    times[[6, 7]] = times[[7, 6]]
    bracket = load_bracket(write(tmp_path / "set", chapel.images, times))
    assert bracket.valid is None
    assert [note.split(":")[0] for note in bracket.notes] == ["a_7.png", "a_6.png"]


def test_photographs_without_a_common_part_are_refused(tmp_path, chapel):
    folder = write(tmp_path / "set", chapel.images[::4], chapel.times[::4])
    for i, image in enumerate(chapel.images[::4]):
        alpha = np.zeros(image.shape[:2], np.uint8)
        alpha[:, 250 * i : 250 * i + 250] = 255
        cv2.imwrite(str(folder / f"a_{i}.png"), np.dstack([image[..., ::-1], alpha]))
    with pytest.raises(BracketError, match=r"a_0\.png among them"):
        load_bracket(folder)


def test_the_note_names_photographs_with_borders_and_says_how_much_they_cover(tmp_path):
    images, valid, times = aligned()
    bracket = load_bracket(write(tmp_path / "set", filled(images, valid, BLUE), times))
    (note,) = bracket.notes
    share = 1 - np.logical_and.reduce(bracket.valid).mean()
    assert note.startswith("a_0.png, a_1.png, a_2.png and 3 more: an edge of one colour")
    assert f"{share:.1%}" in note
    assert share == pytest.approx(1 - np.logical_and.reduce(valid).mean(), abs=0.01)


@pytest.mark.parametrize("name", ["hdr", "exposures", "window", "pixel7", "pingpong", "frobisher"])
def test_real_photographs_without_borders_have_no_masks(real, name):
    assert known(real(name)).valid is None


def test_the_chapel_has_no_masks(chapel):
    assert chapel.valid is None


def test_the_hand_held_chapel_has_no_masks(tmp_path):
    bracket = handheld_chapel()
    assert load_bracket(write(tmp_path / "set", bracket.images[::2], bracket.times[::2])).valid is None


SKIES = {"night": 0.0, "a sky that is white in all exposures": 1e6, "a sky that is white in the longer ones": 2e3}


@pytest.mark.parametrize("hand", [0, 15], ids=["from a tripod", "from the hand"])
@pytest.mark.parametrize("light", SKIES.values(), ids=SKIES.keys())
def test_no_border_is_seen_in(tmp_path, light, hand):
    radiance = chapel_scene()[100:300, 200:500].copy()
    radiance[:100, :200] = light
    gain = sensitivity(chapel_scene(), CHAPEL_TIMES[0])
    camera, images = Camera(seed=6), []
    for frame, (dx, dy) in enumerate(np.random.default_rng(1).integers(-hand, hand + 1, (5, 2))):
        image = camera.photograph(gain * CHAPEL_TIMES[2 * frame] * radiance, frame)
        images.append(image[hand + dy : 200 - hand + dy, hand + dx : 300 - hand + dx])
    corner = images[-1][:60, :150]
    assert np.all(corner < 8) if light == 0 else np.all(corner > 250)
    assert load_bracket(write(tmp_path / "set", images, CHAPEL_TIMES[::2])).valid is None


@cache
def memorial(folder):
    return load_bracket(folder)


def test_the_blue_borders_of_the_memorial_are_found_and_noted(real):
    bracket = memorial(real("memorial"))
    union = ~np.logical_and.reduce(bracket.valid)
    assert union.mean() == pytest.approx(0.079, abs=0.003)
    assert any("an edge of one colour" in note and f"{union.mean():.1%} of the frame" in note for note in bracket.notes)


def test_nothing_but_the_blue_borders_of_the_memorial_is_left_out(real):
    bracket = memorial(real("memorial"))
    for name, image, mask in zip(bracket.names, bracket.images, bracket.valid, strict=True):
        blue = (image == BLUE).all(axis=2)
        assert np.mean(blue & mask) < 0.003, name  # a region of less than 0.2% is not worth a mask
        assert np.mean(~blue & ~mask) < 0.001, name


# --------------------------------------------------------------------------- what borders may not do


SHIFTS = ((9, 4), (-6, 0), (0, 7), (-3, -8), (5, -2))


@pytest.fixture(scope="session")
def bordered(small_bracket):
    """The small bracket with borders of up to 9 pixels on all sides, and a pixel that nobody saw."""
    shape = small_bracket.images[0].shape
    valid = [border(shape, shift) for shift in SHIFTS]
    for mask in valid:
        mask[60:63, 80:84] = False
    return replace(small_bracket, valid=tuple(valid))


def garbage(bracket, kind):
    """The bracket with other colours where it isn't valid."""
    if kind == "noise":
        shape = bracket.images[0].shape
        colours = [np.random.default_rng(i).integers(0, 256, shape, np.uint8) for i in range(len(bracket))]
    else:
        colours = [kind] * len(bracket)
    images = [filled([i], [v], c)[0] for i, v, c in zip(bracket.images, bracket.valid, colours, strict=True)]
    return replace(bracket, images=tuple(images))


KINDS = pytest.mark.parametrize("kind", ["noise", BLUE, WHITE, BLACK, (17, 17, 17)], ids=str)


@pytest.mark.parametrize("n", [1, 500, 19_200 // 3])
@pytest.mark.parametrize("seed", range(3))
def test_no_invalid_pixel_is_sampled(small_bracket, n, seed):
    valid = np.random.default_rng(seed).random((120, 160)) < 0.4
    rows, cols = sample_pixels(small_bracket.images, n, seed, valid)
    assert len(rows) == n
    assert valid[rows, cols].all()


def test_no_more_pixels_are_sampled_than_are_valid(small_bracket):
    valid = np.zeros((120, 160), bool)
    valid[40:50, 20:40] = True
    rows, cols = sample_pixels(small_bracket.images, 200, valid=valid)
    assert len(set(zip(rows.tolist(), cols.tolist(), strict=True))) == 200
    with pytest.raises(ValueError, match="201 pixels were asked for; the photographs have 200"):
        sample_pixels(small_bracket.images, 201, valid=valid)


@KINDS
def test_what_stands_in_borders_does_not_reach_the_response(bordered, kind):
    plain, other = (recover_crf(b).crf for b in (bordered, garbage(bordered, kind)))
    assert np.array_equal(plain, other)


@KINDS
def test_what_stands_in_borders_does_not_reach_the_radiance_map(bordered, kind):
    crf = bordered.truth.crf
    plain, other = (
        merge_debevec(b.images, b.times, crf, valid=b.valid).radiance for b in (bordered, garbage(bordered, kind))
    )
    assert np.array_equal(plain, other)


@KINDS
def test_what_stands_in_borders_does_not_reach_the_clipped_shares(bordered, kind):
    plain, other = (clipping(b.images, b.valid) for b in (bordered, garbage(bordered, kind)))
    assert np.array_equal(plain.too_dark, other.too_dark)
    assert np.array_equal(plain.too_bright, other.too_bright)
    assert (plain.everywhere_dark, plain.everywhere_bright) == (other.everywhere_dark, other.everywhere_bright)


def test_pixels_that_are_valid_in_all_photographs_merge_as_without_masks(bordered):
    crf, w = bordered.truth.crf, fitted_weights(bordered.images, bordered.valid)
    masked = merge_debevec(bordered.images, bordered.times, crf, w, bordered.valid).radiance
    plain = merge_debevec(bordered.images, bordered.times, crf, w).radiance
    inside = np.logical_and.reduce(bordered.valid)
    assert 0.5 < inside.mean() < 0.95
    np.testing.assert_allclose(masked[inside], plain[inside], rtol=1e-5)


def test_masks_that_leave_nothing_out_change_nothing(small_bracket):
    crf, everywhere = small_bracket.truth.crf, [np.ones((120, 160), bool)] * 5
    masked = merge_debevec(small_bracket.images, small_bracket.times, crf, valid=everywhere).radiance
    assert np.array_equal(masked, merge_debevec(small_bracket.images, small_bracket.times, crf).radiance)


def test_a_pixel_in_a_border_is_what_the_other_photographs_say(bordered):
    radiance = merge_debevec(bordered.images, bordered.times, bordered.truth.crf, valid=bordered.valid).radiance
    # There the first photograph has its border; the others alone must give the same.
    rest = merge_debevec(bordered.images[1:], bordered.times[1:], bordered.truth.crf, valid=bordered.valid[1:]).radiance
    alone = ~bordered.valid[0] & np.logical_or.reduce(bordered.valid[1:])
    well_exposed = alone & ((bordered.images[1] > 20) & (bordered.images[1] < 200)).all(axis=2)
    assert well_exposed.sum() > 100
    np.testing.assert_allclose(radiance[well_exposed], rest[well_exposed], rtol=1e-3)


def test_a_pixel_that_no_photograph_shows_is_no_brighter_than_the_darkest(bordered):
    radiance = merge_debevec(bordered.images, bordered.times, bordered.truth.crf, valid=bordered.valid).radiance
    seen = np.logical_or.reduce(bordered.valid)
    assert (~seen).sum() >= 12
    assert np.all(np.isfinite(radiance)) and np.all(radiance > 0)
    assert np.all(radiance[~seen] <= radiance[seen].min(axis=0))


def test_where_nothing_at_all_is_valid_the_radiance_is_finite_and_positive(small_bracket):
    nowhere = [np.zeros((120, 160), bool)] * 5
    radiance = merge_debevec(small_bracket.images, small_bracket.times, small_bracket.truth.crf, valid=nowhere).radiance
    assert np.all(np.isfinite(radiance)) and np.all(radiance > 0)


@pytest.mark.parametrize(
    "valid",
    [[np.ones((120, 160), bool)] * 4, [np.ones((160, 120), bool)] * 5, [np.ones((120, 160, 3), bool)] * 5],
    ids=["one too few", "another shape", "one for each channel"],
)
def test_masks_that_do_not_fit_are_refused(small_bracket, valid):
    with pytest.raises(ValueError, match=r"one mask of \(120, 160\) for each photograph"):
        merge_debevec(small_bracket.images, small_bracket.times, small_bracket.truth.crf, valid=valid)
    with pytest.raises(ValueError, match=r"one mask of \(120, 160\) for each photograph"):
        replace(small_bracket, valid=tuple(valid))


def test_clipped_shares_are_of_the_pixels_that_are_valid_in_every_photograph():
    images = [np.full((10, 20, 3), value, np.uint8) for value in (90, 120)]
    valid = [np.ones((10, 20), bool) for _ in images]
    valid[0][:, :4] = valid[1][:2] = False  # 8 x 16 pixels are left
    for image in images:
        image[0, :, 1] = image[:, 0] = 0  # not counted
        image[5, 2:10, 2] = 255  # two of these eight are not counted
    images[0][9, 10:14] = 0
    shares = clipping(images, valid)
    np.testing.assert_allclose(shares.too_dark, [4 / 128, 0])
    np.testing.assert_allclose(shares.too_bright, [6 / 128, 6 / 128])
    assert (shares.everywhere_dark, shares.everywhere_bright) == (0, 6 / 128)


def test_masks_move_with_their_photographs_and_both_are_cut_to_the_same_part(small_bracket):
    shifts = np.array([(3, -5), (0, 0), (-4, 2), (6, 1), (0, -7)])
    mark = np.array([255, 0, 255], np.uint8)
    rng = np.random.default_rng(5)
    valid = [rng.random((120, 160)) < 0.8 for _ in shifts]
    images = filled([np.minimum(image, 254) for image in small_bracket.images], valid, mark)
    bracket = replace(small_bracket, images=tuple(images), valid=tuple(valid))
    moved = tuple(move_image(image, shift) for image, shift in zip(images, shifts, strict=True))
    cut = crop_bracket(bracket, replace(unaligned(moved), shifts=shifts, reference=1))
    assert cut.images[0].shape[:2] == cut.valid[0].shape == (120 - 9, 160 - 10)
    for image, mask, before, (dx, dy) in zip(cut.images, cut.valid, valid, shifts, strict=True):
        assert mask.dtype == bool
        assert np.array_equal(mask, before[2 - dy : 2 - dy + 111, 6 - dx : 6 - dx + 150])
        assert np.array_equal(mask, (image != mark).any(axis=2))


def test_the_memorial_is_nearer_to_its_published_radiance_map_with_masks(real):
    bracket = memorial(real("memorial"))
    reference = luminance(cv2.imread(str(real("memorial") / "reference.hdr"), cv2.IMREAD_UNCHANGED)[..., ::-1])
    known_there = reference > 0

    def agreement(bracket):
        radiance = merge_debevec(bracket.images, bracket.times, recover_crf(bracket).crf, valid=bracket.valid).radiance
        logs = np.log(luminance(radiance)[known_there]), np.log(reference[known_there])
        return np.corrcoef(*logs)[0, 1]

    with_masks, without = agreement(bracket), agreement(replace(bracket, valid=None))
    assert with_masks > without
    assert with_masks > 0.999


# ------------------------------------------------------------------------------------------- 16 bits


def in_16_bits(bracket):
    """Each of 256 values as the 16-bit value that stands for the same light."""
    return replace(bracket, images=tuple(image.astype(np.uint16) * 257 for image in bracket.images))


@pytest.mark.parametrize("curve", ["true", "recovered"])
def test_16_bits_that_hold_8_merge_as_8_bits(small_bracket, curve):
    crf = small_bracket.truth.crf if curve == "true" else recover_crf(small_bracket).crf
    in_8, in_16 = (merge_debevec(b.images, b.times, crf).radiance for b in (small_bracket, in_16_bits(small_bracket)))
    np.testing.assert_allclose(in_16, in_8, rtol=1e-5)


def test_masks_work_on_16_bits_as_on_8(bordered):
    crf = bordered.truth.crf
    in_8, in_16 = (
        merge_debevec(b.images, b.times, crf, valid=b.valid).radiance for b in (bordered, in_16_bits(bordered))
    )
    np.testing.assert_allclose(in_16, in_8, rtol=1e-5)


@pytest.fixture(scope="session")
def fine():
    """A part of the chapel without noise in steps of 1/65535; the bracket and its true radiance."""
    radiance, times, camera = chapel_scene()[100:220, 200:360], CHAPEL_TIMES[::2], Camera()
    gain = sensitivity(radiance, times[0])
    images = [
        np.stack([np.rint(65535 * camera.respond(gain * t * radiance[..., c], c)) for c in range(3)], axis=-1)
        for t in times
    ]
    images = tuple(image.astype(np.uint16) for image in images)
    return Bracket(images, np.array(times), tuple("abcde")), radiance


def test_16_bits_are_nearer_to_the_truth_than_8(fine):
    bracket, radiance = fine
    rounded = [np.rint(image / 257).astype(np.uint8) for image in bracket.images]
    crf = Camera().crf()
    error_8, error_16 = (
        radiance_error(merge_debevec(images, bracket.times, crf).radiance, radiance)
        for images in (rounded, bracket.images)
    )
    assert error_16.median < error_8.median
    assert error_16.p95 < error_8.p95
    assert error_16.median < 0.005


def test_the_response_of_16_bits_is_that_of_their_upper_8(fine):
    bracket, _ = fine
    crf = recover_crf(bracket).crf
    assert np.array_equal(crf, recover_crf(bracket.in_8_bits()).crf)
    assert crf.shape == (3, 256)


@pytest.mark.parametrize("low", [0, 77, 255])
def test_shifts_are_found_in_16_bits_as_in_8(low):
    shifts = np.array([(0, 0), (5, -3), (-7, 2)])
    bracket = Camera(seed=2).shoot(chapel_scene()[:250, :350], CHAPEL_TIMES[4:7], shifts)
    found = align_mtb([image.astype(np.uint16) * 256 + low for image in bracket.images])
    plain = align_mtb(bracket.images)
    assert np.array_equal(found.shifts, plain.shifts)
    assert np.array_equal(found.shifts, shifts[1] - shifts)
    assert all(image.dtype == np.uint16 for image in found.images)
    assert np.array_equal(found.images[0] >> 8, plain.images[0])


FILES = ["crf.csv", "crf.png", "picture.png", "radiance.hdr"]


def test_the_command_line_runs_on_16_bits(tmp_path, fine):
    bracket, radiance = fine
    folder = write(tmp_path / "set", bracket.images, bracket.times)
    assert load_bracket(folder).images[0].dtype == np.uint16
    assert main([str(folder), "-o", str(tmp_path / "out"), "--no-align"]) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    read = cv2.imread(str(tmp_path / "out" / "radiance.hdr"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    assert radiance_error(read, radiance).median < 0.05


@pytest.mark.parametrize("align", [True, False], ids=["aligned", "not aligned"])
@pytest.mark.parametrize("depth", [8, 16])
def test_the_command_line_runs_on_photographs_with_borders(tmp_path, bordered, capsys, depth, align):
    bracket = bordered if depth == 8 else in_16_bits(bordered)
    white = np.iinfo(bracket.images[0].dtype).max
    images = filled(bracket.images, [border((120, 160), shift) for shift in SHIFTS], (0, 0, white))
    folder = write(tmp_path / "set", images, bracket.times)
    assert main([str(folder), "-o", str(tmp_path / "out"), *["--no-align"] * (not align)]) == 0
    assert "a_2.png and 2 more: an edge of one colour" in capsys.readouterr().out
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    read = cv2.imread(str(tmp_path / "out" / "radiance.hdr"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    if not align:
        assert radiance_error(read, bordered.truth.radiance).median < 0.05
