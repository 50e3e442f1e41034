"""Odd submissions, graded together: each gets what it is due, with the reason, and costs no other anything."""

import csv
import json
from importlib.util import find_spec

import pytest
from short_course import Student, shorter_course

from hdr_helpers.lab.checks import most_points

if find_spec("nbgrader") is None:
    pytest.skip("nbgrader is not installed: the instructor extra", allow_module_level=True)

import odd_files  # noqa: F401  it fills CLASS
from odd_class import CLASS, files

from hdr_helpers.grading._running.sandbox import Bounds, bubblewrap
from hdr_helpers.grading.grade import Options, grade

pytestmark = pytest.mark.skipif(bubblewrap() is None, reason="There is no bubblewrap, and odd code needs a sandbox.")

# What no loop of the class reaches is far above what its work needs, for other tests may run beside this one.
BOUNDS = Bounds(cell=40, notebook=600, memory=800, processes=40, output=1, disk=64, check=15)
NUMBERS = ("3.1", "3.2", "3.4", "4.3")


@pytest.fixture(scope="module")
def graded(tmp_path_factory):
    """The odd class, a right submission and an empty one: folder of the results, and outcomes by student."""
    folder = tmp_path_factory.mktemp("odd")
    sources = shorter_course(folder / "course")
    for name, odd in CLASS.items():
        (folder / "in" / name).mkdir(parents=True)
        for file, data in files(odd, Student(sources)).items():
            (folder / "in" / name / file).write_bytes(data)
    Student(sources).hand_in(folder / "in" / "all_right")
    Student(sources).empty().hand_in(folder / "in" / "all_empty")
    options = Options(workers=3, bounds=BOUNDS)  # three of them mostly wait
    students = grade(folder / "in", folder / "out", options, lambda sentence: None, sources)
    return folder / "out", {student.student: student for student in students}


@pytest.mark.parametrize("name", CLASS)
def test_an_odd_submission_gets_what_is_due_and_the_reason(graded, name):
    student, odd = graded[1][name], CLASS[name]
    todos = {todo.number: todo for todo in student.todos}
    assert [todos[number].state for number in NUMBERS] == odd.states
    for number, state in zip(NUMBERS, odd.states, strict=True):
        assert todos[number].points == (most_points(number) if state == "right" else 0)
        assert todos[number].said or state in ("right", "empty")
    assert tuple(notebook.kind for notebook in student.notebooks) == odd.kinds
    flags = [flag for flag in student.all_flags if flag != "04_merge: It was not handed in."]
    assert len(flags) == len(odd.flags), "\n".join(flags)
    for flag, words in zip(flags, odd.flags, strict=True):
        assert words in flag
    for number, words in odd.said.items():
        assert words in todos[number].said[0]


def test_beside_them_a_right_submission_has_full_marks_and_an_empty_one_none(graded):
    for name, state, share in (("all_right", "right", 1), ("all_empty", "empty", 0)):
        student = graded[1][name]
        assert [(todo.number, todo.state) for todo in student.todos] == [(number, state) for number in NUMBERS]
        assert [todo.points for todo in student.todos] == [share * most_points(number) for number in NUMBERS]
        assert not student.all_flags and {notebook.kind for notebook in student.notebooks} == {"graded"}


def test_table_report_and_feedback_hold_everyone(graded):
    out, students = graded
    assert len(CLASS) >= 28 and students.keys() == {*CLASS, "all_right", "all_empty"}
    with open(out / "grades.csv", encoding="utf-8-sig", newline="") as file:
        rows = {row["student"]: row for row in csv.DictReader(file)}
    assert rows.keys() == students.keys()
    page = (out / "report.html").read_text(encoding="utf-8")
    for name, student in students.items():
        assert [float(rows[name][number]) for number in NUMBERS] == [todo.points for todo in student.todos]
        assert name in page and (out / "feedback" / name / "index.html").exists()


def test_what_was_graded_is_a_small_notebook_with_every_check_in_it_once(graded):
    out, students = graded
    for name, student in students.items():
        for notebook in (notebook for notebook in student.notebooks if notebook.kind == "graded"):
            path = out / "autograded" / name / notebook.name / f"{notebook.name}.ipynb"
            cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
            checks = [cell for cell in cells if cell["metadata"].get("nbgrader", {}).get("grade") and "outputs" in cell]
            wanted = [f"check-{todo.number.replace('.', '-')}" for todo in notebook.todos]
            assert [cell["metadata"]["nbgrader"]["grade_id"] for cell in checks] == wanted, name
            shown = ["".join(cell["outputs"][0]["data"]["text/plain"]) for cell in checks]
            assert shown == [repr(todo.points) for todo in notebook.todos], name
            assert path.stat().st_size < 5e6, name
