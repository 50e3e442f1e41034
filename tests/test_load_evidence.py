"""Stage 1: what the photographs say of their times, and what ISO and aperture do to an exposure."""

import itertools
import re
import shutil
from functools import cache

import cv2
import numpy as np
import pytest
from photographs import histograms, known, write_with_exif

from hdr_helpers._reading.pictures import Exif, read_exif
from hdr_helpers._reading.times import find_times
from hdr_helpers.lab.brackets import CHAPEL_TIMES, handheld_chapel
from hdr_helpers.lab.camera import Camera, sensitivity
from hdr_helpers.lab.data import DATA
from hdr_helpers.lab.exif import exif_block
from hdr_helpers.lab.scenes import chapel_scene
from hdr_helpers.load import load_bracket

NAMES = tuple(f"a_{i}.png" for i in range(1, 6))
NEUTRAL = tuple(f"frame_{i:02d}.png" for i in range(16))  # some real names hold times, another source
REACH = 20  # pixels by which a hand moves a frame


def notes(counts, times, names=None):
    """What is noted when a text file gives these times to photographs with these histograms."""
    names = list(names or NEUTRAL[: len(times)])
    text = "".join(f"{name} {float(seconds)!r}s\n" for name, seconds in zip(names, times, strict=True))
    return find_times("a folder", names, {"t.txt": text.encode()}, [Exif()] * len(names), counts).notes


def doubts(said):
    return [sentence for sentence in said if "looks" in sentence]


def named(said, names):
    """Indices of the photographs that the doubts name."""
    return {i for i, name in enumerate(names) if any(name in sentence for sentence in doubts(said))}


def misnamed(times, frame, factor):
    times = np.array(times)
    times[frame] *= factor
    return times


@cache
def part():
    """Radiance of a part of the chapel that has lights and shadows, (120, 160, 3)."""
    return chapel_scene()[100:220, 200:360]


def expose(exposures, camera=None, first_frame=0):
    """Photographs of that part at these exposures, the first the shortest."""
    camera = camera or Camera(seed=3, jpeg_quality=None)
    gain = sensitivity(part(), exposures[0])
    return [camera.photograph(gain * e * part(), i) for i, e in enumerate(exposures, first_frame)]


@pytest.fixture(scope="session")
def brackets(chapel, small_bracket):
    return {"chapel": chapel, "small": small_bracket, "handheld": handheld_chapel()}


# -------------------------------------------------------------------------------- nothing is doubted


@pytest.mark.parametrize("name", ["chapel", "small", "handheld"])
def test_right_times_are_not_doubted(brackets, name):
    bracket = brackets[name]
    assert notes(histograms(bracket.images), bracket.times) == []


def test_the_chapel_loads_without_a_note(chapel):
    assert chapel.notes == ()


@pytest.mark.parametrize("seed", range(10))
def test_right_times_are_not_doubted_whatever_the_camera_and_the_scene(seed):
    rng = np.random.default_rng(seed)
    response = tuple(zip(rng.uniform(1.6, 2.6, 3), rng.uniform(30, 150, 3), rng.uniform(0.3, 0.6, 3), strict=True))
    whole = chapel_scene()
    height, width = rng.integers(90, 140), rng.integers(130, 200)
    top, left = rng.integers(0, whole.shape[0] - height), rng.integers(0, whole.shape[1] - width)
    camera = Camera(response=response, seed=seed)
    bracket = camera.shoot(whole[top : top + height, left : left + width], CHAPEL_TIMES)
    assert notes(histograms(bracket.images), bracket.times) == []


@pytest.mark.parametrize("name", ["hdr", "exposures", "memorial", "frobisher", "window", "pixel7", "pingpong"])
def test_right_times_of_real_cameras_are_not_doubted(real, name):
    assert doubts(known(real(name)).notes) == []


CURVES = {
    "gamma 0.6": lambda x: x**0.6,
    "gamma 1.5": lambda x: x**1.5,
    "an S": lambda x: x * x * (3 - 2 * x),
    "a steep S": lambda x: (1 + np.tanh(4 * x - 2) / np.tanh(2)) / 2,
}


@pytest.mark.parametrize("name", ["chapel", "small", "handheld"])
@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())
def test_right_times_are_not_doubted_after_any_increasing_tone_curve(brackets, name, curve):
    lut = np.rint(255 * curve(np.arange(256) / 255)).astype(np.uint8)
    assert (lut[0], lut[255]) == (0, 255)  # what is clipped stays clipped
    bracket = brackets[name]
    assert notes(histograms([lut[image] for image in bracket.images]), bracket.times) == []


# --------------------------------------------------------------------------------- one wrong time


@pytest.mark.parametrize("factor", [2, 0.5])
@pytest.mark.parametrize("frame", range(9))
def test_a_photograph_with_a_wrong_time_is_named_and_its_time_suggested(chapel, frame, factor):
    said = notes(histograms(chapel.images), misnamed(chapel.times, frame, factor), chapel.names)
    assert named(said, chapel.names) == {frame}
    (doubt,) = said
    (suggested,) = re.findall(r"about ([\d.e-]+) s", doubt)
    assert float(suggested) == pytest.approx(chapel.times[frame], rel=0.25)
    assert f"{chapel.times[frame] * factor:.4g} s by the text file t.txt" in doubt


def test_a_wrong_time_in_a_folder_is_noted_and_stays_as_written(tmp_path, chapel):
    folder = shutil.copytree(DATA / "chapel", tmp_path / "chapel")
    listed = (folder / "shutter.txt").read_text()
    assert "chapel_5.jpg 1/10\n" in listed
    (folder / "shutter.txt").write_text(listed.replace("chapel_5.jpg 1/10", "chapel_5.jpg 1/5"))
    bracket = load_bracket(folder)
    np.testing.assert_allclose(bracket.times, misnamed(chapel.times, 4, 2))
    (doubt,) = bracket.notes
    assert doubt.startswith("chapel_5.jpg: 0.2 s by the text file shutter.txt, but it looks")


# Those that keep their place with the wrong time; of window's two darkest too few pixels are bright.
REAL_FRAMES = [("window", frame, factor) for frame in range(2, 9) for factor in (2, 0.5)]
REAL_FRAMES += [("hdr", frame, factor) for frame in range(4) for factor in (2, 0.5)]
REAL_FRAMES += [("exposures", frame, 2 - 1.5 * (frame % 2)) for frame in range(13)]
REAL_FRAMES += [("pixel7", 0, 0.5), ("pixel7", 5, 2), ("memorial", 0, 0.5), ("memorial", 15, 2)]


@pytest.mark.parametrize("name, frame, factor", REAL_FRAMES)
def test_a_real_photograph_with_a_wrong_time_is_named(real, name, frame, factor):
    bracket = known(real(name))
    times = misnamed(bracket.times, frame, factor)
    assert np.all(np.diff(times) > 0)
    assert named(notes(bracket.histograms, times), NEUTRAL) == {frame}


@pytest.mark.parametrize("factor", [2, 0.5])
@pytest.mark.parametrize("frame", [0, 1])
def test_a_wrong_time_where_little_can_be_seen_accuses_no_well_exposed_photograph(real, frame, factor):
    bracket = known(real("window"))
    times = misnamed(bracket.times, frame, factor)
    assert named(notes(bracket.histograms, times), NEUTRAL) <= {0, 1}


def test_when_the_middle_one_of_three_is_wrong_both_its_pairs_are_named(real):
    bracket = known(real("frobisher"))
    said = doubts(notes(bracket.histograms, misnamed(bracket.times, 1, 2)))
    assert len(said) == 2
    assert all(NEUTRAL[1] in doubt and "check both times" in doubt for doubt in said)


# ---------------------------------------------------------------------------- equal, swapped, two


@pytest.mark.parametrize("frame", range(9))
def test_a_photograph_that_claims_twice_the_light_of_its_equal_is_named(frame):
    exposures = np.insert(CHAPEL_TIMES, frame + 1, CHAPEL_TIMES[frame])
    images = expose(exposures)
    assert not np.array_equal(images[frame], images[frame + 1])  # the noise differs
    times = misnamed(exposures, frame + 1, 2)
    assert named(notes(histograms(images), times), NEUTRAL) == {frame + 1}


SWAPPED = [("chapel", first) for first in range(8)] + [("small", first) for first in range(4)]


@pytest.mark.parametrize("name, first", SWAPPED)
def test_two_neighbours_that_were_swapped_are_both_named(brackets, name, first):
    counts = histograms(brackets[name].images)
    counts[[first, first + 1]] = counts[[first + 1, first]]
    assert {first, first + 1} <= named(notes(counts, brackets[name].times), NEUTRAL)


@pytest.mark.parametrize("frame", range(9))
def test_of_two_photographs_equal_ones_that_claim_twice_the_light_are_doubted(frame):
    seconds = CHAPEL_TIMES[frame]
    gain = sensitivity(part(), CHAPEL_TIMES[0])
    camera = Camera(seed=11)
    one, other, twice = (camera.photograph(gain * t * part(), i) for i, t in enumerate((seconds, seconds, 2 * seconds)))
    (doubt,) = doubts(notes(histograms([one, other]), [seconds, 2 * seconds]))
    assert "frame_00.png" in doubt and "frame_01.png" in doubt
    assert "2 times the light, but it looks like 1 times" in doubt
    assert notes(histograms([one, twice]), [seconds, 2 * seconds]) == []


@pytest.mark.parametrize("listed", ["0.00625s 0.0125s", "0.00625 0.0125", "1/160 1/80"])
def test_noise_does_not_decide_what_the_times_of_equal_photographs_mean(listed):
    images = [Camera(seed=11).photograph(0.1 * part(), i) for i in (0, 1)]
    images.sort(key=lambda image: -image[..., 1].mean())  # the second is darker by a hundredth of a level
    assert 0 < images[0][..., 1].mean() - images[1][..., 1].mean() < 0.05
    found = find_times("a folder", list(NAMES[:2]), {"t.txt": listed.encode()}, [Exif()] * 2, histograms(images))
    np.testing.assert_allclose(found.seconds, [1 / 160, 1 / 80])
    assert named(found.notes, NAMES[:2]) == {0, 1}


# ----------------------------------------------------------------------------- moved photographs


def moved_by_hand(bracket, seed):
    """The bracket's photographs, each cut out elsewhere by up to REACH pixels."""
    shifts = np.random.default_rng(seed).integers(-REACH, REACH + 1, (len(bracket), 2))
    height, width = bracket.images[0].shape[:2]
    return [
        image[REACH + dy : height - REACH + dy, REACH + dx : width - REACH + dx]
        for image, (dx, dy) in zip(bracket.images, shifts, strict=True)
    ]


@pytest.mark.parametrize("seed", range(10))
def test_right_times_are_not_doubted_where_the_hand_moved(chapel, seed):
    assert notes(histograms(moved_by_hand(chapel, seed)), chapel.times) == []


@pytest.mark.parametrize("seed", range(10))
def test_a_wrong_time_is_found_without_aligning(chapel, seed):
    counts = histograms(moved_by_hand(chapel, seed))
    for frame, factor in itertools.product(range(9), (2, 0.5)):
        said = notes(counts, misnamed(chapel.times, frame, factor), chapel.names)
        assert named(said, chapel.names) == {frame}, (frame, factor)


@pytest.mark.parametrize("factor", [2, 0.5])
@pytest.mark.parametrize("frame", range(9))
def test_a_wrong_time_of_the_hand_held_chapel_is_found_without_aligning(frame, factor):
    bracket = handheld_chapel()
    times = misnamed(bracket.times, frame, factor)
    assert named(notes(histograms(bracket.images), times), NEUTRAL) == {frame}


# ------------------------------------------------------------------------- what the doubts decide


@pytest.fixture
def write(tmp_path):
    """write(images, blocks, text) writes a folder of PNG files with EXIF; returns it."""

    def write(images, blocks, text=None):
        folder = tmp_path / "photographs"
        folder.mkdir()
        for name, image, block in zip(NAMES, images, blocks, strict=False):
            write_with_exif(folder / name, image, block)
        if text is not None:
            (folder / "t.txt").write_text(text)
        return folder

    return write


SHUTTER = ((1, 400), (1, 100), (1, 25), (1, 6), (2, 3))
SECONDS = np.array([a / b for a, b in SHUTTER])


def test_a_list_that_the_photographs_contradict_gives_way_to_exif_that_they_bear_out(write):
    folder = write(expose(SECONDS), [exif_block(seconds=s) for s in SHUTTER], "1/400 1/100 0.08 1/6 2/3")
    bracket = load_bracket(folder)
    assert bracket.source == "EXIF"
    np.testing.assert_allclose(bracket.times, SECONDS)
    (aside,) = [note for note in bracket.notes if note.startswith("Not used")]
    assert "the text file t.txt. a_3.png: 0.08 s by the text file t.txt, but it looks" in aside
    assert any("0.04 s by EXIF, 0.08 s by the text file t.txt" in note for note in bracket.notes)


def test_names_that_the_photographs_contradict_give_way_to_exif_that_they_bear_out(write, tmp_path):
    folder = write(expose(SECONDS), [exif_block(seconds=s) for s in SHUTTER])
    spelled = ("0.0025", "0.01", "0.04", "0.08", "0.67")
    for name, seconds in zip(NAMES, spelled, strict=True):
        (folder / name).rename(folder / f"img_{seconds}.png")
    bracket = load_bracket(folder)
    assert bracket.source == "EXIF"
    np.testing.assert_allclose(bracket.times, SECONDS)
    assert any(note.startswith("Not used") and "the file names" in note for note in bracket.notes)


def test_a_list_that_the_photographs_bear_out_stays_when_exif_is_wrong(write):
    wrong = [exif_block(seconds=s) for s in (*SHUTTER[:2], (2, 25), *SHUTTER[3:])]
    bracket = load_bracket(write(expose(SECONDS), wrong, "1/400 1/100 1/25 1/6 2/3"))
    assert bracket.source == "the text file t.txt"
    np.testing.assert_allclose(bracket.times, SECONDS)
    (note,) = bracket.notes
    assert "a_3.png: 0.04 s by the text file t.txt, 0.08 s by EXIF" in note


def test_when_the_only_source_is_wrong_its_times_stay_and_the_photographs_view_is_noted(write):
    bracket = load_bracket(write(expose(SECONDS), [b"II*\0"] * 5, "1/400 1/100 0.08 1/6 2/3"))
    np.testing.assert_allclose(bracket.times, [1 / 400, 0.01, 0.08, 1 / 6, 2 / 3])
    (doubt,) = bracket.notes
    (suggested,) = re.findall(r"a_3\.png: 0\.08 s .* looks .* about ([\d.e-]+) s", doubt)
    assert float(suggested) == pytest.approx(0.04, rel=0.25)


# -------------------------------------------------------------------------------- ISO and aperture

F8, F56, F4, F28 = (8, 1), (56, 10), (4, 1), (28, 10)
SIXTIETH = (1, 60)
SETTINGS = {  # shutter, ISO and aperture of each photograph, and what the note says
    "only ISO": ([SIXTIETH] * 4, (100, 200, 400, 800), [F8] * 4, ["ISO changes from 100 to 800"]),
    "only the aperture": ([SIXTIETH] * 3, [100] * 3, (F8, F56, F4), ["the aperture changes from f/4 to f/8"]),
    "ISO and aperture": (
        [SIXTIETH] * 4,
        (100, 100, 400, 400),
        (F8, F56, F56, F28),
        ["ISO changes from 100 to 400", "the aperture changes from f/2.8 to f/8"],
    ),
    "all three": (
        (SIXTIETH, (1, 15), (1, 15), (1, 4)),
        (100, 100, 400, 400),
        (F8, F8, F56, F4),
        ["ISO changes from 100 to 400", "the aperture changes from f/4 to f/8"],
    ),
    "ISO that falls as the time grows": (
        ((1, 400), (1, 60), (1, 10), (1, 2)),
        (400, 200, 200, 100),
        [F8] * 4,
        ["ISO changes from 100 to 400"],
    ),
}


def blocks(shutter, isos, apertures, order="<"):
    return [exif_block(order, *values) for values in zip(shutter, isos, apertures, strict=True)]


def exposures(shutter, isos, apertures):
    """t ISO / N^2, which is what the sensor sees."""
    t, n = (np.array([a / b for a, b in values]) for values in (shutter, apertures))
    return t * np.array(isos) / n**2


@pytest.mark.parametrize("order", "<>")
def test_exif_tells_time_iso_and_aperture_in_both_byte_orders(order):
    read = read_exif(exif_block(order, (1, 60), 400, (56, 10)))
    assert (read.seconds, read.iso, read.f_number) == (1 / 60, 400, 5.6)


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("case", SETTINGS.values(), ids=SETTINGS.keys())
def test_times_are_exposures_where_iso_or_aperture_change_and_it_is_noted(write, case, order):
    *settings, said = case
    expected = exposures(*settings)
    bracket = load_bracket(write(expose(expected), blocks(*settings, order)))
    np.testing.assert_allclose(bracket.times / bracket.times[0], expected / expected[0], rtol=1e-6)
    assert bracket.names == NAMES[: len(expected)]
    (note,) = bracket.notes
    assert all(words in note for words in said)
    assert ("ISO changes" in note, "aperture changes" in note) == (len(set(settings[1])) > 1, len(set(settings[2])) > 1)


def test_the_least_sensitive_photograph_keeps_its_time(write):
    settings = SETTINGS["only ISO"][:3]
    assert load_bracket(write(expose(exposures(*settings)), blocks(*settings))).times[0] == pytest.approx(1 / 60)


def test_an_iso_and_an_aperture_that_stay_are_not_mentioned(write):
    bracket = load_bracket(write(expose(SECONDS), blocks(SHUTTER, [400] * 5, [F4] * 5)))
    assert bracket.notes == ()
    np.testing.assert_allclose(bracket.times, SECONDS)


UNKNOWN = {
    "one ISO is missing": ((100, 200, None, 800, 1600), [F8] * 5),
    "one ISO is 65535": ((100, 200, 65535, 800, 1600), [F8] * 5),
    "one ISO is 0": ((100, 200, 0, 800, 1600), [F8] * 5),
    "one aperture is missing": ([100] * 5, (F8, F56, None, F4, F28)),
    "one aperture is f/0": ([100] * 5, (F8, F56, (0, 1), F4, F28)),
    "one aperture is 0/0": ([100] * 5, (F8, F56, (0, 0), F4, F28)),
    "all ISO are 65535": ([65535] * 5, [F8] * 5),
}


@pytest.mark.parametrize("isos, apertures", UNKNOWN.values(), ids=UNKNOWN.keys())
def test_iso_and_aperture_are_not_used_where(write, isos, apertures):
    bracket = load_bracket(write(expose(SECONDS), blocks(SHUTTER, isos, apertures)))
    np.testing.assert_allclose(bracket.times, SECONDS)
    assert bracket.notes == ()


@pytest.mark.parametrize("block", [exif_block(iso=65535), exif_block(iso=0), exif_block(f_number=(0, 1))])
def test_impossible_settings_count_as_unknown(block):
    assert read_exif(block) == Exif()


def test_an_aperture_is_used_where_iso_is_unknown(write):
    expected = exposures([SIXTIETH] * 3, [1] * 3, (F8, F56, F4))
    bracket = load_bracket(write(expose(expected), blocks([SIXTIETH] * 3, [None] * 3, (F8, F56, F4))))
    np.testing.assert_allclose(bracket.times / bracket.times[0], expected / expected[0])


VARIED = ((1, 400), (1, 160), (1, 60), (1, 25)), (100, 200, 200, 400), (F8, F8, F56, F56)


@pytest.mark.parametrize("in_exif", [True, False], ids=["times in EXIF too", "no times in EXIF"])
def test_listed_shutter_times_are_multiplied_by_what_exif_says_of_iso_and_aperture(write, in_exif):
    expected = exposures(*VARIED)
    shutter = VARIED[0] if in_exif else [None] * 4
    bracket = load_bracket(write(expose(expected), blocks(shutter, *VARIED[1:]), "1/400 1/160 1/60 1/25"))
    assert bracket.source == "the text file t.txt"
    np.testing.assert_allclose(bracket.times / bracket.times[0], expected / expected[0], rtol=1e-6)
    (note,) = bracket.notes
    assert "ISO changes from 100 to 400" in note


@pytest.mark.parametrize("settings", [SETTINGS["only ISO"][:3], SETTINGS["all three"][:3], VARIED])
@pytest.mark.parametrize("spell", ["exposures", "relative exposures", "1/exposures", "EV steps"])
def test_a_list_that_holds_exposures_already_is_not_multiplied_again(write, settings, spell):
    expected = exposures(*settings)
    relative = expected / expected[0]
    values = {
        "exposures": relative * settings[0][0][0] / settings[0][0][1],
        "relative exposures": relative,
        "1/exposures": 100 / relative,
        "EV steps": np.log2(relative) - 2,
    }[spell]
    text = "\n".join(f"{value:.4f}" for value in values)
    bracket = load_bracket(write(expose(expected), blocks(*settings), text))
    np.testing.assert_allclose(bracket.times / bracket.times[0], relative, rtol=0.01)
    assert doubts(bracket.notes) == []
    assert bracket.source == "the text file t.txt"


@pytest.mark.parametrize("power", [0.1, 0.2, 3])
def test_times_to_a_power_that_no_response_has_are_doubted(tmp_path, chapel, power):
    names = [f"a_{i}.png" for i in range(len(chapel))]
    for name, image in zip(names, chapel.images, strict=True):
        cv2.imwrite(str(tmp_path / name), image[..., ::-1])
    listed = "".join(f"{name} {t**power!r}\n" for name, t in zip(names, chapel.times.tolist(), strict=True))
    (tmp_path / "t.txt").write_text(listed)
    assert any("stops apart" in note for note in load_bracket(tmp_path).notes)


def test_an_edge_without_anything_between_room_and_clipped_window_raises_no_doubt(tmp_path):
    room = np.tile(np.linspace(0.02, 0.2, 96), (64, 1))
    room[20:40, 30:60] = 60.0  # a window with a hard edge
    times = [1 / 64, 1 / 16, 1 / 4, 1]
    for i, t in enumerate(times):
        value = np.rint(255 * np.clip(room * t * 4, 0, 1) ** (1 / 2.2)).astype(np.uint8)
        cv2.imwrite(str(tmp_path / f"a_{i}.png"), np.dstack([value] * 3))
    (tmp_path / "t.txt").write_text("1/64 1/16 1/4 1")
    assert load_bracket(tmp_path).notes == ()
