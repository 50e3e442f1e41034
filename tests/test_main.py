"""python -m hdr_helpers: what it writes, what it prints, and what it leaves alone."""

import re
import subprocess
import sys
import zipfile

import cv2
import numpy as np
import pytest

from hdr_helpers.__main__ import main
from hdr_helpers.lab import data
from hdr_helpers.lab.brackets import CHAPEL_TIMES
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.metrics import crf_rmse
from hdr_helpers.lab.scenes import chapel_scene

NAMES = ("a_1.png", "a_2.png", "a_3.png", "a_4.png", "a_5.png")
TIMES = {"times.txt": "1/400 1/60 1/10 0.6 4"}
FILES = ["crf.csv", "crf.png", "picture.png", "radiance.hdr"]


def run(*arguments):
    return main([str(argument) for argument in arguments])


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_bracket_becomes_a_radiance_map_a_curve_and_a_picture(save, tmp_path, small_bracket):
    assert run(save(NAMES, TIMES), "-o", tmp_path / "out") == 0
    assert sorted(contents(tmp_path / "out")) == FILES
    for name in ("radiance.hdr", "picture.png"):
        image = cv2.imread(str(tmp_path / "out" / name), cv2.IMREAD_UNCHANGED)
        assert image.shape == (120, 160, 3)
        assert np.ptp(image) > 0
    table = np.genfromtxt(tmp_path / "out" / "crf.csv", delimiter=",", names=True)
    assert table["value"].tolist() == list(range(256))
    crf = np.array([table[name] for name in ("red", "green", "blue")])
    assert not crf[:, 128].any()
    assert crf_rmse(crf, small_bracket.truth.crf).max() < 0.2


def test_what_was_done_is_printed(save, tmp_path, capsys, small_bracket):
    run(save(NAMES, TIMES | {"z.txt": "1/400 1/60 1/5 0.6 4"}), "-o", tmp_path / "out")
    printed = capsys.readouterr().out
    assert "5 photographs of 160 x 120 pixels" in printed
    for name, seconds in zip(NAMES, small_bracket.times, strict=True):
        assert re.search(rf"^{name} +{seconds:.6g} +\+0 \+0 +[\d.]+% +[\d.]+%", printed, re.MULTILINE)
    assert re.search(r"Clipped in every exposure: [\d.]+% .* bright .* [\d.]+% too dark", printed)
    assert re.search(r"Dynamic range of the scene: \d+\.\d stops", printed)
    assert re.search(r"Note: a_3\.png: 0\.1 s .*, 0\.2 s ", printed)


def test_shifts_are_found_and_printed_and_not_looked_for_when_not_wanted(tmp_path, capsys):
    bracket = Camera(seed=2).shoot(chapel_scene()[:250, :350], CHAPEL_TIMES[4:7], [(0, 0), (0, 0), (5, -3)])
    for name, image in zip(("1.png", "2.png", "3.png"), bracket.images, strict=True):
        cv2.imwrite(str(tmp_path / name), image[..., ::-1])
    (tmp_path / "t.txt").write_text("0.1 0.25 0.6")
    run(tmp_path, "-o", tmp_path / "aligned")
    assert re.search(r"3\.png +0\.6 +-5 \+3", capsys.readouterr().out)
    height, width = bracket.images[0].shape[:2]
    assert cv2.imread(str(tmp_path / "aligned" / "picture.png")).shape[:2] == (height - 3, width - 5)
    run(tmp_path, "-o", tmp_path / "as they are", "--no-align")
    assert re.search(r"3\.png +0\.6 +\+0 \+0", capsys.readouterr().out)
    assert cv2.imread(str(tmp_path / "as they are" / "picture.png")).shape[:2] == (height, width)


def test_the_chapels_true_error_is_printed_and_small(tmp_path, capsys):
    assert run(data.DATA / "chapel", "-o", tmp_path / "out") == 0
    median, p95 = re.search(r"median error ([\d.]+) stops, 95% below ([\d.]+)\.", capsys.readouterr().out).groups()
    assert float(median) < 0.04
    assert float(p95) < 0.15


def test_the_same_bracket_gives_the_same_files(save, tmp_path):
    folder = save(NAMES, TIMES)
    run(folder, "-o", tmp_path / "first")
    run(folder, "-o", tmp_path / "second")
    first, second = contents(tmp_path / "first"), contents(tmp_path / "second")
    assert all(first[name] == second[name] for name in ("radiance.hdr", "crf.csv", "picture.png"))


def test_options_change_what_they_say(save, tmp_path):
    folder = save(NAMES, TIMES)
    run(folder, "-o", tmp_path / "plain")
    run(folder, "-o", tmp_path / "smooth", "--lam", "5000")
    run(folder, "-o", tmp_path / "reinhard", "--tonemap", "reinhard")
    plain, smooth, reinhard = (contents(tmp_path / name) for name in ("plain", "smooth", "reinhard"))
    assert all(plain[name] != smooth[name] for name in FILES)
    assert [name for name in FILES if plain[name] != reinhard[name]] == ["picture.png"]


def test_results_go_beside_the_caller_when_no_folder_is_given(save, tmp_path, monkeypatch):
    save(NAMES, TIMES)
    monkeypatch.chdir(tmp_path)
    assert run("photographs") == 0
    assert sorted(contents(tmp_path / "photographs_hdr")) == FILES


def test_results_of_an_earlier_run_are_kept_until_overwrite_is_given(save, tmp_path, capsys):
    folder, out = save(NAMES, TIMES), tmp_path / "out"
    out.mkdir()
    (out / "picture.png").write_bytes(b"mine")
    (out / "notes.txt").write_bytes(b"mine, too")
    before = contents(out)
    assert run(folder, "-o", out) == 1
    assert contents(out) == before
    assert "picture.png" in (problem := capsys.readouterr().err) and "--overwrite" in problem
    assert run(folder, "-o", out, "--overwrite") == 0
    assert cv2.imread(str(out / "picture.png")).shape == (120, 160, 3)
    assert (out / "notes.txt").read_bytes() == b"mine, too"


# -------------------------------------------------------------------------------------- bad input


def test_a_missing_bracket_is_one_sentence_and_nothing_is_written(tmp_path, capsys):
    assert run(tmp_path / "nowhere", "-o", tmp_path / "out") == 1
    problem = capsys.readouterr().err
    assert "nowhere does not exist" in problem
    assert len(problem.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_photographs_without_times_are_one_sentence_and_nothing_is_written(save, tmp_path, capsys):
    assert run(save(NAMES), "-o", tmp_path / "out") == 1
    problem = capsys.readouterr().err
    assert "No exposure times" in problem
    assert len(problem.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_results_are_not_written_into_a_file(save, tmp_path, capsys):
    (tmp_path / "out").write_bytes(b"mine")
    assert run(save(NAMES, TIMES), "-o", tmp_path / "out") == 1
    assert "out is a file" in capsys.readouterr().err
    assert (tmp_path / "out").read_bytes() == b"mine"


@pytest.mark.parametrize("lam", ["0", "-1", "nan"])
def test_a_smoothness_that_can_not_be_is_refused_in_a_sentence(save, tmp_path, capsys, lam):
    try:
        code = run(save(NAMES, TIMES), "-o", tmp_path / "out", "--lam", lam)
    except SystemExit as end:
        code = end.code
    assert code in (1, 2)
    assert "lam" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_photographs_that_share_no_usable_value_end_in_a_result_or_a_sentence(tmp_path):
    for name, value in (("a_1.png", 0), ("a_2.png", 255)):
        cv2.imwrite(str(tmp_path / name), np.full((60, 80, 3), value, np.uint8))
    (tmp_path / "t.txt").write_text("1/1000 30")
    assert run(tmp_path, "-o", tmp_path / "out") in (0, 1)


@pytest.mark.parametrize("arguments", [[], ["here", "there"], ["here", "--tonemap", "no"], ["here", "--lam", "much"]])
def test_wrong_usage_exits_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert "usage" in capsys.readouterr().err


def test_help_exits_with_0_and_names_what_is_written(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    assert end.value.code == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in FILES)


def test_the_exit_code_reaches_the_shell(tmp_path):
    call = [sys.executable, "-m", "hdr_helpers", "nowhere"]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("hdr_helpers: nowhere does not exist")


# ---------------------------------------------------------------------------------- real cameras


@pytest.mark.parametrize("name", ["exposures", "memorial", "frobisher"])
def test_real_brackets_go_all_the_way(real, tmp_path, name):
    assert run(real(name), "-o", tmp_path / "out") == 0
    assert sorted(contents(tmp_path / "out")) == FILES
    picture = cv2.imread(str(tmp_path / "out" / "picture.png"))
    assert np.ptp(np.percentile(picture, [5, 95])) > 60


def test_a_zip_gives_the_same_results_as_its_folder(real, tmp_path):
    with zipfile.ZipFile(tmp_path / "frobisher.zip", "w") as archive:
        for path in real("frobisher").iterdir():
            archive.write(path, f"frobisher/{path.name}")
    assert run(real("frobisher"), "-o", tmp_path / "a") == run(tmp_path / "frobisher.zip", "-o", tmp_path / "b") == 0
    a, b = contents(tmp_path / "a"), contents(tmp_path / "b")
    assert all(a[name] == b[name] for name in ("radiance.hdr", "crf.csv", "picture.png"))


def test_results_are_not_written_among_the_photographs(save, capsys):
    folder = save(NAMES, TIMES)
    before = contents(folder)
    assert run(folder, "-o", folder) == 1
    assert "give another folder" in capsys.readouterr().err
    assert contents(folder) == before


def test_a_hand_held_brackets_true_error_is_measured_where_the_reference_lies(tmp_path, capsys):
    shifts = [(3, -5), (-6, 2), (4, 6), (0, -3), (-2, 1)]
    bracket = Camera(seed=5).shoot(chapel_scene()[60:320, 200:560], CHAPEL_TIMES[2:7], shifts)
    folder = tmp_path / "handheld"
    folder.mkdir()
    for name, image, seconds in zip("abcde", bracket.images, bracket.times, strict=True):
        cv2.imwrite(str(folder / f"{name}_{seconds:.6f}.png"), image[..., ::-1])
    data.save_truth(folder, bracket.truth, 4)
    assert run(folder, "-o", tmp_path / "out") == 0
    (median,) = re.findall(r"median error ([\d.]+) stops", capsys.readouterr().out)
    assert float(median) < 0.05


def test_ghosts_are_taken_out_unless_they_are_to_be_kept(tmp_path, capsys):
    errors = []
    for options in [], ["--keep-ghosts"]:
        assert run(data.DATA / "handheld", "-o", tmp_path / "out", "--overwrite", *options) == 0
        printed = capsys.readouterr().out
        assert ("there IMG_0412.jpg decides" in printed) == (not options)
        errors.append(float(re.search(r"95% below ([\d.]+)\.", printed).group(1)))
    assert errors[0] < 0.15 < 0.6 * errors[1]


def test_the_truth_of_other_photographs_is_refused_before_anything_is_written(save, tmp_path, chapel, capsys):
    folder = save(NAMES, TIMES)
    data.save_truth(folder, chapel.truth, 4)
    assert run(folder, "-o", tmp_path / "out") == 1
    assert "truth.npz is not the truth of these photographs" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
