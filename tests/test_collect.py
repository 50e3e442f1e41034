"""Submissions are brought in as platforms give them: each notebook finds its student, and nobody's trouble spreads."""

import json
import os
import struct
import subprocess
import sys
import tracemalloc
import zipfile
from io import BytesIO
from pathlib import Path

import pytest

from hdr_helpers.grading._intake import collect as collecting
from hdr_helpers.grading._intake import unpack
from hdr_helpers.grading._intake.collect import collect
from hdr_helpers.grading.course import InstructorError

ASSIGNMENTS = ["01_load", "02_align", "03_crf", "04_merge", "05_tonemap"]


def notebook(number=None, text="", kind="todo"):
    """The bytes of a notebook with the marks of one TODO in it, or with none."""
    cells = [{"cell_type": "markdown", "metadata": {}, "source": text}]
    if number:
        cells.append({"cell_type": "code", "metadata": {"nbgrader": {"grade_id": f"{kind}-{number}-1"}}, "source": ""})
    return json.dumps({"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}).encode()


def zipped(files, **settings):
    """The bytes of a zip with these files; a name with / at its end is a folder."""
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w", **settings) as archive:
        for name, content in files.items():
            archive.writestr(name if isinstance(name, zipfile.ZipInfo) else zipfile.ZipInfo(name), content)
    return packed.getvalue()


def lay_out(folder, files):
    """Write files below a folder; a name with / at its end is a folder."""
    for name, content in files.items():
        place = folder / name
        (place if name.endswith("/") else place.parent).mkdir(parents=True, exist_ok=True)
        if not name.endswith("/"):
            place.write_bytes(content)
    return folder


@pytest.fixture(params=["folder", "zip", "zip with a folder in it"])
def bring(request, tmp_path):
    """bring(files, place) gives the files as a folder, as a zip, and as a zip that was made of the folder."""

    def bring(files, place="autumn"):
        if request.param == "folder":
            return collect(lay_out(tmp_path / place, files), ASSIGNMENTS)
        top = "" if request.param == "zip" else f"{place}/"
        (tmp_path / f"{place}.zip").write_bytes(zipped({top + name: content for name, content in files.items()}))
        return collect(tmp_path / f"{place}.zip", ASSIGNMENTS)

    return bring


def one(tmp_path, files, place="autumn"):
    (submission,) = collect(lay_out(tmp_path / place, files), ASSIGNMENTS)
    return submission


def texts(submissions):
    """{id: {assignment: bytes}}"""
    return {submission.student: submission.notebooks for submission in submissions}


# What platforms give

A, B, C, D = (notebook(text=text) for text in "abcd")
PLAIN = {"1234567": {"01_load": A, "02_align": B}, "7654321": {"01_load": C}}
LAYOUTS = {
    "Moodle, folders": (
        {
            "Ada Lovelace_1234567_assignsubmission_file_/01_load.ipynb": A,
            "Ada Lovelace_1234567_assignsubmission_file_/deep/er/02_align.ipynb": B,
            "Ada Lovelace_1234567_assignsubmission_onlinetext_/onlinetext.html": b"<p>Done</p>",
            "张 伟_7654321_assignsubmission_file/work.zip": zipped({"01_load.IPYNB": C}),
        },
        PLAIN,
    ),
    "Moodle, no folders": (
        {
            "Ada Lovelace_1234567_assignsubmission_file_01_load.ipynb": A,
            "Ada Lovelace_1234567_assignsubmission_file_02_align.ipynb": B,
            "O'Neil-Smith, Zoë_7654321_assignsubmission_file_01_load.ipynb": C,
        },
        PLAIN,
    ),
    "Canvas": (
        {
            "lovelaceada_LATE_1234567_4567890_01_load.ipynb": D,
            "lovelaceada_LATE_1234567_4567890_01_load-2.ipynb": A,
            "lovelaceada_LATE_1234567_4567890_01_load-1.ipynb": D,
            "lovelaceada_1234567_4567891_02_align.ipynb": B,
            "zhangwei_7654321_4567999_work-1.zip": zipped({"notebooks/01_load.ipynb": C}),
        },
        PLAIN,
    ),
    "Blackboard": (
        {
            "Assignment 3_1234567_attempt_2026-11-03-10-15-00_01_load.ipynb": D,
            "Assignment 3_1234567_attempt_2026-11-04-09-15-00_01_load (1).ipynb": A,
            "Assignment 3_1234567_attempt_2026-11-04-09-15-00.txt": b"Name: Ada Lovelace",
            "02_align_1234567_attempt_2026-11-03-10-15-00_02_align.ipynb": B,
            "Assignment 3_7654321_attempt_2026-11-03-10-15-00_01_load.ipynb": C,
        },
        PLAIN,
    ),
    "Brightspace": (
        {
            "index.html": b"<html>",
            "1234567-4567 - Ada Lovelace - 3 November 2026 1013 AM/01_load.ipynb": D,
            "1234567-4567 - Ada Lovelace - 3 November 2026 113 PM/01_load.ipynb": A,
            "1234567-4567 - Ada Lovelace - 3 November 2026 1259 AM/01_load.ipynb": D,
            "1234567-4567 - Ada Lovelace - 30 October 2026 1013 AM/02_align.ipynb": B,
            "7654321-4567 - Zhang Wei - 3 November 2026 1013 AM/01_load.ipynb": C,
            "7654321-4567 - Zhang Wei - 3 November 2026 1259 AM/01_load.ipynb": D,
        },
        PLAIN,
    ),
    "nbgrader": (
        {
            "submitted/ada/01_load/01_load.ipynb": A,
            "submitted/ada/01_load/timestamp.txt": b"2026-11-03 10:15:00 UTC",
            "submitted/bob/03_crf/03_crf.ipynb": B,
        },
        {"ada": {"01_load": A}, "bob": {"03_crf": B}},
    ),
    "nbgrader without its top": (
        {"ada/03_crf/03_crf.ipynb": A, "ada/01_load/01_load.ipynb": B, "bob/03_crf/03_crf.ipynb": C},
        {"ada": {"01_load": B, "03_crf": A}, "bob": {"03_crf": C}},
    ),
    "nbgrader, inbound": (
        {
            "ada+03_crf+2026-11-03 10:15:00 UTC+aGVsbG8/03_crf.ipynb": D,
            "ada+03_crf+2026-11-13 08:00:00.123 UTC+d29ybGQ/03_crf.ipynb": A,
            "ada+03_crf+2026-11-04 10:15:00 UTC+b/03_crf.ipynb": D,
            "bob+03_crf+2026-11-03 10_15_00 UTC/03_crf.ipynb": B,
        },
        {"ada": {"03_crf": A}, "bob": {"03_crf": B}},
    ),
    "assignments first": (
        {"03_crf/ada/03_crf.ipynb": A, "03_crf/bob/03_crf.ipynb": B, "01_load/ada/01_load.ipynb": C},
        {"ada": {"01_load": C, "03_crf": A}, "bob": {"03_crf": B}},
    ),
    "folders": (
        {
            "ada12/01_load.ipynb": A,
            "s1234567/notebooks/02_align.ipynb": B,
            "s1234567/results/crf.npy": b"",
            "s1234567/hdr_helpers/load.py": b"",
            "s1234567/notebooks/.ipynb_checkpoints/02_align-checkpoint.ipynb": D,
            "2023-CS-118/hdr_course/notebooks/03_crf.ipynb": C,
            "张伟_20231234/01_load.ipynb": D,
            "ada@uni.edu/01_load.ipynb": A,
            "__MACOSX/ada12/._01_load.ipynb": D,
            "ada12/.DS_Store": b"",
            "Thumbs.db": b"",
            "read me.txt": b"",
        },
        {
            "ada12": {"01_load": A},
            "s1234567": {"02_align": B},
            "2023-CS-118": {"03_crf": C},
            "20231234": {"01_load": D},
            "ada@uni.edu": {"01_load": A},
        },
    ),
    "a zip for each": (
        {"ada12.zip": zipped({"ada12/01_load.ipynb": A}), "Bob.ZIP": zipped({"hdr_course/notebooks/01_load.ipynb": B})},
        {"ada12": {"01_load": A}, "Bob": {"01_load": B}},
    ),
    "flat files": (
        {
            "ada12_01_load.ipynb": A,
            "02_align_ada12.ipynb": B,
            "ada12-03_crf.ipynb": C,
            "2023-CS-118_01_load.ipynb": D,
            "01_load_2023-CS-119 (1).ipynb": A,
            "张伟_20231234_01_load.ipynb": B,
            "ada@uni.edu_01_load.ipynb": C,
        },
        {
            "ada12": {"01_load": A, "02_align": B, "03_crf": C},
            "2023-CS-118": {"01_load": D},
            "2023-CS-119": {"01_load": A},
            "20231234": {"01_load": B},
            "ada@uni.edu": {"01_load": C},
        },
    ),
    "a download for each assignment": (
        {
            "CS118-01_load-99.zip": zipped({"Ada Lovelace_1234567_assignsubmission_file_/01_load.ipynb": A}),
            "CS118-02_align-98.zip": zipped({"Ada Lovelace_1234567_assignsubmission_file_/02_align.ipynb": B}),
        },
        {"1234567": {"01_load": A, "02_align": B}},
    ),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_notebook_finds_its_student_in_what_a_platform_gives(bring, layout):
    files, expected = LAYOUTS[layout]
    submissions = bring(files)
    assert texts(submissions) == expected
    assert [submission.student for submission in submissions] == sorted(expected)


@pytest.mark.parametrize(
    "layout, names",
    [
        ("Moodle, folders", ["Ada Lovelace", "张 伟"]),
        ("Moodle, no folders", ["Ada Lovelace", "O'Neil-Smith, Zoë"]),
        ("Canvas", ["lovelaceada", "zhangwei"]),
        ("Blackboard", ["", ""]),
        ("Brightspace", ["Ada Lovelace", "Zhang Wei"]),
        ("folders", ["", "张伟", "", "", ""]),
    ],
)
def test_a_persons_name_is_told_where_the_platform_gives_it(bring, layout, names):
    assert [submission.name for submission in bring(LAYOUTS[layout][0])] == names


@pytest.mark.parametrize("layout", ["Moodle, folders", "Moodle, no folders", "nbgrader", "folders", "a zip for each"])
def test_what_is_as_asked_for_gives_no_flag(bring, layout):
    assert [submission.flags for submission in bring(LAYOUTS[layout][0])] == [[] for _ in LAYOUTS[layout][1]]


def test_who_was_late_is_marked_so_and_nobody_else(bring):
    assert [submission.late for submission in bring(LAYOUTS["Canvas"][0])] == [True, False]


@pytest.mark.parametrize("below", ["", "notebooks/", "hdr_course/notebooks/", "old/"])
def test_one_students_own_folder_or_zip_gives_its_name(bring, below):
    files = {f"{below}{name}.ipynb": name.encode() for name in ASSIGNMENTS}
    others = {"results/crf.npy": b"", "hdr_helpers/load.py": b"", "photographs/me.jpg": b"", "mine/03_crf.ipynb": b"x"}
    (submission,) = bring(files | others, "ada12")
    assert submission.student == "ada12"
    assert {name: submission.notebooks[name] for name in ASSIGNMENTS if name != "03_crf"} == {
        name: name.encode() for name in ASSIGNMENTS if name != "03_crf"
    }


def test_a_class_of_one_is_not_taken_for_the_folder_around_it(bring):
    assert texts(bring({"ada12/01_load.ipynb": A, "ada12/02_align.ipynb": B})) == {
        "ada12": {"01_load": A, "02_align": B}
    }


def test_folders_around_a_class_are_nobody(bring):
    files = {"week 3/all/ada/01_load.ipynb": A, "week 3/all/bob/01_load.ipynb": B, "week 3/all/eve/02_align.ipynb": C}
    assert texts(bring(files)) == {"ada": {"01_load": A}, "bob": {"01_load": B}, "eve": {"02_align": C}}


def test_what_is_nobodys_is_a_submission_of_its_own_and_leaves_the_others_alone(bring):
    files = {f"{who}/{name}.ipynb": A for who in ("ada", "bob") for name in ASSIGNMENTS[:3]}
    submissions = bring(files | {"03_crf.ipynb": B, "homework.ipynb": notebook(2)})
    assert texts(submissions) == {
        "03_crf": {"03_crf": B},
        "ada": dict.fromkeys(ASSIGNMENTS[:3], A),
        "bob": dict.fromkeys(ASSIGNMENTS[:3], A),
        "homework": {"02_align": notebook(2)},
    }
    assert "Nothing tells whose '03_crf.ipynb' is" in submissions[0].flags[0].replace("autumn/", "")


def test_who_handed_in_no_notebook_is_there_with_a_flag(bring):
    files = {"ada/01_load.ipynb": A, "bob/": b"", "eve/essay.pdf": b"", "eve/03_crf.py": b""}
    files["downloads/Assignment 3_kim_attempt_2026-11-03-10-15-00.txt"] = b"Name: Kim"
    files["downloads/read me.txt"] = b""
    ada, *others = bring(files)
    assert ada.flags == [] and [other.student for other in others] == ["bob", "eve", "kim"]
    assert [other.notebooks for other in others] == [{}, {}, {}]
    assert others[0].flags == ["There is no notebook."]
    assert (
        "only '03_crf.py', 'essay.pdf'" in others[1].flags[0] or "only 'essay.pdf', '03_crf.py'" in others[1].flags[0]
    )


def test_zips_are_opened_in_zips_to_a_depth_of_three_and_no_deeper(tmp_path):
    files = {"ada/01_load.ipynb": A}
    for k, name in enumerate(ASSIGNMENTS[1:], 1):
        content = {f"{name}.ipynb": B}
        for _ in range(k):
            content = {"more.zip": zipped(content)}
        files |= {f"ada/{k}/{inner}": data for inner, data in content.items()}
    submission = one(tmp_path, files)
    assert sorted(submission.notebooks) == ASSIGNMENTS[:4]
    (flag,) = submission.flags
    assert "more.zip/more.zip/more.zip/more.zip" in flag and "zip in 3 others" in flag


# Which notebook a file is


@pytest.mark.parametrize(
    "name",
    [
        "03_crf (1)",
        "03_crf-2",
        "03_crf_final",
        "3_CRF",
        "Copy of 03_crf",
        "03_crf-Copy1",
        "03-crf",
        "03 crf v2",
        "03_crf_final_FINAL (2)",
        "03_crf副本",
        "ada_03_crf",
    ],
)
def test_a_name_is_forgiven_what_was_added_to_it_and_flagged(tmp_path, name):
    submission = one(tmp_path, {f"ada/{name}.ipynb": A})
    assert submission.notebooks == {"03_crf": A}
    assert submission.flags == [f"'{name}.ipynb' was taken for 03_crf."]


@pytest.mark.parametrize("name", ["03_crf.ipynb", "03_CRF.IPYNB", "03_crf.ipynb.ipynb"])
def test_capitals_or_a_second_ending_make_no_flag(tmp_path, name):
    submission = one(tmp_path, {f"ada/{name}": A})
    assert (submission.notebooks, submission.flags) == ({"03_crf": A}, [])


@pytest.mark.parametrize("name", ["103_crf", "03_crfs", "13_crf", "homework", "01_load_and_03_crf", "crf"])
@pytest.mark.parametrize("kind", ["todo", "check"])
def test_the_cells_inside_tell_where_the_name_does_not(tmp_path, name, kind):
    submission = one(tmp_path, {f"ada/{name}.ipynb": notebook(4, kind=kind)})
    assert submission.notebooks == {"04_merge": notebook(4, kind=kind)}
    assert submission.flags == [f"'{name}.ipynb' was taken for 04_merge, by the cells inside."]


def test_the_name_comes_before_the_cells_inside(tmp_path):
    assert one(tmp_path, {"ada/03_crf.ipynb": notebook(4)}).notebooks == {"03_crf": notebook(4)}


@pytest.mark.parametrize(
    "content",
    [
        *(notebook(), notebook(9), b"", b"{", b"[]", b"\xff", b'{"cells": 3}', b"[" * 200_000),
        b'{"cells": [{"metadata": {"nbgrader": 1}}]}',
        b'{"cells": [{"metadata": {"nbgrader": {"grade_id": 5}}}]}',
    ],
    ids=range(10),
)
def test_a_notebook_that_nothing_tells_is_named_in_a_flag(tmp_path, content):
    submission = one(tmp_path, {"ada/scratch.ipynb": content, "ada/01_load.ipynb": A})
    assert submission.notebooks == {"01_load": A}
    assert submission.flags == [
        "'ada/scratch.ipynb' is none of the notebooks that can be graded, by its name and by the cells inside."
    ]


@pytest.mark.parametrize("content", [b"", b"{", b"\x00\xff"])
def test_a_corrupt_file_with_a_good_name_is_kept_as_it_is(bring, content):
    (submission,) = bring({"ada/03_crf.ipynb": content})
    assert (submission.notebooks, submission.flags) == ({"03_crf": content}, [])


def dated(name, day):
    return zipfile.ZipInfo(name, (2026, 11, day, 10, 15, 0))


@pytest.mark.parametrize(
    "better, worse, reason",
    [
        (dated("ada/03_crf.ipynb", 1), dated("ada/03_crf (1).ipynb", 9), "with the better name"),
        (dated("ada/03_crf (1).ipynb", 1), dated("ada/homework.ipynb", 9), "with the better name"),
        (dated("ada/03_crf (10).ipynb", 1), dated("ada/03_crf (9).ipynb", 9), "the later version"),
        (dated("ada/a/03_crf.ipynb", 9), dated("ada/b/03_crf.ipynb", 1), "changed last"),
        (dated("ada/03_crf.ipynb", 1), dated("ada/old/03_crf.ipynb", 1), "chosen by its place"),
        (dated("ada/b/03_crf.ipynb", 1), dated("ada/a/03_crf.ipynb", 1), "chosen by its place"),
    ],
)
@pytest.mark.parametrize("turned", [False, True])
def test_of_two_files_for_one_notebook_the_better_is_graded_and_a_flag_says_why(
    tmp_path, better, worse, reason, turned
):
    files = {better: notebook(3, "better"), worse: notebook(3, "worse"), "bob/01_load.ipynb": A}
    place = tmp_path / "autumn.zip"
    place.write_bytes(zipped(dict(reversed(files.items())) if turned else files))
    submission = collect(place, ASSIGNMENTS)[0]
    assert submission.notebooks == {"03_crf": notebook(3, "better")}
    assert f"03_crf.ipynb was handed in twice; {better.filename!r}, {reason}, is graded." in submission.flags


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_of_one_name_twice_in_a_zip_the_last_is_graded_as_if_it_were_unpacked(tmp_path):
    files = {dated("ada/03_crf.ipynb", 1): A, dated("ada/03_crf.ipynb", 1): B}
    (tmp_path / "autumn.zip").write_bytes(zipped(files))
    (submission,) = collect(tmp_path / "autumn.zip", ASSIGNMENTS)
    assert submission.notebooks == {"03_crf": B} and "handed in twice" in submission.flags[0]


def test_in_a_folder_the_file_that_was_changed_last_is_graded(tmp_path):
    lay_out(tmp_path, {"class/ada/a/03_crf.ipynb": A, "class/ada/03_crf.ipynb": B})
    os.utime(tmp_path / "class/ada/a/03_crf.ipynb", (2e9, 2e9))
    (submission,) = collect(tmp_path / "class", ASSIGNMENTS)
    assert submission.notebooks == {"03_crf": A} and "changed last" in submission.flags[0]


# Ids


@pytest.mark.parametrize(
    "folder, student",
    [
        ("con", "_con"),
        ("NUL.smith", "_NUL.smith"),
        ("Ada Lovelace", "Ada_Lovelace"),
        ("-rf", "rf"),
        ("a+b", "a_b"),
        ("a:b*c", "a_b_c"),
        ("ada.", "ada"),
        ("+", "_"),
        ("-.-", "student"),
        ("x" * 200, "x" * 60),
        ("Зоя-7", "Зоя-7"),
        ("a\nb", "a_b"),
        ("20231234 (Zoe O'Neil)", "20231234"),
        ("20231234张伟", "20231234"),
        ("CS-2023-11845", "CS-2023-11845"),
    ],
)
@pytest.mark.skipif(sys.platform == "win32", reason="Windows can't have such folders")
def test_an_id_may_be_the_name_of_a_folder_on_every_system(tmp_path, folder, student):
    assert one(tmp_path, {f"{folder}/01_load.ipynb": A}).student == student


@pytest.mark.parametrize(
    "folders, students",
    [
        (["Ada", "ada"], ["Ada", "ada-2"]),
        (["ADA", "Ada"], ["ADA", "Ada-2"]),
        (["a+b", "a_b", "a b"], ["a_b", "a_b-2", "a_b-3"]),
        (["张伟_20231234", "王芳_20231234"], ["20231234", "20231234-2"]),
        (["x" * 70, "x" * 80], ["x" * 54 + "-2", "x" * 60]),
    ],
)
def test_two_students_never_get_one_id(tmp_path, folders, students):
    files = {f"{folder}/01_load.ipynb": folder.encode() for folder in folders}
    path = tmp_path / "autumn.zip"
    path.write_bytes(zipped(files))
    submissions = collect(path, ASSIGNMENTS)
    assert [submission.student for submission in submissions] == students
    assert {submission.notebooks["01_load"].decode() for submission in submissions} == set(folders)
    renamed = [submission for submission in submissions if "-" in submission.student]
    assert renamed and all("too like another's" in submission.flags[0] for submission in renamed)


def test_an_id_that_is_a_step_upwards_becomes_a_harmless_one(bring):
    (submission,) = bring({"Assignment 3_.._attempt_2026-11-03-10-15-00_01_load.ipynb": A})
    assert submission.student == "student" and "'..'" in submission.flags[0]


# What can be wrong


def everything_below(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


@pytest.mark.parametrize(
    "name", ["../../evil.ipynb", "/etc/evil.ipynb", "C:\\evil.ipynb", "..\\..\\evil.ipynb", "C:/x/../evil.ipynb"]
)
def test_a_name_that_leads_out_of_a_zip_writes_nothing_anywhere(tmp_path, monkeypatch, name):
    inside = tmp_path / "one" / "two"
    inside.mkdir(parents=True)
    monkeypatch.chdir(inside)
    lay_out(inside, {"class/ada.zip": zipped({name: notebook(3)}), "class/bob/01_load.ipynb": A})
    before = everything_below(tmp_path)
    assert texts(collect("class", ASSIGNMENTS)) == {"ada": {"03_crf": notebook(3)}, "bob": {"01_load": A}}
    assert everything_below(tmp_path) == before


def encrypted():
    """A zip whose one entry says that it is encrypted."""
    data = bytearray(zipped({"01_load.ipynb": A}))
    for mark, place in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        data[data.index(mark) + place] |= 1
    return bytes(data)


def of_method(number):
    data = bytearray(zipped({"01_load.ipynb": A}))
    for mark, place in ((b"PK\3\4", 8), (b"PK\1\2", 10)):
        struct.pack_into("<H", data, data.index(mark) + place, number)
    return bytes(data)


def link():
    info = zipfile.ZipInfo("01_load.ipynb")
    info.create_system, info.external_attr = 3, 0o120777 << 16
    return zipped({info: b"/etc/passwd"})


@pytest.mark.parametrize(
    "content, said",
    [
        (encrypted(), "'ada.zip/01_load.ipynb' is encrypted"),
        (zipped({"01_load.ipynb": A})[:-30], "'ada.zip' can't be opened as a zip"),
        (b"", "'ada.zip' can't be opened as a zip"),
        (b"\0" * 4096, "'ada.zip' can't be opened as a zip"),
        (zipped({"01_load.ipynb": A}).replace(b'"a"', b'"z"'), "'ada.zip/01_load.ipynb' can't be unpacked (Bad CRC-32"),
        (of_method(99), "'ada.zip/01_load.ipynb' can't be unpacked"),
        (link(), "'ada.zip/01_load.ipynb' is a link"),
        (zipped({"work.rar": b"Rar!"}), "'ada.zip/work.rar' is an archive that can't be opened here; ask for a zip"),
        (zipped({"in.zip": zipped({"01_load.ipynb": A})[:-30]}), "'ada.zip/in.zip' can't be opened as a zip"),
    ],
    ids=["encrypted", "truncated", "empty", "no zip", "broken", "unknown method", "link", "rar", "truncated within"],
)
def test_what_is_wrong_with_a_zip_is_its_students_flag_and_spoils_nothing_else(tmp_path, content, said):
    ada, bob = collect(lay_out(tmp_path, {"ada.zip": content, "bob.zip": zipped({"01_load.ipynb": B})}), ASSIGNMENTS)
    assert (ada.student, ada.notebooks) == ("ada", {}) and said in ada.flags[0], ada.flags
    assert (bob.notebooks, bob.flags) == ({"01_load": B}, [])


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_every_method_that_python_knows_is_unpacked(tmp_path, method):
    content = notebook(3, "far" * 100_000)
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w", method) as archive:
        archive.writestr("03_crf.ipynb", content)
    assert one(tmp_path, {"ada.zip": packed.getvalue(), "read me.txt": b""}).notebooks == {"03_crf": content}


def test_each_bound_gives_a_flag_and_what_is_within_it_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(collecting, "NOTEBOOK", 1000)
    monkeypatch.setattr(collecting, "TOTAL", 1600)
    files = {f"ada/{name}.ipynb": bytes(size) for name, size in zip(ASSIGNMENTS, [1000, 1001, 601, 600], strict=False)}
    submission = one(tmp_path, files)
    assert {name: len(data) for name, data in submission.notebooks.items()} == {"01_load": 1000, "04_merge": 600}
    assert [flag.split(":")[0] for flag in submission.flags] == [
        f"'ada/{name}.ipynb' is too large" for name in ("02_align", "03_crf")
    ]


def test_too_many_files_are_not_opened(tmp_path, monkeypatch):
    monkeypatch.setattr(unpack, "ENTRIES", 10)
    monkeypatch.setattr(collecting, "ENTRIES", 10)
    many = {f"{k:02}.txt": b"" for k in range(10)} | {"01_load.ipynb": A}
    ada, bob = collect(lay_out(tmp_path / "class", {"ada.zip": zipped(many), "bob/01_load.ipynb": B}), ASSIGNMENTS)
    assert ada.notebooks == {} and "more than 10 files" in ada.flags[0] and bob.flags == []
    nested = {f"{k}.zip": zipped({f"{k}{j}.txt": b"" for j in range(4)}) for k in range(3)}
    assert "more than 10 files" in one(tmp_path, {"eve.zip": zipped(nested), "a.txt": b""}, "nested").flags[0]
    loose = {f"kim/{k}.txt": b"" for k in range(10)} | {"kim/notebooks/01_load.ipynb": A}
    kim = one(tmp_path, loose, "loose")
    assert kim.notebooks == {} and "more than 10 files" in kim.flags[0]


def test_a_zip_whose_list_of_files_is_too_long_is_not_opened(tmp_path, monkeypatch):
    monkeypatch.setattr(unpack, "DIRECTORY", 100)
    content = zipped({"01_load.ipynb": A, "02_align.ipynb": A})
    assert "list of files is too long" in one(tmp_path, {"ada.zip": content, "a.txt": b""}).flags[0]


@pytest.mark.parametrize(
    "method, claim",
    [
        (zipfile.ZIP_DEFLATED, None),
        (zipfile.ZIP_BZIP2, None),
        (zipfile.ZIP_LZMA, None),
        (zipfile.ZIP_DEFLATED, 1000),
    ],
)
def test_a_bomb_is_not_unpacked_whatever_size_it_claims(tmp_path, monkeypatch, method, claim):
    monkeypatch.setattr(collecting, "NOTEBOOK", 2_000_000)
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w", method) as archive:
        archive.writestr("03_crf.ipynb", bytes(20_000_000))
    data = bytearray(packed.getvalue())
    if claim:
        struct.pack_into("<I", data, data.index(b"PK\1\2") + 24, claim)
    lay_out(tmp_path / "class", {"ada.zip": bytes(data), "a.txt": b""})
    tracemalloc.start()
    (submission,) = collect(tmp_path / "class", ASSIGNMENTS)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert submission.notebooks == {} and "ada.zip/03_crf.ipynb" in submission.flags[0]
    assert peak < 10_000_000


def test_zips_in_a_zip_are_bounded_together(tmp_path, monkeypatch):
    monkeypatch.setattr(unpack, "TOTAL", 5000)
    filler = zipped({"photograph.jpg": bytes(3000)})
    submission = one(
        tmp_path, {"ada.zip": zipped({"a.zip": filler, "b.zip": filler, "01_load.ipynb": A}), "a.txt": b""}
    )
    assert submission.notebooks == {"01_load": A}
    assert submission.flags == ["'ada.zip/b.zip' was not opened, for zips may have 0.005 MB in all."]


def in_bytes(name, content=A):
    """A zip with one folder, whose name is these bytes, and nothing that says how they are meant."""
    placeholder = "x" * len(name)
    return zipped({f"{placeholder}/01_load.ipynb": content, "bob/01_load.ipynb": B}).replace(placeholder.encode(), name)


@pytest.mark.parametrize(
    "name, encoding", [("张伟", "gbk"), ("陈喆堃", "gbk"), ("张伟", "utf-8"), ("Gérard", "cp437"), ("Zoë", "utf-8")]
)
def test_a_name_in_an_old_zip_is_read_as_it_was_meant(tmp_path, name, encoding):
    (tmp_path / "autumn.zip").write_bytes(in_bytes(name.encode(encoding)))
    assert {submission.student for submission in collect(tmp_path / "autumn.zip", ASSIGNMENTS)} == {name, "bob"}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs links and pipes")
def test_links_that_lead_out_are_not_followed_and_pipes_are_not_waited_for(tmp_path):
    lay_out(tmp_path, {"secret/01_load.ipynb": A, "class/ada/01_load.ipynb": B, "class/bob/real.ipynb": notebook(4)})
    bob = tmp_path / "class" / "bob"
    (bob / "01_load.ipynb").symlink_to("../ada/01_load.ipynb")
    (bob / "02_align.ipynb").symlink_to(tmp_path / "secret" / "01_load.ipynb")
    (bob / "04_merge.ipynb").symlink_to("real.ipynb")
    (bob / "more").symlink_to(tmp_path / "secret")
    (bob / "loop.zip").symlink_to("loop.zip")
    os.mkfifo(bob / "05_tonemap.ipynb")
    _, submission = collect(tmp_path / "class", ASSIGNMENTS)
    assert submission.notebooks == {"04_merge": notebook(4)}
    for name in ("01_load.ipynb", "02_align.ipynb", "more", "loop.zip"):
        assert f"'bob/{name}' is a link to somewhere else and was not followed." in submission.flags
    assert "'bob/05_tonemap.ipynb' is no ordinary file." in submission.flags


def test_a_file_that_can_not_be_read_is_a_flag(tmp_path, monkeypatch):
    read = Path.read_bytes

    def refuse(place):
        if place.name == "01_load.ipynb":
            raise PermissionError(13, "Permission denied")
        return read(place)

    monkeypatch.setattr(Path, "read_bytes", refuse)
    submission = one(tmp_path, {"ada/01_load.ipynb": A, "ada/02_align.ipynb": B})
    assert submission.notebooks == {"02_align": B}
    assert submission.flags == ["'ada/01_load.ipynb' can't be read (Permission denied)."]


def test_names_with_newlines_and_of_300_characters_are_one_short_line_in_a_flag(tmp_path):
    files = {"ada/two\nlines.ipynb": notebook(), f"ada/{'long' * 75}.ipynb": notebook(), f"{'x' * 300}.ipynb": A}
    (tmp_path / "autumn.zip").write_bytes(zipped(files | {"ada/01_load.ipynb": A, "ada/03_crf\n.ipynb": B}))
    submissions = collect(tmp_path / "autumn.zip", ASSIGNMENTS)
    flags = [flag for submission in submissions for flag in submission.flags]
    assert len(submissions) == 2 and len(flags) >= 4
    assert submissions[0].notebooks == {"01_load": A, "03_crf": B}
    assert all("\n" not in flag and len(flag) < 300 for flag in flags)


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names are Unicode there")
def test_a_folder_whose_name_is_no_unicode_is_read_as_gbk(tmp_path):
    folder = os.path.join(os.fsencode(tmp_path), b"class", "张伟".encode("gbk"))
    os.makedirs(folder)
    with open(os.path.join(folder, b"01_load.ipynb"), "wb") as file:
        file.write(A)
    assert texts(collect(tmp_path / "class", ASSIGNMENTS)) == {"张伟": {"01_load": A}}


def test_no_name_takes_long_to_understand(tmp_path):
    stems = ["copy_" * 60, "_" * 300, "a - " * 70, "1_" * 150, "03_crf" + "_copy" * 50 + "x", "1-1 - a - 2026" * 20]
    names = [name for stem in stems for name in (f"{stem}.ipynb", f"{stem}/{stem}.ipynb", f"03_crf{stem}.ipynb")]
    (tmp_path / "autumn.zip").write_bytes(zipped(dict.fromkeys(names, A)))
    command = "import sys; from hdr_helpers.grading._intake.collect import collect; collect(sys.argv[1], sys.argv[2:])"
    subprocess.run([sys.executable, "-c", command, tmp_path / "autumn.zip", *ASSIGNMENTS], check=True, timeout=20)


# What keeps everything from being done


@pytest.mark.parametrize(
    "files, place, said",
    [
        ({}, "nowhere", "is not there"),
        ({"grades.csv": b"1,2"}, "grades.csv", "neither a folder nor a zip"),
        ({"half.zip": zipped({"01_load.ipynb": A})[:-30]}, "half.zip", "neither a folder nor a zip"),
        ({"class/": b""}, "class", "holds no submission"),
        ({"class/.DS_Store": b"", "class/read me.txt": b""}, "class", "holds no submission"),
        ({"class.zip": zipped({})}, "class.zip", "holds no submission"),
    ],
)
def test_one_sentence_says_what_is_wrong_with_the_place_and_what_is_accepted(tmp_path, files, place, said):
    lay_out(tmp_path, files)
    with pytest.raises(InstructorError, match=said) as told:
        collect(tmp_path / place, ASSIGNMENTS)
    assert "Moodle, Canvas" in str(told.value) and place in str(told.value)


def test_it_is_imported_without_nbgrader_and_jupyter():
    heavy = "{'nbgrader', 'nbformat', 'jupyter_client'}"
    program = f"import sys, hdr_helpers.grading._intake.collect; print({heavy} & {{*sys.modules}})"
    assert (
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout == "set()\n"
    )
