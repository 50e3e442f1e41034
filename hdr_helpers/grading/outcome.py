"""What grading found out about a class: the facts from which table, report and feedback are made. Plain data."""

import json
from dataclasses import asdict, dataclass, field

STATES = ("right", "partial", "wrong", "empty", "unasked")  # of a TODO
KINDS = ("graded", "missing", "unreadable", "stopped")  # of a notebook


@dataclass
class TodoOutcome:
    """One TODO of one student.

    number : "3.3"; points of most
    state : right (all points), partial, wrong (started, no points), empty (still the stub), unasked (its check could
        not be run)
    said : a sentence for each part that is wrong, or why the check could not be run
    by_hand : whether an instructor has set the points in the gradebook
    """

    number: str
    points: float
    most: float
    state: str
    said: list[str] = field(default_factory=list)
    by_hand: bool = False


@dataclass
class WrittenOutcome:
    """One answer in words. grade_id : of its cell; points : None until an instructor has marked it; answered or not"""

    grade_id: str
    points: float | None
    most: float
    answered: bool = True


@dataclass
class NotebookOutcome:
    """One notebook of one student.

    name : "03_crf"; kind : graded, missing, unreadable (no notebook at all), stopped (graded as far as it ran)
    flags : sentences that instructor and student should read; asides : for the instructor alone
    seconds : that grading took
    """

    name: str
    kind: str
    todos: list[TodoOutcome] = field(default_factory=list)
    written: list[WrittenOutcome] = field(default_factory=list)
    flags: list[str] = field(default_factory=list)
    seconds: float = 0.0
    asides: list[str] = field(default_factory=list)


@dataclass
class StudentOutcome:
    """One student. student : the id; name : as the platform gives it, or empty; flags : for the instructor alone"""

    student: str
    name: str
    notebooks: list[NotebookOutcome]
    flags: list[str] = field(default_factory=list)

    @property
    def todos(self) -> list[TodoOutcome]:
        return [todo for notebook in self.notebooks for todo in notebook.todos]

    @property
    def written(self) -> list[WrittenOutcome]:
        return [answer for notebook in self.notebooks for answer in notebook.written]

    @property
    def points(self) -> float:
        """Of TODOs and of answers that are marked."""
        return sum(todo.points for todo in self.todos) + sum(answer.points or 0 for answer in self.written)

    @property
    def most(self) -> float:
        return sum(part.most for part in (*self.todos, *self.written))

    @property
    def unmarked(self) -> int:
        """How many answers in words wait for an instructor."""
        return sum(answer.points is None for answer in self.written)

    @property
    def all_flags(self) -> list[str]:
        both = ((notebook, flag) for notebook in self.notebooks for flag in (*notebook.flags, *notebook.asides))
        return self.flags + [f"{notebook.name}: {flag}" for notebook, flag in both]


def to_json(outcome: NotebookOutcome) -> str:
    return json.dumps(asdict(outcome), indent=1, ensure_ascii=False)


def from_json(text: str) -> NotebookOutcome:
    """The inverse of to_json. Raises ValueError, KeyError or TypeError where the text is something else."""
    facts = json.loads(text)
    facts["todos"] = [TodoOutcome(**todo) for todo in facts["todos"]]
    facts["written"] = [WrittenOutcome(**answer) for answer in facts["written"]]
    return NotebookOutcome(**facts)
