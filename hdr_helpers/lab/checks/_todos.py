"""The list of all TODOs, and how one is checked."""

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import wraps

import numpy as np

from hdr_helpers.lab.checks._reach import Reach, out_of_reach
from hdr_helpers.lab.checks._report import Line, Result
from hdr_helpers.lab.checks._running import NotStarted, Stop, Wrong, name_of, run_safely

TODOS = {}
NOT_LOOKED_AT = "Not looked at, because of what is said above."


@dataclass
class Todo:
    """One TODO.

    number : "3.3"; name : of the function; course : the course's own answer, written another way than the student
        is asked to
    uses : names of functions of earlier TODOs that it may call; the course lends its own while it is checked, so that
        a mistake is reported once, where it was made
    barred : groups of answers that are out of reach
    hints : a ladder of questions; praise : what to do when all is right
    parts : (points, sentence when right, function of a Trial) each
    """

    number: str
    name: str
    course: Callable
    hints: tuple[str, ...]
    praise: str
    uses: tuple[str, ...] = ()
    barred: tuple[str, ...] = ()
    parts: list = field(default_factory=list)

    def __post_init__(self):
        TODOS[self.number] = self
        self.course = _only_for_the_course(self.course, self.name)

    def part(self, points: float, says: str):
        """Decorator: a function of a Trial that raises Wrong with a sentence is a part of this TODO."""

        def add(function):
            self.parts.append((points, says, function))
            return function

        return add


def _only_for_the_course(function, name):
    """function, out of reach while a student's function runs."""

    @wraps(function)
    def course(*args, **keywords):
        reach = Reach.active
        if reach is None:
            return function(*args, **keywords)
        if not reach.helping:
            reach.called.append(f"the course's {name}")
        return reach.helper(function)(*args, **keywords)

    course.__name__ = name
    return course


def call(todo: Todo, function, args, keywords, limit: float):
    """What a student's function returns for copies of these arguments, with the answers to its TODO out of reach.

    limit : seconds
    Raises as run_safely does, and Stop where the function calls an answer that already exists.
    """
    lent = {other.name: other.course for other in TODOS.values() if other.name in todo.uses}
    with out_of_reach(function, todo.barred, lent) as reach:
        try:
            return run_safely(function, args, keywords, limit)
        finally:
            if reach.called:
                names = " and ".join(dict.fromkeys(reach.called))
                raise Stop(
                    f"{name_of(function)} calls {names}, which is an answer that already exists; here it is "
                    "out of reach, because you are to write your own."
                )


class Trial:
    """One check of one function: runs it, remembers the largest difference, and what there is to note.

    call : how the function is called; grading calls it in another process
    """

    def __init__(self, todo: Todo, function, seed: int, limit: float, call=call):
        self.todo, self.function, self.seed, self.call = todo, function, seed, call
        self.left = limit  # seconds
        self.notes, self.worst, self.usable = [], None, True

    def rng(self, *key: int) -> np.random.Generator:
        """Random numbers of this seed; other keys, other numbers."""
        return np.random.default_rng((self.seed, *key))

    def run(self, *args, **keywords):
        """What the student's function returns for copies of these arguments. Raises as call does."""
        began = time.monotonic()
        try:
            return self.call(self.todo, self.function, args, keywords, self.left)
        finally:
            self.left -= time.monotonic() - began

    def compare(self, what: str, yours, spec) -> None:
        """Remember the place where yours differs most from what is expected."""
        yours, spec = np.asarray(yours, dtype=np.float64), np.asarray(spec, dtype=np.float64)
        if yours.shape != spec.shape or not yours.size:
            return
        apart = np.nan_to_num(np.abs(yours - spec), nan=np.inf)
        at = np.unravel_index(np.argmax(apart), apart.shape)
        if self.worst is None or apart[at] > self.worst[0]:
            place = f"[{', '.join(map(str, map(int, at)))}]" if at else ""
            numbers = f"yours {yours[at]:.6g}, spec {spec[at]:.6g}, largest difference {apart[at]:.2g}"
            self.worst = apart[at], f"{what}{place}: {numbers}."

    def note(self, sentence: str) -> None:
        if sentence not in self.notes:
            self.notes.append(sentence)


def examine(todo: Todo, function, seed: int, limit: float, call=call) -> Result:
    """Check a function against every part of a TODO."""
    own = own_of(function)
    trial, lines, ended = Trial(todo, own, seed, limit, call), [], None
    for k, (points, says, part) in enumerate(todo.parts):
        if ended:
            lines.append(Line("wrong", NOT_LOOKED_AT, points))
            continue
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):  # anything on stderr would cost all points
                warnings.simplefilter("ignore")
                part(trial)
            lines.append(Line("right", says, points))
        except NotStarted:
            empty = [Line("open", f"{says[:-1]}: not started yet.", points) for points, says, _ in todo.parts]
            last = f"Not started yet; until then the course's own {todo.name} goes on in its place."
            return Result(todo.number, empty, last, stand_in(todo, own), own=False)
        except Wrong as problem:
            lines.append(Line("wrong", str(problem), points))
            ended = isinstance(problem, Stop) or k == 0
        except Exception as problem:  # what was returned is so odd that looking at it fails
            said = f"{type(problem).__name__}: {problem}"[:160]
            lines.append(Line("wrong", f"What it returns could not be looked at ({said}).", points))
            ended = k == 0
    result = Result(todo.number, lines, "", own, notes=trial.notes)
    if trial.worst and (trial.worst[0] or result.passed):
        result.difference = trial.worst[1]
    if not trial.usable or ended:
        result.function, result.own = stand_in(todo, own), False
    if result.passed:
        result.last = todo.praise
    elif result.own:
        result.last = f'Mend it and run both cells again; hint("{todo.number}") asks a question that may help.'
    else:
        result.last = (
            f'Until it is mended, the course\'s own {todo.name} goes on in its place; hint("{todo.number}") helps.'
        )
    return result


def own_of(function):
    """The student's function, where the course's may stand in its place: a cell may be run twice."""
    own = getattr(function, "in_place_of", function)
    return own if callable(own) else _not_callable(own)


def stand_in(todo: Todo, own):
    """The course's function, which remembers in whose place it stands."""

    @wraps(todo.course)
    def course(*args, **keywords):
        return todo.course(*args, **keywords)

    course.in_place_of = own
    return course


def _not_callable(value):
    def function(*_, **__):
        raise TypeError(f"a {type(value).__name__} was given to the check where a function should stand")

    return function
