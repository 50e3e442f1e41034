"""Grading a class: a folder of submissions in; a table, a report, pages for students and nbgrader's gradebook out.

The folder of results is an nbgrader course of its own, so that answers in words are marked there with nbgrader's
formgrader. Graded again into the same folder, only what is new is run, and what an instructor has set stays.
"""

import hashlib
import json
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from hdr_helpers.grading._intake.collect import Submission, collect
from hdr_helpers.grading._intake.mend import marked_cells
from hdr_helpers.grading._reporting.report import write_csv, write_report, write_student_pages
from hdr_helpers.grading._running.job import Job, nothing
from hdr_helpers.grading._running.sandbox import Bounds, require_sandbox
from hdr_helpers.grading._running.workers import Work, fingerprint, results
from hdr_helpers.grading.course import SEED, InstructorError, nbgrader_api, source_notebooks, stage
from hdr_helpers.grading.gradebook import bring_up_to_date, enter, gradebook
from hdr_helpers.grading.outcome import NotebookOutcome, StudentOutcome, from_json, to_json
from hdr_helpers.grading.solutions import read_notebook
from hdr_helpers.lab.checks import TODOS
from hdr_helpers.merge import write_whole

CONFIG = """# The gradebook and the graded notebooks of a class; nbgrader reads this file where it is started in here.
from pathlib import Path

c = get_config()  # noqa: F821  nbgrader provides it
c.CourseDirectory.root = str(Path(__file__).parent)
"""
FEW = 10  # pages of feedback; to start processes for no more takes longer than to write them


@dataclass(frozen=True)
class Options:
    """How a class is graded. again : also what has been graded before; the others as for Job and results"""

    workers: int = 2
    scheduler: str | None = None
    seed: int = SEED
    bounds: Bounds = field(default_factory=Bounds)
    sandboxed: bool = True
    again: bool = False


def grade(submissions, out, options: Options, say: Callable[[str], None] = print, notebooks=None):
    """Grade all submissions.

    submissions : folder or zip, see collect; out : folder of the results, new or of an earlier run
    notebooks : of the source edition; the course's five where none are given
    say : is told how far it is
    Returns a list of StudentOutcome for the whole class, earlier runs included. Raises InstructorError where nothing
    can be graded at all; what is wrong with one submission is a flag of that one.
    """
    out = Path(out).resolve()
    if out.exists() and any(out.iterdir()) and not (out / "gradebook.db").exists():
        raise InstructorError(f"{out} is there and holds no results of grading; give another folder with -o.")
    if options.sandboxed:
        require_sandbox()
    notebooks = notebooks or source_notebooks()
    handed_in = collect(submissions, [path.stem for path in notebooks])
    marked = prepare(out, notebooks, say)
    works, keys = _works(handed_in, out, marked, options)
    say(f"{len(handed_in)} submissions; {len(works)} have something new to grade.")
    for submission in handed_in:
        _remember(out, submission, marked, options)
    by_student = {submission.student: submission for submission in handed_in}
    for k, (student, graded) in enumerate(results(works, options.workers, options.scheduler), 1):
        for name, (outcome, notebook) in graded.items():
            _file(out, by_student[student], name, outcome, notebook, keys[student, name])
        points = sum(todo.points for outcome, _ in graded.values() for todo in outcome.todos)
        seconds = sum(outcome.seconds for outcome, _ in graded.values())
        say(f"[{k}/{len(works)}] {student}: {points:g} points by the checks, in {seconds:.0f} s")
    return report(out, list(marked), options, say)


def prepare(out: Path, notebooks: list[Path], say) -> dict[str, list[dict]]:
    """Bring the gradebook up to date with the course's notebooks. Returns the marked cells of each."""
    out.mkdir(parents=True, exist_ok=True)
    write_whole(out / "nbgrader_config.py", CONFIG.encode())
    api = nbgrader_api(out)
    marked, template = {}, out / "template.db"
    for path in notebooks:
        name = path.stem
        staged, released = (out / step / name / path.name for step in ("source", "release"))
        before = staged.read_bytes() if staged.exists() else b""
        stage([path], out)
        if staged.read_bytes() != before or not released.exists():
            say(f"Reading {name} into the gradebook.")
            template.unlink(missing_ok=True)
            result = api.generate_assignment(name, force=True)
            if not result["success"]:
                staged.unlink()
                raise InstructorError(f"nbgrader could not read {name}: {(result.get('log') or '').strip()[-600:]}")
        marked[name] = marked_cells(read_notebook(released))
    if not template.exists():  # a gradebook that knows the notebooks and no student, for the jobs
        write_whole(template, (out / "gradebook.db").read_bytes())
        with gradebook(template) as book:
            for student in book.students:
                book.remove_student(student.id)
    return marked


def _works(handed_in, out, marked, options) -> tuple[list[Work], dict]:
    """What has to be run, and a key for each notebook that says with what it was graded."""
    course, template = fingerprint(), (out / "template.db").read_bytes()
    conditions = (course, options.seed, options.sandboxed, json.dumps(asdict(options.bounds)))
    works, keys = [], {}
    for submission in handed_in:
        fresh = {}
        for name, data in submission.notebooks.items():
            known = json.dumps(marked[name], sort_keys=True).encode()
            keys[submission.student, name] = hashlib.sha256(repr(conditions).encode() + known + data).hexdigest()
            facts = _facts(out, submission.student, name)
            if options.again or facts is None or facts["key"] != keys[submission.student, name]:
                fresh[name] = data
        if fresh:
            job = Job(submission.student, sorted(fresh), options.seed, options.bounds, options.sandboxed)
            elsewhere = course if options.scheduler else ""
            works.append(Work(job, fresh, {name: marked[name] for name in fresh}, template, elsewhere))
    return works, keys


def _place(out: Path, student: str, name: str) -> Path:
    return out / "outcomes" / student / f"{name}.json"


def _facts(out, student, name) -> dict | None:
    """What an earlier run has written down about a notebook: key, outcome (as text), feedback_of."""
    try:
        facts = json.loads(_place(out, student, name).read_text(encoding="utf-8"))
        from_json(facts["outcome"])
        return facts
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write_facts(out, student, name, facts) -> None:
    place = _place(out, student, name)
    place.parent.mkdir(parents=True, exist_ok=True)
    write_whole(place, json.dumps(facts, indent=1, ensure_ascii=False).encode())


def _remember(out, submission: Submission, marked, options) -> None:
    """Write down who has handed in, and that notebooks are missing."""
    place = out / "outcomes" / submission.student / "student.json"
    place.parent.mkdir(parents=True, exist_ok=True)
    flags = submission.flags + ["handed in late"] * submission.late
    write_whole(place, json.dumps({"name": submission.name, "flags": flags}, ensure_ascii=False).encode())
    for name in marked:
        if name not in submission.notebooks and _facts(out, submission.student, name) is None:
            outcome = nothing(name, "missing", marked[name], "It was not handed in.")
            _file(out, submission, name, outcome, None, "missing")


def _file(out, submission, name, outcome: NotebookOutcome, graded: bytes | None, key: str) -> None:
    """Keep one result: the files where nbgrader expects them, the points in the gradebook, the outcome beside."""
    student = submission.student
    for step, data in (("submitted", submission.notebooks.get(name)), ("autograded", graded)):
        place = out / step / student / name / f"{name}.ipynb"
        if data is None:
            place.unlink(missing_ok=True)
        else:
            place.parent.mkdir(parents=True, exist_ok=True)
            write_whole(place, data)
    with gradebook(out / "gradebook.db") as book:
        enter(book, student, outcome, graded)
    _write_facts(out, student, name, {"key": key, "outcome": to_json(outcome), "feedback_of": ""})


def report(out: Path, names: list[str], options: Options, say) -> list[StudentOutcome]:
    """Write table, report and students' pages from what is in the folder and in the gradebook.

    names : of the notebooks, in order
    """
    students, stale = [], {}
    with gradebook(out / "gradebook.db") as book:
        for place in sorted((out / "outcomes").iterdir()):
            who = json.loads((place / "student.json").read_text(encoding="utf-8"))
            notebooks = []
            for name in names:
                facts = _facts(out, place.name, name)
                if facts is None:
                    continue
                outcome = from_json(facts["outcome"])
                marks = bring_up_to_date(book, place.name, outcome)
                notebooks.append(outcome)
                graded = out / "autograded" / place.name / name / f"{name}.ipynb"
                if graded.exists() and facts["feedback_of"] != marks:
                    stale.setdefault(place.name, []).append((name, facts | {"feedback_of": marks}))
            students.append(StudentOutcome(place.name, who["name"], notebooks, who["flags"]))
    _write_feedback(out, stale, options.workers, say)
    pages = {
        (student.student, notebook.name): f"{notebook.name}/{notebook.name}.html"
        for student in students
        for notebook in student.notebooks
        if (out / "feedback" / student.student / notebook.name / f"{notebook.name}.html").exists()
    }
    write_student_pages(out / "feedback", students, pages)
    write_csv(out / "grades.csv", students)
    notes = [
        f"Graded with data of seed {options.seed}, {'in a sandbox' if options.sandboxed else 'without a sandbox'}.",
        "Answers in words are marked with nbgrader's formgrader; run the same command again to bring this up to date.",
    ]
    links = {student.student: f"feedback/{student.student}/index.html" for student in students}
    functions = {number: todo.name for number, todo in TODOS.items()}
    place = write_report(out, students, title="HDR imaging: the class", notes=notes, links=links, names=functions)
    say(f"Report: {place}\nTable:  {out / 'grades.csv'}")
    return students


def _write_feedback(out, stale, workers, say) -> None:
    """Let nbgrader write the feedback pages of what has changed."""
    if not stale:
        return
    say(f"Writing feedback for {len(stale)} students.")
    names = [[name for name, _ in pages] for pages in stale.values()]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        spread = pool.map if sum(map(len, names)) > FEW else map
        for (student, pages), done in zip(stale.items(), spread(partial(feedback, out), stale, names), strict=True):
            for name, facts in pages:
                if name in done:
                    _write_facts(out, student, name, facts)
                else:
                    say(f"nbgrader could not write its feedback on {name} of {student}.")


def feedback(out: Path, student: str, names: list[str]) -> list[str]:
    """Let nbgrader write the feedback pages of one student. Returns the names of the notebooks where it could."""
    api = nbgrader_api(out)
    return [name for name in names if api.generate_feedback(name, student, force=True)["success"]]
