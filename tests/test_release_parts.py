"""What the student edition is made of, proved without nbgrader: TODOs, expected pictures, files, README."""

import re
import tomllib
from pathlib import Path

import filling
import nbformat
import pytest
from tiny_course import SECRET, cell, tiny_notebook

from hdr_helpers.grading.course import stage, with_expected_pictures
from hdr_helpers.grading.release import student_pyproject
from hdr_helpers.grading.solutions import all_strings, given_away, read_notebook, todos, without_solutions

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
PARTS = [path for path in ROOT.glob("hdr_helpers/**/*.py") if "grading" not in path.parts]
STUDENT = (ROOT / "hdr_helpers" / "grading" / "STUDENT.md").read_text(encoding="utf-8")


# What the search for solutions finds


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_search_finds_every_solution_in_the_source_edition(notebook):
    exercises = todos(read_notebook(notebook))
    text = all_strings(read_notebook(notebook))
    for todo in exercises:
        assert any(leak.startswith(todo.grade_id) for leak in given_away(text, [todo])), todo.grade_id
    assert "'### BEGIN SOLUTION' is left" in given_away(text, [])


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_a_source_notebook_says_outside_its_solutions_gives_none_away(notebook):
    source = read_notebook(notebook)
    assert given_away(without_solutions(source), todos(source)) == []


def test_no_module_that_is_handed_out_holds_a_solution():
    exercises = [todo for path in NOTEBOOKS for todo in todos(read_notebook(path))]
    assert len(exercises) >= 17 and len(PARTS) > 30
    for path in PARTS:
        assert given_away(path.read_text(encoding="utf-8"), exercises) == [], path


def test_an_idiom_alone_gives_nothing_away_but_with_its_neighbour_it_does():
    (todo,) = todos(tiny_notebook())
    assert given_away("return weight", [todo]) == []
    assert given_away("return weight", [todo], idiom=0)
    assert given_away("return weight", [todo], public="  return weight", idiom=0) == []
    assert len(given_away(SECRET.replace(" = ", "   =  "), [todo])) == 1
    assert len(given_away(f"{SECRET}\n\n        return weight", [todo])) == 2


def test_a_hidden_test_is_no_public_text_and_is_found_where_it_is_left():
    text = without_solutions(tiny_notebook())
    assert "draw(hat(2))" in text and "2456500" not in text and "nobody else" not in text
    assert given_away("### BEGIN HIDDEN TESTS", [])


def test_a_todo_without_its_two_marks_is_refused_by_name():
    notebook = tiny_notebook()
    notebook["cells"][1]["source"] = notebook["cells"][1]["source"].replace("### END SOLUTION", "")
    with pytest.raises(ValueError, match="todo-9-1"):
        todos(notebook)


# What is staged for nbgrader


def test_the_expected_picture_stands_before_its_todo_without_the_code_that_makes_it():
    staged = with_expected_pictures(tiny_notebook())
    ids = [cell["id"] for cell in staged["cells"]]
    assert ids == ["a", "todo-9-1-expected", "b", "c", "d", "e"]
    expected = staged["cells"][1]
    assert expected["attachments"] == {"expected.png": {"image/png": "iVBORw0KGgo="}}
    assert "![A (hat).](attachment:expected.png)" in expected["source"] and "draw" not in all_strings(expected)
    assert "widgets" not in staged["metadata"]


def test_a_picture_of_the_next_section_or_by_another_function_is_not_the_expected_one():
    notebook = tiny_notebook()
    notebook["cells"].insert(3, cell("markdown", "## Next", id="n"))
    assert with_expected_pictures(notebook)["cells"] == notebook["cells"]
    notebook = tiny_notebook()
    notebook["cells"][3]["source"] = "draw(cap(2))"
    assert with_expected_pictures(notebook)["cells"] == notebook["cells"]


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_staged_notebook_is_an_assignment_of_its_own_and_valid(notebook, tmp_path):
    assert stage([notebook], tmp_path) == [notebook.stem]
    staged = tmp_path / "source" / notebook.stem / notebook.name
    nbformat.validate(nbformat.read(staged, as_version=4))


def test_a_file_that_is_no_notebook_is_named(tmp_path):
    (tmp_path / "09_broken.ipynb").write_text("{", encoding="utf-8")
    with pytest.raises(ValueError, match="09_broken"):
        stage([tmp_path / "09_broken.ipynb"], tmp_path)


# The parts of the folder


def test_the_students_pyproject_installs_the_course_and_knows_no_tests_and_no_extras():
    course_project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project = tomllib.loads(student_pyproject((ROOT / "pyproject.toml").read_text(encoding="utf-8")))
    assert project["build-system"] == course_project["build-system"]
    assert project["project"] == {k: v for k, v in course_project["project"].items() if k != "optional-dependencies"}
    assert project["tool"] == {"setuptools": course_project["tool"]["setuptools"]}


def test_the_instructors_extra_is_nbgrader():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (requirement,) = project["optional-dependencies"]["instructor"]
    assert requirement.startswith("nbgrader>=")


def test_the_start_commands_of_the_students_readme_are_those_of_the_readme():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for pattern in (r"^python3 -m venv \.venv && .*$", r'^cmd /c "py -m venv \.venv && .*$'):
        (command,) = re.findall(pattern, readme, re.M)
        assert re.findall(pattern, STUDENT, re.M) == [command]


def test_the_students_readme_names_the_five_notebooks_and_files_that_are_there():
    assert re.findall(r"^\| `(notebooks/.*?)`", STUDENT, re.M) == [f"notebooks/{path.name}" for path in NOTEBOOKS]
    assert "## Hand in" in STUDENT and len(STUDENT.splitlines()) < 70


def test_no_other_part_of_the_course_imports_the_grading_package():
    for path in PARTS:
        assert "hdr_helpers.grading" not in path.read_text(encoding="utf-8"), path


def test_filling_in_refuses_a_notebook_whose_todo_has_no_stub_or_is_missing():
    source = tiny_notebook()
    with pytest.raises(ValueError, match="todo-9-1 has 0 stubs"):
        filling.filled_in(source, source)
    with pytest.raises(ValueError, match="no todo-9-1"):
        filling.filled_in(source | {"cells": source["cells"][:1]}, source)
