"""Grading one student's notebooks, in a process of its own: python -m hdr_helpers.grading._running.job FOLDER

nbgrader grades, each notebook as an assignment, with a gradebook that is a copy for this student alone. What a notebook
does to its kernel or to this process costs no other submission: the one who waits for it goes on with what was written.

FOLDER has job.json (see Job), in/NAME.ipynb, marked/NAME.json and course/gradebook.db. Written, each as soon as it is
known: out/NAME.ipynb (as graded) and out/NAME.json (its outcome).
"""

import json
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import nbformat
from nbgrader.converters import Autograde
from nbgrader.preprocessors import Execute
from nbgrader.utils import compute_checksum

from hdr_helpers.grading._intake.copies import copied_from_the_course
from hdr_helpers.grading._intake.mend import Unreadable, mend
from hdr_helpers.grading._running.execution import ExecuteSubmission, Task, number_of
from hdr_helpers.grading._running.sandbox import Bounds
from hdr_helpers.grading.course import nbgrader_api
from hdr_helpers.grading.outcome import NotebookOutcome, TodoOutcome, WrittenOutcome, to_json
from hdr_helpers.grading.solutions import is_written
from hdr_helpers.lab.checks import most_points
from hdr_helpers.lab.checks._todos import NOT_LOOKED_AT
from hdr_helpers.merge import write_whole


@dataclass(frozen=True)
class Job:
    """What a job needs to know besides the files in its folder. names : of the notebooks, in order"""

    student: str
    names: list[str]
    seed: int
    bounds: Bounds
    sandboxed: bool

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> "Job":
        facts = json.loads(text)
        return Job(**facts | {"bounds": Bounds(**facts["bounds"])})


def main(folder: Path) -> None:
    """Grade the notebooks that have no outcome yet."""
    job = Job.from_json((folder / "job.json").read_text(encoding="utf-8"))
    for name in job.names:
        result = folder / "out" / f"{name}.json"
        if result.exists():
            continue
        write_whole(result, to_json(grade(folder, name, job)).encode())


def grade(folder: Path, name: str, job: Job) -> NotebookOutcome:
    """Grade one notebook. The graded file is out/NAME.ipynb; there is none where the submission is unreadable."""
    began = time.monotonic()
    marked = json.loads((folder / "marked" / f"{name}.json").read_text(encoding="utf-8"))
    try:
        notebook, flags = mend((folder / "in" / f"{name}.ipynb").read_bytes(), marked)
    except Unreadable as problem:
        return nothing(name, "unreadable", marked, str(problem))
    submitted = folder / "course" / "submitted" / job.student / name / f"{name}.ipynb"
    submitted.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, submitted)
    task = Task(folder / "kernels" / name, job.bounds, job.seed, job.sandboxed)
    graded, problem = _by_nbgrader(folder / "course", name, job.student, task)
    outcome = NotebookOutcome(name, "stopped" if task.stopped or problem else "graded", flags=flags + task.flags)
    outcome.asides = copied_from_the_course(notebook)
    if problem:
        outcome.flags.append(problem)
    else:
        write_whole(folder / "out" / f"{name}.ipynb", graded.read_bytes())
        outcome.written = _answers(nbformat.read(graded, as_version=4))
    outcome.todos = [_todo_outcome(number, task) for number in numbers_in(marked)]
    outcome.seconds = round(time.monotonic() - began, 1)
    return outcome


def _by_nbgrader(place, name, student, task) -> tuple[Path, str]:
    """Let nbgrader grade. Returns the graded file, and what kept it from grading or nothing."""
    api = nbgrader_api(place)
    ExecuteSubmission.task = task
    steps = Autograde().autograde_preprocessors
    api.config.Autograde.autograde_preprocessors = [ExecuteSubmission if step is Execute else step for step in steps]
    result = api.autograde(name, student, force=True)
    graded = place / "autograded" / student / name / f"{name}.ipynb"
    if result["success"] and graded.exists():
        return graded, ""
    said = [line for line in (result.get("error") or result.get("log") or "").splitlines() if line.strip()]
    return graded, f"nbgrader could not grade it: {' '.join(said[-1:])[:300]}"


def numbers_in(marked) -> list[str]:
    """The numbers of the TODOs of a notebook, in order."""
    return [number for cell in map(nbformat.from_dict, marked) if (number := number_of(cell))]


def _todo_outcome(number, task) -> TodoOutcome:
    result = task.results.get(number)
    most = most_points(number)
    if result is None:
        return TodoOutcome(number, 0.0, most, "unasked", ["The notebook was not run as far as this check."])
    said = [line.sentence for line in result.lines if line.state == "wrong" and line.sentence != NOT_LOOKED_AT]
    if number not in task.asked:
        state = "unasked"
    elif not result.started:
        state = "empty"
    elif result.passed:
        state = "right"
    else:
        state = "partial" if result.points else "wrong"
    return TodoOutcome(number, result.points, most, state, said)


def _answers(notebook) -> list[WrittenOutcome]:
    """The answers in words. One that is as it was handed out gets 0 points from nbgrader, without an instructor."""
    found = []
    for cell in filter(is_written, notebook.cells):
        facts = cell.metadata.nbgrader
        answered = facts.get("checksum") != compute_checksum(cell)
        points = None if answered else 0.0
        found.append(WrittenOutcome(facts["grade_id"], points, float(facts["points"]), answered))
    return found


def nothing(name: str, kind: str, marked: list[dict], flag: str) -> NotebookOutcome:
    """The outcome of a notebook of which nothing could be graded."""
    todos = [TodoOutcome(number, 0.0, most_points(number), "unasked", [flag]) for number in numbers_in(marked)]
    facts = [cell["metadata"]["nbgrader"] for cell in filter(is_written, marked)]
    written = [WrittenOutcome(fact["grade_id"], 0.0, float(fact["points"]), answered=False) for fact in facts]
    return NotebookOutcome(name, kind, todos, written, [flag])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
