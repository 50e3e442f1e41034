"""Stage 1: exposure times from every source, and a sentence for everything that can't be used."""

import json
import unicodedata
import zipfile

import cv2
import numpy as np
import pytest
from photographs import write_with_exif

from hdr_helpers._reading.pictures import Exif, read_exif
from hdr_helpers.lab.exif import exif_block
from hdr_helpers.load import Bracket, BracketError, load_bracket

NAMES = ("a_1.png", "a_2.png", "a_3.png", "a_4.png")
TIMES = (1 / 400, 1 / 60, 1 / 10, 0.6)
KNOWN = dict(zip(NAMES, TIMES, strict=True))
LISTED = "".join(f"{name} {seconds}\n" for name, seconds in KNOWN.items())


def zipped(folder, target, inside="", also=()):
    with zipfile.ZipFile(target, "w") as archive:
        for name in also:
            archive.writestr(name, b"not a picture")
        for path in sorted(folder.rglob("*")):
            if path.is_file() and path != target:
                archive.write(path, inside + path.relative_to(folder).as_posix())
    return target


def assert_same(a, b):
    assert (a.names, a.source, a.notes) == (b.names, b.source, b.notes)
    assert np.array_equal(a.times, b.times)
    assert all(np.array_equal(x, y) for x, y in zip(a.images, b.images, strict=True))


# ------------------------------------------------------------------------------- sources of times

SPELLED = {
    "one line of seconds and fractions": ("t.txt", "1/400 1/60 0.1 0.6"),
    "one number a line": ("t.txt", "1/400\n1/60\n0.1\n0.6\n"),
    "one line of 1/seconds": ("t.txt", "400 60 10 1.6666667"),
    "names and seconds, in any order": ("t.txt", "# set\n" + "".join(LISTED.splitlines(keepends=True)[::-1])),
    "names and 1/seconds": ("t.txt", "4\n# name 1/t\n" + "".join(f"{n} {1 / t}\n" for n, t in KNOWN.items())),
    "names with another suffix": ("t.txt", LISTED.replace(".png", ".ppm")),
    "names and seconds, with commas": ("t.csv", LISTED.replace(" ", ",")),
    "a JSON object": ("t.json", json.dumps(KNOWN)),
    "a JSON list": ("t.json", json.dumps([{"file": n, "seconds": t} for n, t in KNOWN.items()])),
    "a JSON list, seconds first": ("t.json", json.dumps([{"t": t, "f": n} for n, t in KNOWN.items()][::-1])),
    "names, colons and seconds": ("t.txt", LISTED.replace(" ", ": ")),
    "names, equal signs and a unit": ("t.txt", LISTED.replace(" ", " = ").replace("\n", "s\n")),
    "seconds and names, in any order": ("t.txt", "0.6 a_4.png\n0.1 a_3.png\n1/400 a_1.png\n1/60 a_2.png\n"),
}


@pytest.mark.parametrize("text_file", SPELLED.values(), ids=SPELLED.keys())
def test_a_text_file_gives_the_times(save, small_bracket, text_file):
    bracket = load_bracket(save(NAMES, dict([text_file])))
    np.testing.assert_allclose(bracket.times, TIMES, rtol=1e-6)
    assert bracket.names == NAMES
    assert text_file[0] in bracket.source
    assert all(np.array_equal(a, b) for a, b in zip(bracket.images, small_bracket.images, strict=False))


def test_a_list_of_names_with_blanks_gives_each_photograph_its_own_time(save):
    names = [f"my photo ({i}).png" for i in (1, 2, 3, 4)]
    lines = [f"{name} {seconds}\n" for name, seconds in zip(names, TIMES, strict=True)]
    np.testing.assert_allclose(load_bracket(save(names, {"t.txt": "".join(lines[::-1])})).times, TIMES)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "gb18030"])
def test_a_list_may_be_saved_as_editors_save_it_names_in_chinese_included(save, encoding):
    names = [f"照片{i}.png" for i in (1, 2, 3, 4)]
    folder = save(names)
    lines = [f"{name} {seconds}\n" for name, seconds in zip(names, TIMES, strict=True)]
    (folder / "t.txt").write_text("".join(lines[::-1]), encoding=encoding)
    np.testing.assert_allclose(load_bracket(folder).times, TIMES)


def test_a_note_about_one_photograph_does_no_harm_to_the_list(save):
    bracket = load_bracket(save(NAMES, {"a_note.txt": "a_3.png is a bit blurred", "t.txt": LISTED}))
    np.testing.assert_allclose(bracket.times, TIMES)


def test_a_list_without_names_follows_the_natural_order_of_names(save, small_bracket):
    bracket = load_bracket(save(("shot_1.png", "shot_2.png", "shot_10.png"), {"t.txt": "1/400 1/60 1/10"}))
    assert bracket.names == ("shot_1.png", "shot_2.png", "shot_10.png")
    assert np.array_equal(bracket.images[2], small_bracket.images[2])


def test_stops_become_powers_of_two(save):
    bracket = load_bracket(save(NAMES, {"ev.txt": "-3\n0\n2.5\n5\n"}))
    np.testing.assert_allclose(bracket.times, [1 / 8, 1, 2**2.5, 32])
    assert "EV" in bracket.notes[0]


@pytest.mark.parametrize(
    "names, times",
    [
        (("img_0.033.png", "img_0.25.png", "img_2.5.png", "img_15.png"), (0.033, 0.25, 2.5, 15)),
        (("exp_1_1000.png", "exp_1_60.png", "exp_1_2.png", "exp_4_1.png"), (1 / 1000, 1 / 60, 1 / 2, 4)),
    ],
)
def test_file_names_give_the_times(save, names, times):
    bracket = load_bracket(save(names))
    assert bracket.names == names  # img_15 after img_2.5, though it sorts before it
    np.testing.assert_allclose(bracket.times, times)
    assert "names" in bracket.source


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
@pytest.mark.parametrize("order", "<>")
def test_exif_gives_the_times_in_both_byte_orders(tmp_path, small_bracket, order, suffix):
    for i, denominator in enumerate((400, 60, 10)):
        exif = exif_block(order, (1, denominator))
        write_with_exif(tmp_path / f"IMG_{i}{suffix}", small_bracket.images[i], exif)
    bracket = load_bracket(tmp_path)
    np.testing.assert_allclose(bracket.times, [1 / 400, 1 / 60, 1 / 10])
    assert "EXIF" in bracket.source


@pytest.mark.parametrize("cut", [0, 2, 7, 9, 20, 30, 44, 51])
def test_exif_cut_short_gives_no_time(cut):
    block = exif_block("<", (1, 3))
    assert read_exif(block).seconds == 1 / 3
    assert read_exif(block[:cut]) == Exif()


@pytest.mark.parametrize("fraction", [(0, 1), (1, 0), (0, 0)])
def test_exif_without_a_positive_time_gives_none(fraction):
    assert read_exif(exif_block(">", fraction)).seconds is None


def test_two_sources_that_disagree_are_noted_with_both_values(save):
    names = ("a_0.0025.png", "a_0.0167.png", "a_0.12.png", "a_0.6.png")
    bracket = load_bracket(save(names, {"t.txt": "1/400 1/60 1/10 0.6"}))
    (note,) = bracket.notes
    assert "a_0.12.png" in note
    assert "0.1 s by the text file t.txt" in note and "0.12 s by the file names" in note
    assert bracket.times[2] == 0.1


def test_a_common_factor_between_two_sources_means_relative_times_and_is_said_once(save):
    bracket = load_bracket(save(("a_0.01.png", "a_0.07.png", "a_0.4.png"), {"t.txt": "0.02 0.14 0.8"}))
    (note,) = bracket.notes
    assert "relative" in note and "0.5 times" in note
    np.testing.assert_allclose(bracket.times, (0.02, 0.14, 0.8))


@pytest.mark.parametrize("text", ["5", "null", '"a word"', "[1, 2]", "{", "{}"])
def test_a_json_file_about_something_else_does_no_harm(save, text):
    assert load_bracket(save(NAMES, {"settings.json": text, "times.txt": LISTED})).names == NAMES


ALSO = {
    "tabs and decimal commas": "a_1.png\t0,0025\na_2.png\t0,0167\na_3.png\t0,1\na_4.png\t0,6\n",
    "a CSV with quoted decimal commas": 'a_1.png,"0,0025"\na_2.png,"0,0167"\na_3.png,"0,1"\na_4.png,"0,6"\n',
    "a decimal comma a line": "0,0025\n0,0167\n0,1\n0,6\n",
    "full-width punctuation": "a_1.png：1/400\na_2.png：1/60\na_3.png，1/10\na_4.png，0.6\n",
    "typographic fractions": "1⁄400 1⁄60 1⁄10 0.6",
    "names without suffix and equal signs": "a_1=1/400\na_2=1/60\na_3=1/10\na_4=0.6\n",
    "ISO before the fraction": "a_1.png,100,1/400\na_2.png,200,1/60\na_3.png,400,1/10\na_4.png,800,6/10\n",
    "dates and times of day": "".join(f"{n},2024:04:05 12:30:{59 - i},{t}\n" for i, (n, t) in enumerate(KNOWN.items())),
}


@pytest.mark.parametrize("text", ALSO.values(), ids=ALSO.keys())
def test_a_list_may_also_be_written_with(save, text):
    np.testing.assert_allclose(load_bracket(save(NAMES, {"t.txt": text})).times, TIMES, rtol=0.01)


def test_seconds_as_cameras_show_them_are_read(save):
    bracket = load_bracket(save(("a_1.png", "a_2.png", "a_3.png"), {"t.txt": '0"3 1"8 10"'}))
    np.testing.assert_allclose(bracket.times, (0.3, 1.8, 10))


@pytest.mark.parametrize("key", ["iso", "f_number"])
def test_in_json_the_keys_say_which_number_is_the_time(save, key):
    rows = [{"file": n, key: 100 * 2**i, "exposure_time": t} for i, (n, t) in enumerate(KNOWN.items())]
    np.testing.assert_allclose(load_bracket(save(NAMES, {"t.json": json.dumps(rows)})).times, TIMES)


def test_signs_in_file_names_are_ev_steps(save):
    names = ("a_-2.5.png", "a_0.0.png", "a_+2.5.png", "a_+5.0.png")
    bracket = load_bracket(save(names))
    assert bracket.names == names
    np.testing.assert_allclose(bracket.times, [2**-2.5, 1, 2**2.5, 32])


def test_numbers_of_photographs_without_suffix_are_names(save):
    bracket = load_bracket(save(("1.png", "2.png", "3.png", "4.png"), {"t.txt": "1 1/400\n2 1/60\n3 1/10\n4 0.6\n"}))
    np.testing.assert_allclose(bracket.times, TIMES)


def test_a_name_in_another_unicode_form_is_the_same_name(save):
    composed, apart = "Küche", unicodedata.normalize("NFD", "Küche")
    folder = save([f"{apart}{i}.png" for i in range(4)])
    lines = "".join(f"{composed}{i}.png {t}\n" for i, t in enumerate(TIMES))
    (folder / "t.txt").write_text(lines, encoding="utf-8")
    np.testing.assert_allclose(load_bracket(folder).times, TIMES)


def test_1_over_t_is_recognised_though_two_photographs_are_equally_black(save, small_bracket):
    folder = save(("a_1.png", "a_2.png", "a_3.png"), {"t.txt": "4000 1000 1"})
    for name in ("a_1.png", "a_2.png"):
        cv2.imwrite(str(folder / name), np.zeros_like(small_bracket.images[0]))
    np.testing.assert_allclose(load_bracket(folder).times, (1 / 4000, 1 / 1000, 1))


def test_counters_with_a_decimal_point_give_way_to_exif(tmp_path, small_bracket):
    for name, image, denominator in zip(("12.30", "12.31", "12.33"), small_bracket.images, (400, 60, 10), strict=False):
        write_with_exif(tmp_path / f"Shot {name}.png", image, exif_block("<", (1, denominator)))
    bracket = load_bracket(tmp_path)
    np.testing.assert_allclose(bracket.times, (1 / 400, 1 / 60, 1 / 10))
    assert any(note.startswith("Not used: the file names") and "stops apart" in note for note in bracket.notes)


def test_one_photograph_without_exif_is_named(tmp_path, small_bracket):
    for i, denominator in enumerate((400, 60, 10)):
        write_with_exif(tmp_path / f"IMG_{i}.png", small_bracket.images[i], exif_block("<", (1, denominator)))
    cv2.imwrite(str(tmp_path / "result.png"), small_bracket.images[2])
    refused(tmp_path, "result.png", "1 of 4", "take it out")


def test_ev_steps_in_another_order_than_the_names_are_refused_with_the_order_that_was_read(save):
    folder = save(("a_2.png", "a_1.png", "a_3.png"), {"ev.txt": "-2 0 2"})  # shot as 0, -2, +2
    refused(folder, "ev.txt", "a_1.png -2, a_2.png 0", "beside the name")


@pytest.mark.parametrize("text", ["1/400 1/60 1/10", "1/400 1/60 1/10 0.6 4"])
def test_a_list_of_the_wrong_length_is_refused_with_both_numbers(save, text):
    refused(save(NAMES, {"t.txt": text}), "t.txt", f"{len(text.split())} numbers for 4 photographs", "a_1.png, a_2.png")


def test_a_list_beside_the_folder_of_photographs_is_read(save, tmp_path):
    save(NAMES, folder="images")
    (tmp_path / "shutter.txt").write_text(LISTED)
    np.testing.assert_allclose(load_bracket(tmp_path).times, TIMES)
    assert_same(load_bracket(zipped(tmp_path, tmp_path / "set.zip")), load_bracket(tmp_path))


# ------------------------------------------------------------------------------------ photographs


@pytest.mark.parametrize("inside", ["", "top/"])
def test_a_zip_gives_the_same_bracket_as_the_folder(save, tmp_path, inside):
    folder = save(NAMES, {"t.txt": LISTED})
    assert_same(load_bracket(zipped(folder, tmp_path / "set.zip", inside)), load_bracket(folder))


def test_what_macs_add_to_folders_and_zips_is_not_looked_at(save, tmp_path):
    folder = save(NAMES, {"t.txt": LISTED})
    plain = load_bracket(folder)
    (folder / "._a_1.png").write_bytes(b"not a picture")
    (folder / ".DS_Store").write_bytes(b"not a picture")
    assert_same(load_bracket(folder), plain)
    also = [f"__MACOSX/top/{name}" for name in (*NAMES, "._a_1.png")]
    assert_same(load_bracket(zipped(folder, tmp_path / "set.zip", "top/", also)), plain)


def test_photographs_come_in_ascending_time_whatever_their_names(save):
    bracket = load_bracket(save(("d_1.png", "c_1.png", "b_1.png"), {"t.txt": "d_1.png 1\nc_1.png 2\nb_1.png 4\n"}))
    assert bracket.names == ("d_1.png", "c_1.png", "b_1.png")
    assert [image.mean() for image in bracket.images] == sorted(image.mean() for image in bracket.images)


def test_colours_come_as_red_green_blue(tmp_path):
    for i, scale in enumerate((1, 2)):
        patch = np.full((8, 12, 3), (90, 40, 10), np.uint8) * scale
        (tmp_path / f"p_{i}.ppm").write_bytes(b"P6 12 8 255\n" + patch.tobytes())  # a PPM file holds RGB
    (tmp_path / "t.txt").write_text("1 2")
    assert load_bracket(tmp_path).images[1][3, 3].tolist() == [180, 80, 20]


def test_16_bit_photographs_keep_all_16_bits_and_give_the_upper_8_on_request(save, small_bracket):
    folder = save(NAMES, {"t.txt": LISTED})
    for name, image in zip(NAMES, small_bracket.images, strict=False):
        cv2.imwrite(str(folder / name), image[..., ::-1].astype(np.uint16) * 256 + 77)
    bracket = load_bracket(folder)
    for image, upper, expected in zip(bracket.images, bracket.in_8_bits().images, small_bracket.images, strict=False):
        assert np.array_equal(image, expected.astype(np.uint16) * 256 + 77)
        assert upper.dtype == np.uint8 and np.array_equal(upper, expected)


# -------------------------------------------------------------------------------------- bad input


def refused(path, *words):
    with pytest.raises(BracketError) as problem:
        load_bracket(path)
    for word in words:
        assert word in str(problem.value)


def test_equal_times_are_refused_with_both_names(save):
    refused(save(NAMES, {"t.txt": "1/400 1/60 1/60 0.6"}), "a_2.png", "a_3.png", "0.01667 s", "not equally bright")


def test_times_that_do_not_fit_the_brightness_are_refused(save):
    refused(save(NAMES, {"t.txt": "0.1 0.6 1/400 1/60"}), "t.txt", "brighter")


def test_fractions_and_exif_are_seconds_and_are_never_turned_into_their_inverse(save, tmp_path, small_bracket):
    refused(save(NAMES, {"t.txt": "0.6 0.1 1/60 1/400"}), "do not get brighter")
    folder = tmp_path / "exif"
    folder.mkdir()
    for name, image, fraction in zip(NAMES, small_bracket.images, ((6, 10), (1, 10), (1, 60), (1, 400)), strict=False):
        write_with_exif(folder / name, image, exif_block("<", fraction))
    refused(folder, "EXIF", "do not get brighter")


def test_a_source_that_can_not_be_true_gives_way_to_one_that_can_and_is_noted(save):
    names = [f"img_{seconds:.4f}.png" for seconds in TIMES]
    shuffled = "".join(f"{name} {TIMES[i]}\n" for name, i in zip(names, (2, 0, 3, 1), strict=True))
    bracket = load_bracket(save(names, {"t.txt": shuffled}))
    assert bracket.source == "the file names"
    np.testing.assert_allclose(bracket.times, TIMES, rtol=0.01)
    assert any("t.txt" in note and "do not get brighter" in note for note in bracket.notes)


def test_a_list_without_one_photograph_gives_way_to_a_source_that_knows_all_and_is_noted(save):
    names = [f"img_{seconds:.4f}.png" for seconds in TIMES]
    bracket = load_bracket(save(names, {"t.txt": f"{names[0]} 1/400"}))
    assert bracket.source == "the file names"
    assert any(names[1] in note for note in bracket.notes)


def test_no_times_at_all_are_refused_with_an_example(save):
    refused(save(NAMES, {"read.txt": "taken from a tripod"}), "No exposure times", "read.txt", "1/60")


@pytest.mark.parametrize("times", [(1, np.nan), (-1, 1), (0, 1), (1, np.inf), (1, 1), (2, 1)])
def test_a_bracket_refuses_times_that_are_not_positive_and_ascending(small_bracket, times):
    with pytest.raises(BracketError, match="positive and strictly ascending"):
        Bracket(small_bracket.images[:2], times, ("a", "b"))


def test_a_bracket_refuses_unequal_counts(small_bracket):
    with pytest.raises(BracketError, match="2 images, 3 times and 2 names"):
        Bracket(small_bracket.images[:2], (1, 2, 3), ("a", "b"))


@pytest.mark.parametrize("bits", [10, 12, 14])
def test_16_bit_files_that_hold_fewer_bits_are_spread_over_all_16_and_it_is_said(save, small_bracket, bits):
    folder = save(NAMES, {"t.txt": LISTED})
    images = [image.astype(np.uint16) << (bits - 8) for image in small_bracket.images]
    for name, image in zip(NAMES, images, strict=False):
        cv2.imwrite(str(folder / name), image[..., ::-1])
    bracket = load_bracket(folder)
    assert f"{bits} bits" in bracket.notes[0]
    assert np.array_equal(bracket.images[3], images[3] << (16 - bits))


def test_a_bracket_keeps_its_times_whatever_happens_to_the_array_they_came_from(small_bracket):
    times = np.array([1.0, 2.0])
    bracket = Bracket(small_bracket.images[:2], times, ("a", "b"))
    times[0] = 99
    assert bracket.times.tolist() == [1, 2]
    with pytest.raises(ValueError, match="read-only"):
        bracket.times[0] = 99


@pytest.mark.parametrize("change", [np.float32, lambda image: image[..., 0]], ids=["floats", "grey"])
def test_a_bracket_refuses_images_of_another_kind(small_bracket, change):
    with pytest.raises(BracketError, match="uint8 or uint16"):
        Bracket([change(image) for image in small_bracket.images[:2]], (1, 2), ("a", "b"))


def test_what_is_no_path_is_refused():
    refused(None, "None", "folder or zip")


# ---------------------------------------------------------------------------------- real cameras

REAL = {
    "hdr": (0.033, 0.25, 2.5, 15),
    "exposures": (1 / 1002, 1 / 403, 1 / 318, 1 / 79, 1 / 60, 1 / 4, 1 / 3, 0.81, 1, 3.22, 4, 9.93, 12.88),
    "memorial": tuple(2.0 ** np.arange(-10, 6)),
    "frobisher": (1 / 8, 1, 8),
}


@pytest.mark.parametrize("name", REAL)
def test_real_brackets_load_with_their_times_from_folder_and_zip(real, tmp_path, name):
    bracket = load_bracket(real(name))
    np.testing.assert_allclose(bracket.times, REAL[name], rtol=1e-6)
    assert_same(load_bracket(zipped(real(name), tmp_path / "set.zip", f"{name}/")), bracket)


def test_a_text_that_rounds_otherwise_than_exif_is_noted(real):
    (note,) = load_bracket(real("exposures")).notes
    assert "0.3333 s" in note and "0.3 s" in note
