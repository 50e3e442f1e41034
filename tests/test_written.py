"""Questions answered in words: what stands in each edition, and what an instructor marks by hand."""

import json
import re
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import nbformat
import pytest
import tiny_course as tiny

from hdr_helpers.grading.course import InstructorError
from hdr_helpers.grading.release import _checked
from hdr_helpers.grading.solutions import (
    Written,
    all_strings,
    given_away,
    is_todo,
    is_written,
    read_notebook,
    todos,
    without_solutions,
    written,
)

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
each_notebook = pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
needs_nbgrader = pytest.mark.skipif(
    find_spec("nbgrader") is None, reason='nbgrader is not among the seven packages: pip install -e ".[instructor]"'
)
MARKER = r"\*For the marker:\* 1 point for .+, 1 for .+\."


def answer_cells(notebook):
    return [cell for cell in read_notebook(notebook)["cells"] if is_written(cell)]


def answer(source):
    settings = tiny.mark("answer-9-1", grade=True, solution=True, points=2, cell_type="markdown")
    return {"cells": [tiny.cell("markdown", source, id="answer-9-1", **settings)]}


def sentences(text):
    """How many sentences; a formula may hold a full stop or a question mark, which ends none."""
    return len(re.findall(r"[.?](?=\s|$)", re.sub(r"\$[^$]*\$", "x", text)))


# The source edition


@each_notebook
def test_every_notebook_has_two_answers_in_words_whose_cells_nbgrader_has_marked_by_hand(notebook):
    number = int(notebook.stem[:2])
    cells = answer_cells(notebook)
    assert [cell["id"] for cell in cells] == [f"answer-{number}-1", f"answer-{number}-2"]
    for cell in cells:
        wanted = {"grade": True, "solution": True, "locked": False, "task": False, "schema_version": 3}
        named = {"grade_id": cell["id"], "cell_type": "markdown", "points": 2}
        assert cell["metadata"]["nbgrader"] == wanted | named


@each_notebook
def test_before_every_answer_stands_its_question_which_says_how_long_the_answer_should_be(notebook):
    number, asked = notebook.stem[1], 0
    for question, cell in pairwise(read_notebook(notebook)["cells"]):
        if is_written(cell):
            asked += 1
            assert question["cell_type"] == "markdown" and not question["metadata"]
            assert f"### Question {number}.{asked} · " in question["source"] and "?" in question["source"]
            assert question["source"].endswith("\n\n*Two to five sentences; 2 points.*")
            assert ("## Questions to answer in words\n" in question["source"]) == (asked == 1)
    assert asked == 2


@each_notebook
def test_a_model_answer_keeps_to_the_length_asked_for_and_says_what_each_point_is_for(notebook):
    for exercise in written(read_notebook(notebook)):
        title, *said, empty, marker = exercise.solution
        assert title == "**Model answer.**" and empty == ""
        assert re.fullmatch(MARKER, marker), exercise.grade_id
        assert 2 <= sentences(" ".join(said)) <= 5, exercise.grade_id
        assert all(sentences(line) == 1 for line in said), f"{exercise.grade_id}: a line for each sentence"


@each_notebook
def test_the_whole_cell_is_solution_and_its_marks_are_comments_which_are_not_shown(notebook):
    for cell in answer_cells(notebook):
        first, *between, last = cell["source"].splitlines()
        assert (first, last) == ("<!-- ### BEGIN SOLUTION -->", "<!-- ### END SOLUTION -->")
        assert not any("<!--" in line or line.startswith("#") for line in between)


@each_notebook
def test_notebook_intro_readme_and_the_students_readme_give_the_points_of_the_metadata(notebook):
    cells = [cell for cell in read_notebook(notebook)["cells"] if cell["metadata"].get("nbgrader")]
    checks = sum(cell["metadata"]["nbgrader"].get("points", 0) for cell in cells if cell["cell_type"] == "code")
    words = sum(exercise.points for exercise in written(read_notebook(notebook)))
    assert (
        f"up to {checks:g} points from the checks, and up to {words:g} for"
        in read_notebook(notebook)["cells"][0]["source"]
    )
    for readme in (ROOT / "README.md", ROOT / "hdr_helpers" / "grading" / "STUDENT.md"):
        row = next(
            line
            for line in readme.read_text(encoding="utf-8").splitlines()
            if f"{notebook.name}" in line and "|" in line
        )
        assert f"| {checks:g} + {words:g} |" in row, readme.name


def test_the_readme_says_how_many_points_there_are_in_all():
    points = {"code": 0, "markdown": 0}
    for notebook in NOTEBOOKS:
        for cell in read_notebook(notebook)["cells"]:
            points[cell["cell_type"]] += cell["metadata"].get("nbgrader", {}).get("points", 0)
    assert f"{points['code']:g} + {points['markdown']:g} in all" in (ROOT / "README.md").read_text(encoding="utf-8")


@each_notebook
def test_every_notebook_goes_on_to_its_summary_and_is_valid(notebook):
    nbformat.validate(nbformat.read(notebook, as_version=4))
    last = [cell["source"] for cell in read_notebook(notebook)["cells"] if cell["id"] != "05-glossary"][-1]
    assert last.startswith("### More to think about\n\n- ") and "\n## Summary\n" in last
    names = [path.name for path in NOTEBOOKS]
    following = names[names.index(notebook.name) + 1 :]
    assert not following or f"]({following[0]})" in last


# The search for leaks


def test_an_answer_in_words_is_no_todo_and_a_todo_no_answer():
    source = answer("<!-- ### BEGIN SOLUTION -->\nLight.\n<!-- ### END SOLUTION -->")
    assert todos(source) == [] and written(source) == [Written("answer-9-1", 2, ("Light.",))]
    todo = tiny.cell("code", "", id="t", **tiny.mark("todo-9-1", solution=True))
    assert is_todo(todo) and not is_written(todo)


@pytest.mark.parametrize("source", ["", "Light.", "<!-- ### BEGIN SOLUTION -->\nLight."])
def test_an_answer_without_its_two_marks_is_refused_by_name(source):
    with pytest.raises(ValueError, match="answer-9-1"):
        written(answer(source))


def test_each_line_of_a_model_answer_is_a_secret_however_short_and_wherever_it_stands():
    model = [Written("answer-9-1", 2, ("It is a bound.", "", "No photograph knows more."))]
    assert given_away("Nothing of it.", model) == []
    assert len(given_away("It is a bound.", model)) == 1
    assert len(given_away("Hint: it\nis so. It is\n  a bound. And no more.", model)) == 1
    assert len(given_away("It is a bound. No photograph knows more.", model)) == 2
    assert given_away("It is a bound.", model, public="They say: It is a bound.") == []


@each_notebook
def test_the_search_finds_every_line_of_a_model_answer_in_the_source_and_none_outside_of_it(notebook):
    source = read_notebook(notebook)
    exercises = written(source)
    lines = [line for exercise in exercises for line in exercise.solution if line]
    found = given_away(all_strings(source), exercises)
    assert [leak for leak in found if leak.startswith("answer-")] == [
        f"{exercise.grade_id}: {line}" for exercise in exercises for line in exercise.solution if line
    ]
    assert len(set(lines) - {"**Model answer.**"}) >= 8
    rest = without_solutions(source)
    assert given_away(rest, exercises) == [] and "<!--" not in rest


def test_no_module_that_is_handed_out_holds_a_line_of_a_model_answer():
    exercises = [exercise for path in NOTEBOOKS for exercise in written(read_notebook(path))]
    parts = [path for path in ROOT.glob("hdr_helpers/**/*.py") if "grading" not in path.parts]
    assert len(exercises) == 10 and len(parts) > 30
    for path in parts:
        assert given_away(path.read_text(encoding="utf-8"), exercises) == [], path


# The student edition


def test_an_answer_without_its_stub_is_not_handed_out():
    assert _checked(answer("YOUR ANSWER HERE"), "09_tiny.ipynb")
    with pytest.raises(InstructorError, match=r"answer-9-1 in 09_tiny\.ipynb has no stub"):
        _checked(answer("Light."), "09_tiny.ipynb")


@needs_nbgrader
@each_notebook
def test_a_students_cell_for_an_answer_holds_the_stub_and_nothing_else_and_is_worth_its_points(edition, notebook):
    cells = answer_cells(edition[0] / "notebooks" / notebook.name)
    assert [cell["source"] for cell in cells] == ["YOUR ANSWER HERE"] * 2
    for there, here in zip(cells, answer_cells(notebook), strict=True):
        settings = there["metadata"]["nbgrader"]
        assert settings.items() >= here["metadata"]["nbgrader"].items() - {("cell_type", "markdown")}
        assert settings.get("cell_type", "markdown") == "markdown"


@needs_nbgrader
def test_the_edition_holds_no_line_of_a_model_answer_and_all_questions(edition):
    exercises = [exercise for path in NOTEBOOKS for exercise in written(read_notebook(path))]
    assert len(exercises) == 10
    for path in (path for path in edition[0].rglob("*") if path.suffix in (".ipynb", ".py", ".md", ".txt", ".toml")):
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".ipynb":
            text = all_strings(json.loads(text) | {"cells": read_notebook(path)["cells"]})
            assert len(re.findall(r"^### Question \d\.\d · ", text, re.M)) == 2
        assert given_away(text, exercises) == [], path
        assert "Model answer" not in text and "For the marker" not in text, path
