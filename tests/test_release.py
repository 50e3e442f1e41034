"""The student edition: nothing of the solutions is left in it, and all that a student needs is."""

import json
import os
import re
import subprocess
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import filling
import nbformat
import pytest
import tiny_course as tiny

from hdr_helpers.grading import course
from hdr_helpers.grading import release as releasing
from hdr_helpers.grading.__main__ import main
from hdr_helpers.grading.course import InstructorError
from hdr_helpers.grading.release import pack, release
from hdr_helpers.grading.solutions import all_strings, is_todo, read_notebook, todos, without_solutions, written

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
PARTS = [path for path in ROOT.glob("hdr_helpers/**/*.py") if "grading" not in path.parts]
needs_nbgrader = pytest.mark.skipif(
    find_spec("nbgrader") is None, reason='nbgrader is not among the seven packages: pip install -e ".[instructor]"'
)


@pytest.fixture
def tiny_course(tmp_path):
    return tiny.tiny_course(tmp_path / "course")


def test_a_zip_has_the_same_bytes_whatever_the_dates_and_the_order_of_its_files(tmp_path):
    zips = []
    for place, names in {"one": ["b", "a"], "two": ["a", "b"]}.items():
        folder = tmp_path / place / "top"
        folder.mkdir(parents=True)
        for name in names:
            (folder / name).write_text(name)
        (folder / "a").chmod(0o600 if place == "one" else 0o644)
        pack(folder, folder.with_suffix(".zip"))
        zips.append(folder.with_suffix(".zip"))
    assert zips[0].read_bytes() == zips[1].read_bytes()
    assert zipfile.ZipFile(zips[0]).namelist() == ["top/a", "top/b"]


def test_a_move_that_fails_leaves_everything_as_it_was(tmp_path):
    (tmp_path / "aside").mkdir()
    (tmp_path / "place").mkdir()
    (tmp_path / "place" / "old").touch()
    (tmp_path / "aside" / "new").mkdir()
    pairs = [(tmp_path / "aside" / "new", tmp_path / "place"), (tmp_path / "aside" / "absent", tmp_path / "zip")]
    with pytest.raises(InstructorError, match="could not be moved"):
        releasing._move(pairs, tmp_path / "aside")
    assert (tmp_path / "place" / "old").is_file() and (tmp_path / "aside" / "new").is_dir()


# The command


def test_help_names_the_commands_and_the_exit_codes():
    run = [sys.executable, "-m", "hdr_helpers.grading"]
    said = subprocess.run([*run, "--help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert "release" in said and "Exit code" in said and "instructor" in said
    said = subprocess.run([*run, "release", "--help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert "--overwrite" in said and "DIR.zip" in said
    assert subprocess.run([*run, "relaese"], cwd=ROOT, capture_output=True).returncode == 2


def test_without_nbgrader_one_sentence_names_the_extra_and_nothing_is_left(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "nbgrader.apps", None)
    assert main(["release", "-o", str(tmp_path / "edition")]) == 1
    said = capsys.readouterr().err
    assert "[instructor]" in said and len(said.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("flags", [[], ["--overwrite"]])
def test_what_is_no_student_edition_is_never_replaced(flags, tmp_path, capsys):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "README.md").write_text("# My thesis")
    assert main(["release", "-o", str(tmp_path / "mine"), *flags]) == 1
    assert "is no student edition" in capsys.readouterr().err
    (tmp_path / "other.zip").write_text("precious")
    assert main(["release", "-o", str(tmp_path / "other"), *flags]) == 1
    assert (tmp_path / "other.zip").read_text() == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine", "other.zip"]


def test_a_folder_that_is_handed_out_is_no_place_for_the_edition(capsys):
    assert main(["release", "-o", str(ROOT / "data" / "edition")]) == 1
    assert "handed out" in capsys.readouterr().err


def test_nbgrader_finds_the_course_by_its_configuration():
    config = SimpleNamespace(CourseDirectory=SimpleNamespace())
    path = ROOT / "nbgrader_config.py"
    exec(path.read_text(encoding="utf-8"), {"get_config": lambda: config, "__file__": str(path)})
    assert Path(config.CourseDirectory.root) == ROOT / course.BUILD
    assert "build/" in (ROOT / ".gitignore").read_text(encoding="utf-8").splitlines()


# The whole edition, by nbgrader


@needs_nbgrader
def test_a_tiny_course_is_released_without_solution_hidden_test_output_and_results(tiny_course, tmp_path):
    folder, archive = release(tmp_path / "edition", root=tiny_course)
    text = {p.relative_to(folder).as_posix(): p.read_bytes().decode() for p in folder.rglob("*") if p.is_file()}
    handed_out = ["README.md", "data/chapel/chapel_1.jpg", "environment.txt", "hdr_helpers/__init__.py"]
    assert sorted(text) == [*handed_out, "notebooks/09_tiny.ipynb", "pyproject.toml"]
    notebook = text["notebooks/09_tiny.ipynb"]
    for secret in ("nobody else", "return weight", "SOLUTION", "HIDDEN", "2456500", "16581375", '"execution_count": 7'):
        assert secret not in notebook
    assert "raise NotImplementedError()" in notebook and "todo-9-1-expected" in notebook
    packed = zipfile.ZipFile(archive)
    assert {n.removeprefix("hdr_course/"): packed.read(n).decode() for n in packed.namelist()} == text
    assert sorted(path.name for path in tmp_path.iterdir()) == ["course", "edition", "edition.zip"]


@needs_nbgrader
def test_a_solution_that_stands_in_a_module_stops_the_release(tiny_course, tmp_path):
    (tiny_course / "hdr_helpers" / "weights.py").write_text(f"def hat(z):\n{tiny.SECRET}\n")
    with pytest.raises(InstructorError, match=r"hdr_helpers/weights\.py: todo-9-1"):
        release(tmp_path / "edition", root=tiny_course)
    assert [path.name for path in tmp_path.iterdir()] == ["course"]


@needs_nbgrader
def test_a_solution_outside_a_todo_cell_is_refused_by_nbgrader_and_said(tiny_course, tmp_path):
    notebook = tiny.tiny_notebook()
    notebook["cells"].append(tiny.cell("code", "### BEGIN SOLUTION\nhat(1)\n### END SOLUTION", id="f"))
    (tiny_course / "notebooks" / "09_tiny.ipynb").write_text(json.dumps(notebook))
    with pytest.raises(InstructorError, match="09_tiny"):
        release(tmp_path / "edition", root=tiny_course)
    assert [path.name for path in tmp_path.iterdir()] == ["course"]


@needs_nbgrader
def test_an_earlier_edition_is_replaced_only_when_asked_and_the_bytes_are_the_same(tiny_course, tmp_path):
    folder, archive = release(tmp_path / "edition", root=tiny_course)
    before = archive.read_bytes()
    (folder / "stale").touch()
    with pytest.raises(InstructorError, match="--overwrite"):
        release(folder, root=tiny_course)
    assert (folder / "stale").is_file()
    release(folder, overwrite=True, root=tiny_course)
    assert not (folder / "stale").exists() and archive.read_bytes() == before
    _, elsewhere = release(tmp_path / "deep" / "place", root=tiny_course)
    assert elsewhere.read_bytes() == before


@needs_nbgrader
def test_no_file_of_the_edition_has_a_line_of_a_solution_that_the_source_keeps_to_itself(edition):
    sources = [read_notebook(path) for path in NOTEBOOKS]
    handed_out = "\n".join(path.read_text(encoding="utf-8") for path in PARTS)  # searched by a test of its own
    public = set(map(str.strip, "\n".join([*map(without_solutions, sources), handed_out]).splitlines()))
    exercises = [exercise for source in sources for exercise in (*todos(source), *written(source))]
    secret = {line.strip() for exercise in exercises for line in exercise.solution} - public - {""}
    assert len(secret) > 100
    packed = zipfile.ZipFile(edition[1])
    for name in packed.namelist():
        content = packed.read(name)
        assert "grading" not in name.split("/") and b"BEGIN SOLUTION" not in content, name
        text = all_strings(json.loads(content)) if name.endswith(".ipynb") else content.decode("utf-8", "ignore")
        assert not secret & set(map(str.strip, text.splitlines())), name


@needs_nbgrader
@pytest.mark.parametrize("source", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_students_notebook_is_valid_has_a_stub_in_each_todo_and_no_outputs(edition, source):
    path = edition[0] / "notebooks" / source.name
    nbformat.validate(nbformat.read(path, as_version=4))
    student = read_notebook(path)
    stubs = [cell for cell in student["cells"] if is_todo(cell)]
    assert len(stubs) == len(todos(read_notebook(source))) >= 2
    for stub in stubs:
        namespace = {}
        exec(stub["source"], namespace)
        (function,) = (value for name, value in namespace.items() if name != "__builtins__")
        with pytest.raises(NotImplementedError):
            function(*[None] * (function.__code__.co_argcount - len(function.__defaults__ or ())))
    assert all(not cell["outputs"] for cell in student["cells"] if cell["cell_type"] == "code")


@needs_nbgrader
def test_the_edition_has_what_the_start_command_needs(edition):
    folder = edition[0]
    for name in (
        "environment.txt",
        "pyproject.toml",
        "README.md",
        "data/chapel/shutter.txt",
        "hdr_helpers/__main__.py",
    ):
        assert (folder / name).is_file(), name
    assert (folder / "environment.txt").read_bytes() == (ROOT / "environment.txt").read_bytes()
    there = sorted(path.name for path in (folder / "notebooks").iterdir())
    assert there == [path.name for path in NOTEBOOKS]
    assert not (folder / "hdr_helpers" / "grading").exists()
    run = subprocess.run(
        [sys.executable, "-c", "import hdr_helpers.lab.figures as f; print(f.__file__)"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    assert Path(run.stdout.strip()).is_relative_to(folder)


@needs_nbgrader
@pytest.mark.parametrize("source", NOTEBOOKS, ids=lambda path: path.stem)
def test_with_the_solutions_filled_in_every_cell_is_the_sources_again(edition, source):
    filled = filling.filled_in(read_notebook(edition[0] / "notebooks" / source.name), read_notebook(source))
    unmarked = re.compile(r"^\s*(<!-- )?### (BEGIN|END) SOLUTION( -->)?(\n|$)", re.M)
    wanted = {cell["id"]: unmarked.sub("", cell["source"]).rstrip() for cell in read_notebook(source)["cells"]}
    assert {c["id"]: c["source"].rstrip() for c in filled["cells"] if not c["id"].endswith("-expected")} == wanted


@needs_nbgrader
def test_every_check_of_an_empty_todo_says_so_and_gives_no_points(edition, tmp_path):
    stubs = {path: json.loads(path.read_text(encoding="utf-8")) for path in (edition[0] / "notebooks").glob("*.ipynb")}
    assert len(stubs) == 5
    script = ["from hdr_helpers.lab.checks import check"]
    for notebook in stubs.values():
        for cell in notebook["cells"]:
            grade_id = cell["metadata"].get("nbgrader", {}).get("grade_id", "")
            if grade_id.startswith("check-"):
                number, name = grade_id.removeprefix("check-").replace("-", "."), "".join(cell["source"])
                name = name.split(", ")[1].split(")")[0]
                script.append(f"def {name}(*_, **__): raise NotImplementedError()")
                script.append(f'result = check("{number}", {name}); print(result.points, result.started, result.last)')
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(script)], capture_output=True, text=True, cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(edition[0]), "HDR_CHECKS_MUST_PASS": "0"},
    )  # fmt: skip
    lines = done.stdout.splitlines()
    assert len(lines) == 17, done.stderr
    assert all(line.startswith("0.0 False Not started yet") for line in lines)
