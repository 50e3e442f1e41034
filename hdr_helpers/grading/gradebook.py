"""nbgrader's gradebook of a class: what grading found goes in, what instructors have set by hand comes out."""

import warnings
from contextlib import contextmanager
from pathlib import Path

import nbformat
from nbgrader.api import Gradebook, MissingEntry
from nbgrader.preprocessors import SaveAutoGrades
from sqlalchemy.exc import SAWarning

from hdr_helpers.grading.outcome import NotebookOutcome


@contextmanager
def gradebook(path: Path):
    """The gradebook in a file."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SAWarning)  # of nbgrader's own queries
        with Gradebook(f"sqlite:///{path.as_posix()}") as book:
            yield book


def enter(book, student: str, outcome: NotebookOutcome, graded: bytes | None) -> None:
    """Put one graded notebook into the gradebook; what an instructor has set stays.

    graded : the executed notebook, whose check cells show the points; None where there is nothing but zeros
    """
    name = outcome.name
    book.update_or_create_student(student)
    book.update_or_create_submission(name, student)
    if graded is None:
        for grade in book.find_submission_notebook(name, name, student).grades:
            grade.auto_score, grade.needs_manual_grade = 0, False
        book.db.commit()
        return
    facts = {"student": student, "assignment": name, "notebook": name, "db_url": str(book.engine.url)}
    SaveAutoGrades().preprocess(nbformat.reads(graded.decode("utf-8"), as_version=4), {"nbgrader": facts})


def bring_up_to_date(book, student: str, outcome: NotebookOutcome) -> str:
    """Set an outcome's points to those in the gradebook, and return a word that changes when a mark or comment does."""
    try:
        notebook = book.find_submission_notebook(outcome.name, outcome.name, student)
    except MissingEntry:
        return ""
    grades = {grade.name: grade for grade in notebook.grades}
    for todo in outcome.todos:
        grade = grades.get(f"check-{todo.number.replace('.', '-')}")
        if grade is not None:
            todo.points, todo.most, todo.by_hand = grade.score, grade.max_score, grade.manual_score is not None
    for answer in outcome.written:
        grade = grades.get(answer.grade_id)
        if grade is not None:
            unmarked = grade.manual_score is None and grade.auto_score is None
            answer.points, answer.most = (None if unmarked else grade.score), grade.max_score
    marks = [(grade.name, grade.score, grade.max_score) for grade in notebook.grades]
    comments = [(comment.name, comment.comment) for comment in notebook.comments]
    return repr(sorted(marks) + sorted(comments, key=str))
