"""A check that is asked from another process, which the student's process can't reach into.

Grading sets EXAMINER to the address of an examiner. The student's function runs here, where it was written; the data
are made and the answers looked at over there. So nothing that runs in a notebook can give itself points.
"""

import os
from multiprocessing.connection import Client

from hdr_helpers.lab.checks._report import Line, Result
from hdr_helpers.lab.checks._running import NotStarted, Stop, Wrong
from hdr_helpers.lab.checks._todos import Todo, call, own_of, stand_in
from hdr_helpers.lab.checks._wire import pack, unpack

# Environment variables: an address for multiprocessing.connection; and what tells the question of the check cell that
# runs from one that was asked before and is read late.
EXAMINER, TICKET = "HDR_EXAMINER", "HDR_TICKET"


def ask(address: str, todo: Todo, function) -> Result:
    """Let the examiner at this address check a function of a TODO.

    Raises OSError or EOFError where there is none, or where it goes away.
    """
    own = own_of(function)
    with Client(address) as line:
        line.send_bytes(pack({"check": todo.number, "ticket": os.environ.get(TICKET, "")}))
        while "result" not in (question := unpack(line.recv_bytes())):
            line.send_bytes(answer(todo, own, question))
    facts = question["result"]
    lines = [Line(*line) for line in facts.pop("lines")]
    goes_on = own if facts["own"] else stand_in(todo, own)
    return Result(lines=lines, function=goes_on, **facts)


def told(result: Result) -> bytes:
    """A result as the examiner sends it: everything but the function."""
    facts = {name: getattr(result, name) for name in ("number", "last", "own", "difference", "notes")}
    return pack({"result": facts | {"lines": [(line.state, line.sentence, line.points) for line in result.lines]}})


def answer(todo: Todo, function, question: dict) -> bytes:
    """What comes of one call of the function, for the examiner."""
    try:
        return pack({"value": call(todo, function, question["args"], question["keywords"], question["limit"])})
    except NotStarted:
        return pack({"not started": True})
    except Stop as problem:
        return pack({"stop": str(problem)})
    except Wrong as problem:
        return pack({"wrong": str(problem)})
    except Exception as problem:  # a value that can't even be looked at
        return pack({"wrong": f"What it returns could not be looked at ({type(problem).__name__}: {problem})."[:300]})
