"""Checks that name the mistake, and hints that ask before they tell.

    check("3.3", build_system)      what is right, what is wrong, and how it can be recognised
    hint("3.3")                     a question; called again, the next one

A check looks at properties that follow from the physics and the paper, on data of its own. Each notebook has a room.
"""

import os

from hdr_helpers.lab.checks import align, crf, curves, load, maps, merge, shift, system, tonemap  # noqa: F401  (they fill TODOS)
from hdr_helpers.lab.checks._examined import EXAMINER, ask
from hdr_helpers.lab.checks._report import Hint, Result
from hdr_helpers.lab.checks._todos import TODOS, examine

__all__ = ["CheckFailed", "check", "hint", "most_points"]

MUST_PASS = "HDR_CHECKS_MUST_PASS"  # environment variable; 1 where a check that is short of points is an error
LIMIT = 20.0  # seconds for all calls of a check together
_asked = {}


class CheckFailed(AssertionError):
    """A check was short of full points where it must not be."""


def check(number: str, function, *, seed: int = 0, limit: float = LIMIT) -> Result:
    """Check the function of a TODO.

    number : of the TODO, such as "3.3"; function : the student's
    seed : of the data; another seed asks the same of other data
    limit : seconds that the function may take in all
    Returns a Result: shown as a table, as text the points alone; .function is the function to go on with.
    Where the environment names an examiner, as grading does, that chooses the data and the limit.
    Raises ValueError for a number that is not a TODO's, and CheckFailed under HDR_CHECKS_MUST_PASS=1 where points
    are missing. What the function does never raises.

    >>> check("3.1", lambda: 5).passed  # a number is no array of weights
    False
    """
    examiner = os.environ.get(EXAMINER)
    todo = _todo(number)
    result = ask(examiner, todo, function) if examiner else examine(todo, function, seed, limit)
    if os.environ.get(MUST_PASS, "") not in ("", "0") and not result.passed:
        raise CheckFailed(str(result))
    return result


def hint(number: str) -> Hint:
    """The next hint for a TODO; after the last one, the last one again. Raises ValueError for an unknown number.

    number : of the TODO, such as "3.3"

    >>> hint("3.1")
    Hint 1 of ...
    """
    rungs = _todo(number).hints
    _asked[number] = min(_asked.get(number, 0) + 1, len(rungs))
    return Hint(number, _asked[number], len(rungs), rungs[_asked[number] - 1])


def most_points(number: str) -> float:
    """What a TODO is worth, in points. Raises ValueError for an unknown number.

    number : of the TODO, such as "3.3"

    >>> most_points("3.3") > most_points("3.1")  # the matrix is worth more than the hat
    True
    """
    return float(sum(points for points, _, _ in _todo(number).parts))


def _todo(number):
    if number not in TODOS:
        raise ValueError(f"There is no TODO {number!r}; there are {', '.join(sorted(TODOS))}.")
    return TODOS[number]
