"""Grading a class: fair, the same every time, and what an instructor has marked by hand stays.

With the short course; the whole one is graded once, with all solutions and with none.
"""

import csv
import importlib
import json
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from filling import fill_in
from short_course import Student, short_course

from hdr_helpers.grading.course import InstructorError, source_notebooks
from hdr_helpers.lab.checks import TODOS, check, most_points

if find_spec("nbgrader") is None:
    pytest.skip("nbgrader is not installed: the instructor extra", allow_module_level=True)

from hdr_helpers.grading.__main__ import main
from hdr_helpers.grading._running.sandbox import bubblewrap
from hdr_helpers.grading.grade import Options, grade
from hdr_helpers.grading.gradebook import gradebook
from hdr_helpers.grading.release import release

sys.path.insert(0, str(Path(__file__).parent))
corpus = importlib.import_module("mistakes.corpus")
for stage in ("load", "align", "crf", "system", "curves", "merge", "tonemap"):
    importlib.import_module(f"mistakes.{stage}")

SANDBOXED = bubblewrap() is not None
FULL = {number: most_points(number) for number in sorted(TODOS) if number[0] in "34"}


def options(**changes):
    return Options(**{"sandboxed": SANDBOXED} | changes)


def points(student):
    return {todo.number: todo.points for todo in student.todos}


def table(out):
    with open(out / "grades.csv", encoding="utf-8-sig", newline="") as file:
        return {row["student"]: row for row in csv.DictReader(file)}


class Said(list):
    """What grade says."""

    def __call__(self, sentence):
        self.append(sentence)


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    return short_course(tmp_path_factory.mktemp("course"))


@pytest.fixture(scope="module")
def graded(sources, tmp_path_factory):
    """A class of four, graded: folder of submissions, folder of results, outcomes by student."""
    folder = tmp_path_factory.mktemp("class")
    Student(sources).hand_in(folder / "in" / "ada")
    Student(sources).empty().hand_in(folder / "in" / "bo")
    wrong = Student(sources).write("todo-3-1", "    return np.ones(256)")
    wrong.write("todo-4-1", "    return np.exp(g[Z]).mean(axis=0)").hand_in(folder / "in" / "cleo")
    Student(sources).hand_in(folder / "in" / "dan")
    (folder / "in" / "dan" / "04_merge.ipynb").unlink()
    students = grade(folder / "in", folder / "out", options(), Said(), sources)
    return folder / "in", folder / "out", {student.student: student for student in students}


def test_all_solutions_get_all_points_and_none_gets_none(graded):
    _, _, students = graded
    assert points(students["ada"]) == FULL
    assert points(students["bo"]) == dict.fromkeys(FULL, 0.0)
    assert {todo.state for todo in students["bo"].todos} == {"empty"}


def test_a_wrong_todo_costs_points_there_and_nowhere_else_in_this_notebook_and_the_next(graded):
    _, _, students = graded
    found = points(students["cleo"])
    assert found["3.1"] < FULL["3.1"] and found["4.1"] < FULL["4.1"]
    assert {number for number in FULL if found[number] != FULL[number]} == {"3.1", "4.1"}


def test_a_missing_notebook_costs_its_own_points_alone(graded):
    _, _, students = graded
    assert {number: got for number, got in points(students["dan"]).items() if got} == {
        number: most for number, most in FULL.items() if number[0] == "3"
    }
    assert [notebook.kind for notebook in students["dan"].notebooks] == ["graded", "missing"]


def test_a_mistake_is_named_to_the_student_and_in_the_report_of_the_class(graded):
    _, out, students = graded
    said = next(todo for todo in students["cleo"].todos if todo.number == "3.1").said
    assert said
    for page in (out / "feedback" / "cleo" / "index.html", out / "report.html"):
        assert said[0].split(",")[0] in page.read_text(encoding="utf-8")
    assert "TODO 3.1" in (out / "feedback" / "cleo" / "03_crf" / "03_crf.html").read_text(encoding="utf-8")


def test_the_table_holds_the_points_of_every_todo_and_leaves_unmarked_answers_empty(graded):
    _, out, students = graded
    rows = table(out)
    assert rows.keys() == students.keys()
    for name, student in students.items():
        assert {number: float(rows[name][number]) for number in FULL} == points(student)
    assert rows["ada"]["answer-3-1"] == "" and rows["ada"]["unmarked"] == "4"
    assert rows["bo"]["answer-3-1"] == "0" and rows["bo"]["unmarked"] == "0"  # nothing was written there


def test_solutions_have_all_points_with_any_seed(graded, sources, tmp_path):
    shutil.copytree(graded[0] / "ada", tmp_path / "in" / "ada")
    (ada,) = grade(tmp_path / "in", tmp_path / "out", options(seed=3), Said(), sources)
    assert points(ada) == FULL


def test_graded_again_a_submission_has_the_same_marks_and_what_was_marked_by_hand_stays(graded, sources, tmp_path):
    folder, out, students = graded
    out = Path(shutil.copytree(out, tmp_path / "out"))
    with gradebook(out / "gradebook.db") as book:
        answer = book.find_grade("answer-3-1", "03_crf", "03_crf", "ada")
        answer.manual_score, answer.needs_manual_grade = 1.5, False
        mended = book.find_grade("check-3-1", "03_crf", "03_crf", "cleo")
        mended.manual_score = 2.0
        book.find_comment("answer-3-1", "03_crf", "03_crf", "ada").manual_comment = "A fine thought."
        book.db.commit()
    said = Said()
    grade(folder, out, options(), said, sources)
    assert any("0 have something new" in sentence for sentence in said)
    for again in (False, True):
        if again:  # every submission is run again
            given = tmp_path / "given"
            for name in ("ada", "cleo"):
                shutil.copytree(folder / name, given / name)
            after = {student.student: student for student in grade(given, out, options(again=True), Said(), sources)}
            assert points(after["ada"]) == FULL
            assert points(after["cleo"]) == points(students["cleo"]) | {"3.1": 2.0}  # the one that a hand has set
            for name in ("ada", "cleo"):
                assert [todo.said for todo in after[name].todos] == [todo.said for todo in students[name].todos]
        rows = table(out)
        assert rows["ada"]["answer-3-1"] == "1.5" and rows["ada"]["unmarked"] == "3"
        assert float(rows["cleo"]["3.1"]) == 2.0 and float(rows["ada"]["total"]) == sum(FULL.values()) + 1.5
        assert "A fine thought." in (out / "feedback" / "ada" / "03_crf" / "03_crf.html").read_text(encoding="utf-8")
        assert rows.keys() == {"ada", "bo", "cleo", "dan"}  # the class stays together


def test_only_what_is_new_is_graded_and_the_others_keep_their_place(graded, sources, tmp_path):
    folder, out, _ = graded
    out = Path(shutil.copytree(out, tmp_path / "out"))
    given = Path(shutil.copytree(folder, tmp_path / "in"))
    Student(sources).hand_in(tmp_path / "late")
    shutil.copy(tmp_path / "late" / "04_merge.ipynb", given / "dan")
    said = Said()
    students = {student.student: student for student in grade(given, out, options(), said, sources)}
    assert any("1 have something new" in sentence for sentence in said)
    assert sum(sentence.startswith("[") for sentence in said) == 1
    assert points(students["dan"]) == FULL and points(students["bo"]) == dict.fromkeys(FULL, 0.0)


def test_points_changed_in_a_notebook_are_taken_over_without_losing_marks(graded, sources, tmp_path):
    folder, out, _ = graded
    out = Path(shutil.copytree(out, tmp_path / "out"))
    changed = []
    for path in sources:
        notebook = json.loads(path.read_text(encoding="utf-8"))
        for cell in notebook["cells"]:
            if cell["metadata"].get("nbgrader", {}).get("grade_id") == "answer-3-1":
                cell["metadata"]["nbgrader"]["points"] = 5.0
        changed.append(tmp_path / path.name)
        changed[-1].write_text(json.dumps(notebook), encoding="utf-8")
    shutil.copytree(folder / "ada", tmp_path / "in" / "ada")
    with gradebook(out / "gradebook.db") as book:
        book.find_grade("answer-4-1", "04_merge", "04_merge", "ada").manual_score = 1.0
        book.db.commit()
    grade(tmp_path / "in", out, options(), Said(), changed)
    row = table(out)["ada"]
    assert float(row["most"]) == sum(FULL.values()) + 5 + 2 + 2 + 2 and row["answer-4-1"] == "1"


def test_results_are_not_written_among_other_files(sources, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.txt").write_text("mine")
    Student(sources).hand_in(tmp_path / "in" / "ada")
    with pytest.raises(InstructorError, match="out is there and holds no results"):
        grade(tmp_path / "in", tmp_path / "out", options(), Said(), sources)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("given, said", [("nowhere", "nowhere"), ("empty", "empty")])
def test_a_folder_without_submissions_is_refused_in_a_sentence(given, said, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    flags = [] if SANDBOXED else ["--no-sandbox"]
    assert main(["grade", str(tmp_path / given), "-o", str(tmp_path / "out"), *flags]) == 1
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()  # nothing is left behind


def test_fewer_than_one_worker_is_refused(tmp_path, capsys):
    assert main(["grade", str(tmp_path), "-o", str(tmp_path / "out"), "--workers", "0"]) == 1
    assert "--workers 0" in capsys.readouterr().err


def dependents(number):
    """The TODOs whose functions may call that of this one."""
    return [other for other in TODOS.values() if TODOS[number].name in other.uses]


@pytest.mark.parametrize("number", sorted(number for number in TODOS if dependents(number)))
def test_a_wrong_answer_of_the_corpus_costs_no_points_in_a_todo_that_builds_on_it(number):
    for answer in [answer for answer in corpus.WRONG if answer.number == number][::3]:
        for other in dependents(number):
            names = {}
            exec("import numpy as np\n" + corpus.ANSWERS[other.number], names)
            names[TODOS[number].name] = answer.function
            result = check(other.number, names[other.name], seed=1997)
            assert result.passed, f"{answer.what}: {result}"


def test_the_jobs_run_on_dask_workers_and_give_the_same_marks(graded, sources, tmp_path):
    distributed = pytest.importorskip("distributed", reason="Dask is not installed: the cluster extra")
    folder, _, students = graded
    for name in ("ada", "cleo"):
        (tmp_path / "in" / name).mkdir(parents=True)
        shutil.copy(folder / name / "04_merge.ipynb", tmp_path / "in" / name)
    workers = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with distributed.LocalCluster(**workers) as cluster:
        options_there = options(scheduler=cluster.scheduler_address)
        there = grade(tmp_path / "in", tmp_path / "out", options_there, Said(), sources)
    assert [student.student for student in there] == ["ada", "cleo"]
    for student in there:
        here = {number: got for number, got in points(students[student.student]).items() if number[0] == "4"}
        assert {number: got for number, got in points(student).items() if number[0] == "4"} == here


def test_a_scheduler_that_is_not_there_is_named(graded, sources, tmp_path):
    pytest.importorskip("distributed", reason="Dask is not installed: the cluster extra")
    folder, _, _ = graded
    with pytest.raises(InstructorError, match=r"tcp://127\.0\.0\.1:1"):
        grade(folder, tmp_path / "out", options(scheduler="tcp://127.0.0.1:1"), Said(), sources)


def test_the_whole_course_with_all_solutions_gets_every_point_and_the_empty_student_edition_none(tmp_path):
    edition, _ = release(tmp_path / "edition")
    shutil.copytree(edition / "notebooks", tmp_path / "in" / "empty")
    fill_in(edition)
    shutil.copytree(edition / "notebooks", tmp_path / "in" / "solved")
    students = {one.student: one for one in grade(tmp_path / "in", tmp_path / "out", options(), Said())}
    assert points(students["solved"]) == {number: most_points(number) for number in TODOS}
    assert points(students["empty"]) == dict.fromkeys(TODOS, 0.0)
    for student in students.values():
        assert [notebook.name for notebook in student.notebooks] == [path.stem for path in source_notebooks()]
        assert not student.all_flags
        assert {notebook.kind for notebook in student.notebooks} == {"graded"}
    for path in (tmp_path / "out" / "autograded").rglob("*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        shown = [output for cell in cells for output in cell.get("outputs", ())]
        assert not [output for output in shown if output["output_type"] == "error"], path
        assert not [output for output in shown if output.get("name") == "stderr"], path
        printed = "".join("".join(output.get("text", ())) for output in shown)
        # Nothing that the course made is kept as the student's.
        if path.stem in ("03_crf", "04_merge"):
            assert ("Kept for the next" if "solved" in path.parts else "Not kept: the course's own") in printed
