"""Stage 1: lists of exposure times as they are met in the wild, times in file names, and whatever else lies there."""

import json
import tracemalloc
from pathlib import Path

import cv2
import numpy as np
import pytest

from hdr_helpers._reading.lists import text_values
from hdr_helpers._reading.names import name_values, whole_number_names
from hdr_helpers.load import BracketError, load_bracket

REAL = Path(__file__).parents[2] / "shared" / "exposure_files"
JPEG = [cv2.IMWRITE_JPEG_QUALITY, 100, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]


def expose(times, shape=(48, 64)):
    """One RGB picture for each time, of a scene that is never all dark or all white."""
    low, high = np.log2(0.02 / max(times)), np.log2(1.5 / min(times))
    levels = np.random.default_rng(7).permutation(np.linspace(low, high, shape[0] * shape[1]))
    radiance = np.exp2(levels).reshape(shape)[..., None] * (0.8, 1.0, 1.2)
    return [np.round(255 * np.clip(radiance * t, 0, 1) ** (1 / 2.2)).astype(np.uint8) for t in times]


@pytest.fixture
def shoot(tmp_path):
    """shoot({name: time}, {text file: text}) writes a bracket and its lists; returns the folder."""

    def shoot(truth, texts=None, folder="photographs", shape=(48, 64)):
        folder = tmp_path / folder
        folder.mkdir()
        for name, image in zip(truth, expose(list(truth.values()), shape), strict=True):
            suffix = "." + name.lower().split(".")[-1]
            _, data = cv2.imencode(suffix, image[..., ::-1], JPEG if suffix in (".jpg", ".jpeg") else [])
            (folder / name).write_bytes(data.tobytes())
        for name, text in (texts or {}).items():
            (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
        return folder

    return shoot


def assert_loads(folder, truth, said=None):
    """The bracket has these times, up to one factor if they are said to be relative, and each its own picture."""
    bracket = load_bracket(folder)
    names = sorted(truth, key=truth.get)
    times = np.array([truth[name] for name in names])
    assert list(bracket.names) == names
    factor = bracket.times[-1] / times[-1] if said == "relative" else 1
    np.testing.assert_allclose(bracket.times, factor * times, rtol=1e-3)
    for image, shot, name in zip(bracket.images, expose(times), names, strict=True):
        if name.lower().endswith((".jpg", ".jpeg")):
            assert abs(image.mean() - shot.mean()) < 0.1
        else:
            assert np.array_equal(image, shot)
    means = [image.mean() for image in bracket.images]
    assert means == sorted(set(means))
    assert [said in note for note in bracket.notes] == [True] if said else not bracket.notes


def refused(path, *words):
    with pytest.raises(BracketError) as problem:
        load_bracket(path)
    for word in words:
        assert word in str(problem.value)


# -------------------------------------------------------------------------- lists met in the wild


def numbered(pattern, first, times):
    return {pattern.format(i): t for i, t in enumerate(times, first)}


THIRTEEN = (13, 10, 4, 3.2, 1, 0.8, 1 / 3, 1 / 4, 1 / 60, 1 / 80, 1 / 320, 1 / 400, 1 / 1000)
SECONDS_OF_THE_DAY = (1, 6, 9, 12, 15, 17, 20, 22, 25, 28, 32, 35, 38)
RELATIVE = (4, 3.482, 2.828, 2.462, 1.741, 1.414, 1.0718, 0.8123, 0.7071, 0.5743, 0.4061, 0.3536, 0.2872)

IN_THE_WILD = {
    "debevec_list.txt": (numbered("memorial{:04}.png", 61, 2.0 ** np.arange(5, -11, -1)), "1/seconds"),
    "debevec_list_wrong_count.txt": (
        numbered("_C4A{}.JPG", 1566, (1 / 125, 1 / 60, 1 / 30, 1 / 15, 1 / 6, 0.3, 0.6, 1, 2, 4, 8)),
        "1/seconds",
    ),
    "debevec_list_cut_header.txt": (
        numbered("IMG_{}.jpeg", 3869, (1 / 250, 1 / 120, 1 / 60, 1 / 30, 1 / 15, 1 / 8, 1 / 4, 1 / 2, 1)),
        "1/seconds",
    ),
    "name_inverse.txt": (numbered("memorial{:02}.png", 0, 2.0 ** np.arange(5, -11, -1)), "1/seconds"),
    "path_inverse.txt": (numbered("img{:02}.jpg", 1, THIRTEEN), "1/seconds"),
    "name_seconds.txt": (numbered("img{}.JPG", 0, (15, 2.5, 1 / 4, 0.0333)), None),
    "name_seconds_inverse.txt": (numbered("DSC_{:04}.png", 104, 2.0 ** np.arange(5, -8, -1)), None),
    "header_promises_two_columns.txt": (
        numbered("{:02}.bmp", 1, (1 / 500, 1 / 250, 1 / 125, 1 / 60, 1 / 30, 1 / 15, *2.0 ** np.arange(-3, 4), 15)),
        None,
    ),
    "name_fraction.txt": (
        numbered("boya{:02}.JPG", 1, (1 / 250, 1 / 125, 1 / 60, 1 / 30, 1 / 15, *2.0 ** np.arange(-3, 4))),
        None,
    ),
    "bare_lines.txt": (numbered("img{:02}.png", 1, 2.0 ** np.arange(5, -11, -1)), None),
    "bare_fractions_crlf.txt": (numbered("img{:02}.png", 1, (4, 2, 1, 1 / 2, 1 / 4)), None),
    "one_line_seconds.txt": (
        numbered(
            "img{:02}.png",
            1,
            (12.88, 9.93, 4, 3.22, 1, 0.81, 1 / 3, 1 / 4, 1 / 60, 1 / 79, 1 / 318, 1 / 403, 1 / 1002),
        ),
        None,
    ),
    "one_line_inverse.txt": (numbered("img{:02}.png", 1, THIRTEEN), "1/seconds"),
    "comma_seconds.txt": (
        {
            "DSCF6037.jpg": 0.00156,
            "DSCF6036.jpg": 1 / 500,
            "DSCF6035.jpg": 1 / 400,
            "DSCF6034.jpg": 0.00313,
            "DSCF6033.jpg": 1 / 250,
            "DSCF6032.jpg": 1 / 200,
            "DSCF6031.jpg": 1 / 160,
            "DSCF6030.jpg": 1 / 125,
            "DSCF6038.jpg": 1 / 100,
            "DSCF6039.jpg": 1 / 80,
            "DSCF6040.jpg": 1 / 60,
            "DSCF6041.jpg": 1 / 50,
            "DSCF6042.jpg": 1 / 40,
            "DSCF6043.jpg": 1 / 30,
        },
        None,
    ),
    "header.csv": (numbered("{:04}.JPG", 11, (4, 2, 1, 1 / 2, 1 / 4)), None),
    "settings_and_table.txt": (
        {f"20240401_1757{s:02}.JPG": t for s, t in zip(SECONDS_OF_THE_DAY, RELATIVE, strict=True)},
        None,
    ),
    "ev_stops.txt": (numbered("img{:02}.png", 1, (1, 4, 16)), "relative"),
    "bare_relative.txt": (numbered("img{:02}.png", 1, (1 / 4, 1 / 2, 1)), None),
    "comma_inverse_then_ev.txt": (
        numbered("img{:02}.png", 1, (1 / 320, 1 / 160, 1 / 80, 1 / 40, 1 / 20)),
        "1/seconds",
    ),
    "list_seconds.json": (numbered("img{:02}.jpg", 1, THIRTEEN), None),
    "dict_inverse.json": (
        numbered("original_{}.jpg", 0, (1 / 25, 1 / 50, 1 / 100, 1 / 200, 1 / 400, 1 / 800)),
        "1/seconds",
    ),
}


@pytest.fixture
def in_the_wild():
    """in_the_wild(name) is what an exposure file of others holds, as bytes."""

    def in_the_wild(name):
        if not REAL.is_dir():
            pytest.skip(f"The exposure files of others are not part of this repository; {REAL} is absent.")
        return (REAL / name).read_bytes()

    return in_the_wild


@pytest.mark.parametrize("name", IN_THE_WILD)
def test_a_list_in_the_wild_gives_each_photograph_its_own_time(in_the_wild, shoot, name):
    truth, said = IN_THE_WILD[name]
    assert_loads(shoot(truth, {name: in_the_wild(name)}), truth, said)


def test_a_list_in_the_wild_with_two_equal_times_is_refused_with_both_names(in_the_wild, shoot):
    listed = in_the_wild("duplicate_times.csv")
    truth = {
        "IMG_4149.jpg": 0.000268,
        "IMG_4150.jpg": 0.000268,
        "IMG_4151.jpg": 0.000475,
        "IMG_4152.jpg": 0.001045,
        "IMG_4153.jpg": 0.003448,
        "IMG_4154.JPG": 0.008197,
    }
    refused(shoot(truth, {"t.csv": listed}), "IMG_4149.jpg and IMG_4150.jpg have the same exposure time")


def test_every_list_in_the_wild_is_tried(in_the_wild):
    in_the_wild("README.md")
    found = {path.name for path in REAL.iterdir()} - {"README.md"}
    assert found == {*IN_THE_WILD, "duplicate_times.csv"}


# ------------------------------------------------------------------------- the same, written anew

FOUR = (1 / 200, 1 / 25, 1 / 4, 3)
ROOM = numbered("room_{}.png", 1, FOUR)
ROOM_DARKER = numbered("room_{}.png", 1, FOUR[::-1])

FORMS = {
    "a long table of 1/seconds, its count in a comment, with names that end otherwise": (
        "hall.txt",
        "# Number of Images\n4\n# Filename  1/shutter_speed f/stop gain(db) ND_filters\n"
        "room_1.ppm 200  5.6 0 0\nroom_2.ppm 25   5.6 0 0\nroom_3.ppm 4    5.6 0 0\nroom_4.ppm 0.333333 5.6 0 0\n",
        ROOM,
        "1/seconds",
    ),
    "a long table of 1/seconds that miscounts its rows": (
        "hall.txt",
        "# Number of Images\n9\n# Filename  1/shutter_speed f/stop gain(db) ND_filters\n"
        "room_1.png 0.333333  4 0 0\nroom_2.png 4 4 0 0\nroom_3.png 25 4 0 0\nroom_4.png 200 4 0 0\n",
        ROOM_DARKER,
        "1/seconds",
    ),
    "names and 1/seconds below a heading": (
        "list.txt",
        "# Number of Images\n4\n# Filename  1/shutter_speed\n"
        "room_1.png 200\nroom_2.png 25\nroom_3.png 4\nroom_4.png 0.333333\n",
        ROOM,
        "1/seconds",
    ),
    "names and 1/seconds": (
        "list.txt",
        "room_1.png 0.333333\nroom_2.png 4\nroom_3.png 25\nroom_4.png 200\n",
        ROOM_DARKER,
        "1/seconds",
    ),
    "paths and 1/seconds": (
        "list.txt",
        "./room/room_1.png 0.333333\r\n./room/room_2.png 4.0\r\n./room/room_3.png 25.0\r\n./room/room_4.png 200.0\r\n",
        ROOM_DARKER,
        "1/seconds",
    ),
    "paths of another system and 1/seconds": (
        "list.txt",
        "D:\\room\\room_1.png 0.333333\nD:\\room\\room_2.png 4\nD:\\room\\room_3.png 25\nD:\\room\\room_4.png 200\n",
        ROOM_DARKER,
        "1/seconds",
    ),
    "paths with numbers, which are no fractions, and 1/seconds": (
        "list.txt",
        "set1/01.png 200\nset1/02.png 25\nset1/03.png 4\nset1/04.png 0.333333\n",
        numbered("{:02}.png", 1, FOUR),
        "1/seconds",
    ),
    "names in other case and seconds": (
        "list.txt",
        "yard0.bmp 3.0\r\nyard1.bmp 0.25\r\nyard2.bmp 0.04\r\nyard3.bmp 0.005",
        numbered("yard{}.BMP", 0, FOUR[::-1]),
        None,
    ),
    "names, seconds and 1/seconds": (
        "list.txt",
        "# Filename   exposure 1/shutter_speed\n"
        "room_1.png 3       0.333333\nroom_2.png 0.25        4\nroom_3.png 0.04      25\nroom_4.png 0.005   200\n",
        ROOM_DARKER,
        None,
    ),
    "names and seconds below a heading that promises more": (
        "list.txt",
        "# Filename   exposure 1/shutter_speed\n"
        "room_1.png 0.005     \nroom_2.png 0.04      \nroom_3.png 0.25\nroom_4.png 3",
        ROOM,
        None,
    ),
    "names and fractions": (
        "list.txt",
        "room_1.png 1/200\nroom_2.png 1/25\nroom_3.png 1/4\nroom_4.png 3\n",
        ROOM,
        None,
    ),
    "a number a line": ("list.txt", "3\n1/4\n1/25\n1/200", ROOM_DARKER, None),
    "a fraction a line": (
        "list.txt",
        "8/1\r\n2/1\r\n1/2\r\n1/8",
        numbered("room_{}.png", 1, (8, 2, 1 / 2, 1 / 8)),
        None,
    ),
    "seconds on one line": ("list.txt", "3 0.25 1/25 1/200\n", ROOM_DARKER, None),
    "1/seconds on one line": ("list.txt", "0.333333 4 25 200\n", ROOM_DARKER, "1/seconds"),
    "names and seconds with commas, in no order": (
        "list.txt",
        "room_3.png,0.25000\nroom_2.png,0.04000\nroom_1.png,0.00500 \nroom_4.png,3.00000 \n",
        ROOM,
        None,
    ),
    "a table with a heading": (
        "list.csv",
        "filename,shutter_time\r\nroom_1.png,3.0\r\nroom_2.png,0.25\r\nroom_3.png,0.04\r\nroom_4.png,0.005\r\n",
        ROOM_DARKER,
        None,
    ),
    "settings, and a table below": (
        "settings.txt",
        "MODE=FAST\nFIRST=2     # image to begin with\nSMOOTH=35  # of the curve\n\n# pictures      exposure\n"
        "20230905_081502.png   6.2\n20230905_081507.png   1.9\n20230905_081511.png   0.75\n",
        {"20230905_081502.png": 6.2, "20230905_081507.png": 1.9, "20230905_081511.png": 0.75},
        None,
    ),
    "an EV step a line": ("list.txt", "-4\r\n-1\r\n2", numbered("room_{}.png", 1, (1 / 16, 1 / 2, 4)), "relative"),
    "a relative exposure a line": ("list.txt", "0.2\n1.0\n6.0\n", numbered("room_{}.png", 1, (0.2, 1, 6)), None),
    "1/seconds on one line, and EV steps on the next": (
        "list.txt",
        "640,160,40,10\r\n-3,-1,1,3",
        numbered("room_{}.png", 1, (1 / 640, 1 / 160, 1 / 40, 1 / 10)),
        "1/seconds",
    ),
    "a JSON list of paths and seconds": (
        "list.json",
        '[\n\t{\n\t\t"path":"room_1.png",\n\t\t"t": 3\n\t},\n\t{\n\t\t"path":"room_2.png",\n\t\t"t": 0.25\n\t},{\n'
        '\t\t"path":"room_3.png",\n\t\t"t": 0.04\n\t},\n\t{\n\t\t"path":"room_4.png",\n\t\t"t": 5e-3\n\t}\n]\n',
        ROOM_DARKER,
        None,
    ),
    "a JSON object of names and 1/seconds": (
        "list.json",
        '{\n  "room_1.png": 200,\n  "room_2.png": 25,\n  "room_3.png": 4,\n  "room_4.png": 0.333333\n}\n',
        ROOM,
        "1/seconds",
    ),
    "a JSON object of names and fractions": (
        "list.json",
        '{"room_1.png": "1/200", "room_2.png": "1/25", "room_3.png": "1/4", "room_4.png": 3}',
        ROOM,
        None,
    ),
    "a count in front of the names": (
        "list.txt",
        "4\nroom_1.png 1/200\nroom_2.png 1/25\nroom_3.png 1/4\nroom_4.png 3\n",
        ROOM,
        None,
    ),
    "a count in front of the numbers": ("list.txt", "4\n200\n25\n4\n0.333333\n", ROOM, "1/seconds"),
    "milliseconds and seconds, the unit apart": (
        "list.txt",
        "room_1.png 5 ms\nroom_2.png 40 ms\nroom_3.png 250ms\nroom_4.png 3 s\n",
        ROOM,
        None,
    ),
    "milliseconds without names": ("list.txt", "5 ms\n40 ms\n250 ms\n3000 ms\n", ROOM, None),
    "milliseconds with a decimal point": (
        "list.txt",
        "room_1.png 16.7 ms\nroom_2.png 66.7 ms\n",
        numbered("room_{}.png", 1, (0.0167, 0.0667)),
        None,
    ),
    "names without their suffix": ("list.txt", "room_1 1/200\nroom_2 1/25\nroom_3 1/4\nroom_4 3\n", ROOM, None),
    "the time in the second of three columns, by their titles": (
        "list.txt",
        "# Filename f/stop shutter iso\n"
        "room_1.png 8 1/200 100\nroom_2.png 8 1/25 100\nroom_3.png 8 1/4 100\nroom_4.png 8 3 100\n",
        ROOM,
        None,
    ),
    "aperture and ISO, always the same, in front of 1/seconds": (
        "list.txt",
        "room_1.png 8 100 200\nroom_2.png 8 100 25\nroom_3.png 8 100 4\nroom_4.png 8 100 0.333333\n",
        ROOM,
        "1/seconds",
    ),
    "an index in front of the names": (
        "list.csv",
        "1,room_1.png,1/200\n2,room_2.png,1/25\n3,room_3.png,1/4\n4,room_4.png,3\n",
        ROOM,
        None,
    ),
    "an index after the names, by its title": (
        "list.csv",
        "name,index,time\nroom_1.png,1,0.005\nroom_2.png,2,0.04\nroom_3.png,3,0.25\nroom_4.png,4,3\n",
        ROOM,
        None,
    ),
    "an index after the names, without a title": (
        "list.csv",
        "room_1.png,1,0.005\nroom_2.png,2,0.04\nroom_3.png,3,0.25\nroom_4.png,4,3\n",
        ROOM,
        None,
    ),
    "an index in a JSON list, by its key": (
        "list.json",
        json.dumps([{"file": n, "index": i, "seconds": t} for i, (n, t) in enumerate(ROOM.items(), 1)]),
        ROOM,
        None,
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_list_of_any_common_form_gives_each_photograph_its_own_time(shoot, form):
    file, text, truth, said = FORMS[form]
    folder = shoot(truth, {file: text})
    assert_loads(folder, truth, said)
    assert file in load_bracket(folder).source


def test_a_list_with_two_equal_times_is_refused_with_both_names(shoot):
    text = "filename,shutter_time\r\nroom_1.png,0.004\r\nroom_2.png,0.05\r\nroom_3.png,0.05\r\nroom_4.png,1.5\r\n"
    truth = numbered("room_{}.png", 1, (0.004, 0.05, 0.05, 1.5))
    refused(shoot(truth, {"list.csv": text}), "room_2.png and room_3.png have the same exposure time", "alike")


def test_a_list_whose_aperture_changes_is_refused_with_its_title(shoot):
    text = "# name aperture shutter\nroom_1.png 8 1/200\nroom_2.png 8 1/25\nroom_3.png 8 1/4\nroom_4.png 2.8 3\n"
    refused(shoot(ROOM, {"list.txt": text}), "list.txt", "aperture", "changes")


@pytest.mark.parametrize("text", ["1 60\n2 15\n", "1 60\n2 15\n3 4\n", "60 1\n15 2\n4 3\n"])
def test_an_index_beside_numbers_without_names_is_refused_or_left_out(shoot, text):
    truth = numbered("room_{}.png", 1, (1 / 60, 1 / 15, 1 / 4)[: text.count("\n")])
    folder = shoot(truth, {"list.txt": text})
    try:
        bracket = load_bracket(folder)
    except BracketError:
        return
    np.testing.assert_allclose(bracket.times, list(truth.values()))


NAMES = {
    "seconds after a word": (
        {"yard_0.04.jpg": 0.04, "yard_0.3.jpg": 0.3, "yard_2.5.jpg": 2.5, "yard_20.jpg": 20},
        None,
    ),
    "seconds after a letter": ({"t0.0078.jpg": 0.0078, "t0.125.jpg": 0.125, "t2.jpg": 2}, None),
    "seconds after a counter": (
        {"DSC_0417_shutter_0.005.jpg": 0.005, "DSC_0418_shutter_0.066667.jpg": 1 / 15, "DSC_0419_shutter_1.jpg": 1},
        None,
    ),
    "seconds and their unit": ({"yard_0.04s.png": 0.04, "yard_0.5s.png": 0.5, "yard_6s.png": 6}, None),
    "fractions after a word": (
        {"door_exp_1_250.jpg": 1 / 250, "door_exp_1_30.jpg": 1 / 30, "door_exp_1_2.jpg": 1 / 2},
        None,
    ),
    "fractions alone": ({"1_640.jpg": 1 / 640, "1_80.jpg": 1 / 80, "1_5.jpg": 1 / 5, "2_1.jpg": 2}, None),
    "1/seconds alone": ({"1250.jpg": 1 / 1250, "204.jpg": 1 / 204, "38.jpg": 1 / 38, "7.jpg": 1 / 7}, "1/seconds"),
    "EV steps": (
        {"DoorExpEV-5.31.jpg": 2**-5.31, "DoorExpEV-0.5.jpg": 2**-0.5, "DoorExpEV+3.17.jpg": 2**3.17},
        "relative",
    ),
}


@pytest.mark.parametrize("form", NAMES)
def test_a_file_name_of_any_common_form_gives_the_time(shoot, form):
    truth, said = NAMES[form]
    folder = shoot(truth)
    assert_loads(folder, truth, said)
    assert load_bracket(folder).source == "the file names"


# ------------------------------------------------------------------- numbers that are no times

NO_TIMES = {
    "1, 2, 3": ("1", "2", "3"),
    "10, 20, 30": ("10", "20", "30"),
    "1, 2, 4, 5, one having been deleted": ("1", "2", "4", "5"),
    "3869, 3870, 3872, one having been deleted": ("3869", "3870", "3872"),
    "counters with zeros": ("0104", "0105", "0107"),
    "a word and a counter": ("DSC_0104", "DSC_0105", "DSC_0107"),
    "two counters": ("set_1_1", "set_1_2", "set_1_3"),
    "two counters, the first growing": ("set_1_1", "set_2_1", "set_3_1"),
    "counters in brackets": ("yard (1)", "yard (2)", "yard (3)"),
    "counters after a version": ("v2.5_1", "v2.5_2", "v2.5_3"),
    "revisions": ("rev1", "rev2", "rev3"),
    "dates": ("20240405", "20240406", "20240407"),
    "dates and counters": ("20240405_1", "20240405_2", "20240405_3"),
    "dates with hyphens": ("2024-04-05", "2024-04-06", "2024-04-07"),
    "dates with dots": ("2024.04.05", "2024.04.06", "2024.04.07"),
    "dates and times of day": ("20240405_081501", "20240405_081506", "20240405_081509"),
    "dates and times of day with dots": ("2024-04-05 08.15.01", "2024-04-05 08.15.06", "2024-04-05 08.15.09"),
}


@pytest.mark.parametrize("stops", [0.5, 2, 9])
@pytest.mark.parametrize("names", NO_TIMES)
def test_counters_and_dates_are_not_read_as_times_whether_brighter_or_darker(shoot, names, stops):
    names = [f"{name}.png" for name in NO_TIMES[names]]
    times = 2.0 ** (stops * np.arange(len(names)))
    for folder, order in (("brighter", 1), ("darker", -1)):
        refused(shoot(dict(zip(names, times[::order], strict=True)), folder=folder), "No exposure times")


# --------------------------------------------------------------------------------- disagreement


@pytest.mark.parametrize("factor", [0.9, 1.12])
def test_a_name_that_disagrees_with_the_list_beyond_rounding_is_noted_with_both_values(shoot, factor):
    times = (0.01, 0.08, 0.5 * factor, 4)
    truth = {"yard_0.01.png": 0.01, "yard_0.08.png": 0.08, "yard_0.5.png": 0.5, "yard_4.png": 4}
    bracket = load_bracket(shoot(truth, {"t.txt": "".join(f"{n} {t}\n" for n, t in zip(truth, times, strict=True))}))
    (note,) = bracket.notes
    assert "yard_0.5.png" in note
    assert f"{0.5 * factor:.4g} s by the text file t.txt" in note and "0.5 s by the file names" in note
    np.testing.assert_allclose(bracket.times, times)


def test_two_names_that_disagree_with_the_list_beyond_rounding_are_both_noted(shoot):
    truth = {f"yard_{t}.png": t for t in (0.01, 0.04, 0.16, 0.64, 2.56)}
    bracket = load_bracket(shoot(truth, {"t.txt": "0.01 0.044 0.16 0.57 2.56"}))
    assert [note.split(":")[0] for note in bracket.notes] == ["yard_0.04.png", "yard_0.64.png"]
    assert "0.044 s" in bracket.notes[0] and "0.04 s" in bracket.notes[0]
    assert "0.57 s" in bracket.notes[1] and "0.64 s" in bracket.notes[1]


@pytest.mark.parametrize("factor", [0.96, 1.04])
def test_a_name_that_rounds_otherwise_than_the_list_is_not_noted(shoot, factor):
    truth = {"yard_0.01.png": 0.01, "yard_0.08.png": 0.08, "yard_0.5.png": 0.5, "yard_4.png": 4}
    bracket = load_bracket(shoot(truth, {"t.txt": f"0.01 {0.08 * factor} 0.5 4"}))
    assert bracket.notes == ()
    np.testing.assert_allclose(bracket.times, (0.01, 0.08 * factor, 0.5, 4))


def test_a_list_that_the_photographs_contradict_gives_way_to_the_names_and_is_noted_with_its_value(shoot):
    truth = {f"yard_{t}.png": t for t in (0.01, 0.04, 0.16, 0.64, 2.56)}
    bracket = load_bracket(shoot(truth, {"t.txt": "0.01 0.04 0.5 0.64 2.56"}))
    assert bracket.source == "the file names"
    np.testing.assert_allclose(bracket.times, list(truth.values()))
    assert "Not used" in bracket.notes[0] and "yard_0.16.png: 0.5 s by the text file t.txt" in bracket.notes[0]
    assert "yard_0.16.png: 0.16 s by the file names, 0.5 s by the text file t.txt." in bracket.notes


# ------------------------------------------------------------------------------------- nonsense

HUGE = str(10**400)
WORDS = [
    *("a.png", "b.png", "c.png", "a", "b.PNG", "x/c.png", "x\\c.png", ".png", "d.jpg", "a.png.png", "/", "\\", "."),
    *("0", "1", "2", "3", "60", "0.5", "-1", "+2", "1e999", "1e-320", "1e308", "inf", "nan", "1_000", "0x10", HUGE),
    *("1/60", "1/0", "0/0", "1//2", "1/2/3", "/5", "5/", "1/inf", "1/1e-320", "１/６０", "٣", "½", "²"),
    *("5s", "5 ms", "16.7ms", "5 秒", "毫秒", "5ſ", "5 ſec", "5 S", "5 MS", "EV", "EV-2", "EV 3", "iso", "shutter"),
    *("# a shutter", "name time", "照片", "é", "\ufeff", "\0", "\x0b", "\x85", "\u2028", "\x1b", "\U0001f4f7"),
    *("[", "]", "{", "}", '"', "'", ":", ",", ";", "=", "|", "#", "null", "true", "NaN", "Infinity", '"a.png": 1'),
]
GAPS = [" ", " ", " ", "\n", "\n", "\n", "\r\n", "\t", ",", ";", ":", "="]
SAMPLES = [(text.encode(), [*truth]) for _, text, truth, _ in FORMS.values()]
THREE = ["a.png", "b.png", "c.png"]
NESTED = [
    opening * depth + b"1" + closing * depth
    for opening, closing in ((b"[", b"]"), (b'{"a.png":', b"}"), (b'[{"a.png":', b"}]"))
    for depth in (3, 150, 300, 450, 480, 490, 495, 960, 975, 985, 990, 995, 20_000)
]


def pick(rng, choices):
    return choices[rng.integers(len(choices))]


def number(rng):
    """Mostly what a list may hold, now and then any word."""
    value = 2.0 ** rng.integers(-12, 6)
    return pick(rng, WORDS) if rng.random() < 0.2 else pick(rng, [f"{value:.4g}", f"1/{1 / value:.0f}", f"{value} s"])


def any_bytes(rng):
    return rng.bytes(rng.integers(120)), THREE


def any_words(rng):
    return "".join(pick(rng, WORDS) + pick(rng, GAPS) for _ in range(rng.integers(1, 14))).encode(), THREE


def any_table(rng):
    """A line for each photograph, with a name and one number or two, or without; mostly of one form."""
    named, gap, columns = rng.random() < 0.7, pick(rng, GAPS), rng.integers(1, 3)
    lines = [[name] * named + [number(rng) for _ in range(columns)] for name in THREE]
    if rng.random() < 0.2:
        lines.insert(rng.integers(4), [pick(rng, WORDS)])
    return "\n".join(gap.join(line) for line in lines).encode(), THREE


def any_json(rng):
    numbers = [number(rng), 10**400, 1e400, -1, 0, 0.5, 60, "1/60"]
    values = [*numbers, None, True, [], {}, ["a.png", 2], {"t": 1 / 8}, "\ud800"]
    names = [name if rng.random() < 0.9 else pick(rng, WORDS) for name in THREE]
    objects = [{"path": name, "t": pick(rng, values)} for name in names]
    mapping = dict(zip(names, (pick(rng, values) for _ in names), strict=True))
    bare = [pick(rng, values) for _ in names]
    return json.dumps(pick(rng, [objects, mapping, bare, {"images": objects}, bare[0]])).encode(), THREE


def mutated(rng):
    data, names = pick(rng, SAMPLES)
    data = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        i = rng.integers(len(data) + 1)
        j = i + rng.integers(8)
        data[i:j] = pick(rng, [b"", rng.bytes(2), pick(rng, WORDS).encode(), bytes(data[i:j]) * 2])
    return bytes(data[: rng.integers(len(data) + 1)] if rng.random() < 0.2 else data), names


def encoded(rng):
    """A table in an encoding, sometimes cut in the middle of a letter."""
    text = any_table(rng)[0].decode()
    data = text.encode(pick(rng, ["utf-16", "utf-8-sig", "gb18030", "utf-16-be"]))
    return data[: len(data) - rng.integers(3)], THREE


def odd_texts(rng, count, makers=(any_bytes, any_words, any_table, any_json, mutated, encoded)):
    """Texts that hold anything, often almost a list, with the names of the photographs beside them."""
    return [makers[i % len(makers)](rng) for i in range(count)]


def wrong(read, count):
    """What read() does other than to refuse, to find nothing, or to give a finite number for each photograph."""
    try:
        listed = read()
    except BracketError as problem:
        return None if str(problem).strip() else "an empty sentence"
    except Exception as problem:
        return repr(problem)[:120]
    if listed is None:
        return None
    sizes = (len(listed.values), len(listed.places))
    return None if sizes == (count, count) and np.isfinite(listed.values).all() else str(listed)[:120]


@pytest.mark.parametrize("file", ["t.txt", "t.json"])
def test_a_text_of_any_bytes_is_refused_passed_over_or_gives_one_finite_number_for_each(file):
    found = []
    for data, names in [*odd_texts(np.random.default_rng(20), 3600), *((nested, THREE) for nested in NESTED)]:
        problem = wrong(lambda data=data, names=names: text_values(file, data, names), len(names))
        found += [(problem, data[:80], names)] if problem else []
    assert not found, f"{len(found)} in all, such as {found[:5]}"


@pytest.mark.parametrize("word", ["5ſ", "1/60ſec", HUGE, "1e999", "-inf", "nan", "1/0", "1/1e-320", "½", "٣"])
def test_a_number_that_none_can_be_or_an_odd_unit_does_no_harm(word):
    for text in (f"a.png {word}\nb.png 1", f"{word} 1", f'{{"a.png": "{word}", "b.png": 1}}'):
        for file in ("t.txt", "t.json"):
            assert not wrong(lambda file=file, text=text: text_values(file, text.encode(), ["a.png", "b.png"]), 2)


def test_a_line_of_thousands_of_words_needs_no_more_memory_than_some_copies_of_it():
    data = b"1 " * 4000 + b".png"
    tracemalloc.start()
    try:
        assert not wrong(lambda: text_values("t.txt", data, ["a.png", "b.png"]), 2)
        assert tracemalloc.get_traced_memory()[1] < 200 * len(data)
    finally:
        tracemalloc.stop()


PARTS = [
    *("1", "2", "3", "60", "0", "007", "1626", "0.5", "2.5", "-1", "+2", "9" * 30, "1e5", "20240405", "175701"),
    *("EV", "ev", "EV-4.72", "EV5000", "EV-5000", "EV 2", "rev", "exp", "shutter", "t", "s", "ms", "img", "照片"),
    *("_", "-", " ", ".", "(", ")", "1_60", "4_1", "1_0", "0_1", "1-1", "٣", "１", "½", "²", "ſ", "é", "\U0001f4f7"),
]
SUFFIXES = [".png", ".PNG", ".jpg", ".jpeg", ".tif"]
NUMBERS = ["1", "2", "3", "7", "60", "250", "1626", "99999", "100000", "0.5", "1_60", "1_8", "4_1", "EV-1.5", "EV3"]


def odd_names(rng, count, parts=PARTS, suffixes=SUFFIXES):
    """Names of one pattern with numbers of their own, or of no pattern."""
    word = "".join(pick(rng, parts) for _ in range(rng.integers(3)))
    ends = pick(rng, [NUMBERS, NUMBERS[:9], parts])
    for _ in range(count):
        word = word if rng.random() < 0.9 else pick(rng, parts)
        yield word + pick(rng, ends) + pick(rng, suffixes)


def test_file_names_of_any_kind_give_nothing_or_one_finite_number_for_each():
    rng = np.random.default_rng(21)
    found = []
    for _ in range(3000):
        names = list(odd_names(rng, rng.integers(2, 5), [*PARTS, HUGE]))
        for read in (name_values, whole_number_names):
            problem = wrong(lambda read=read, names=names: read(names), len(names))
            found += [(problem, names)] if problem else []
    assert not found, f"{len(found)} in all, such as {str(found[:5])[:2000]}"


@pytest.mark.parametrize("name", ["EV" + "9" * 400, "2.5" + "9" * 400, "9" * 400 + ".5", "1_" + "1" * 5000])
def test_a_file_name_with_a_number_that_has_no_end_gives_nothing(name):
    assert not wrong(lambda: name_values([f"{name}.png", f"{name}7.png"]), 2)


def misread(folder):
    """What load_bracket() does other than to refuse with a sentence or to give a bracket with true times."""
    try:
        bracket = load_bracket(folder)
    except BracketError as problem:
        return None if str(problem).strip() else "an empty sentence"
    except Exception as problem:
        return repr(problem)[:120]
    times = bracket.times
    fine = np.isfinite(times).all() and times[0] > 0 and np.all(np.diff(times) > 0) and len(times) == 3
    return None if fine else f"times {times}"


EXTREMES = ["1e-320 1e-310 1e-300", "1e300 1e304 1e308", "1e308 1e304 1e300", "1e-300 1e-310 1e-320", "0 0 0"]


@pytest.mark.filterwarnings("error")
def test_a_folder_with_any_list_is_refused_or_gives_ascending_positive_finite_times(shoot):
    rng = np.random.default_rng(22)
    folder = shoot(dict(zip(THREE, (1, 4, 8), strict=True)), shape=(24, 32))
    found = []
    texts = [data for data, _ in odd_texts(rng, 200, (any_table, any_json, any_words))]
    for data in [*map(str.encode, EXTREMES), *texts]:
        for file in ("t.txt", "t.json"):
            (folder / file).write_bytes(data)
        problem = misread(folder)
        found += [(problem, data[:80])] if problem else []
    assert not found, f"{len(found)} in all, such as {found[:5]}"


@pytest.mark.filterwarnings("error")
def test_a_folder_with_any_names_is_refused_or_gives_ascending_positive_finite_times(shoot):
    rng = np.random.default_rng(23)
    found = []
    for i in range(200):
        names = list(odd_names(rng, 3, suffixes=[".png"]))
        while len({name for name in names if not name.startswith(".")}) < 3:
            names = list(odd_names(rng, 3, suffixes=[".png"]))
        folder = shoot(dict(zip(names, (1, 4, 8), strict=True)), folder=f"set{i}", shape=(24, 32))
        problem = misread(folder)
        found += [(problem, names)] if problem else []
    assert not found, f"{len(found)} in all, such as {found[:5]}"


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "names", [("EV5000", "EV5001", "EV5002"), ("EV-5002", "EV-5001", "EV-5000"), ("EV1", "EV2", "EV5000")]
)
def test_ev_steps_that_no_camera_reaches_are_refused(shoot, names):
    refused(shoot(dict(zip((f"{name}.png" for name in names), (1, 4, 8), strict=True))))
