"""The TODOs and model answers of the source notebooks, and whether a text gives one away. Works without nbgrader.

A solution stands between the two marks. In a text cell each mark is within an HTML comment, which is not shown; bare it
would be a heading.
"""

import json
import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

BEGIN, END = "### BEGIN SOLUTION", "### END SOLUTION"
HIDDEN = "BEGIN HIDDEN TESTS"
IDIOM = 45  # characters; a shorter line of a longer solution, such as "return best", may stand elsewhere by chance


@dataclass(frozen=True)
class Todo:
    """One exercise of a source notebook."""

    grade_id: str
    function: str  # the name of the function that the student writes
    solution: tuple[str, ...]  # the lines between the two marks, as they stand there


@dataclass(frozen=True)
class Written:
    """One question of a source notebook that is answered in words and marked by an instructor."""

    grade_id: str
    points: float  # at most
    solution: tuple[str, ...]  # the model answer and the line for the marker, as they stand there


def read_notebook(path) -> dict:
    """A notebook file as a dictionary, the source of each cell as one string.

    Raises ValueError where the file is not a notebook.
    """
    try:
        notebook = json.loads(Path(path).read_text(encoding="utf-8"))
        for cell in notebook["cells"]:
            cell["source"] = "".join(cell["source"])
    except (ValueError, KeyError, TypeError) as problem:
        raise ValueError(f"{path} is not a notebook ({problem!r}); open it in JupyterLab and save it again.") from None
    return notebook


def notebook_bytes(notebook: dict) -> bytes:
    """A notebook as JupyterLab would save it, the same bytes on every system."""
    cells = [cell | {"source": cell["source"].splitlines(keepends=True)} for cell in notebook["cells"]]
    text = json.dumps(notebook | {"cells": cells}, indent=1, ensure_ascii=False, sort_keys=True)
    return (text + "\n").encode("utf-8")


def is_todo(cell: dict) -> bool:
    """Is this the cell of an exercise, in which a student writes code?"""
    return cell["cell_type"] == "code" and bool(cell["metadata"].get("nbgrader", {}).get("solution"))


def is_written(cell: dict) -> bool:
    """Is this the cell in which a student answers a question in words?"""
    return cell["cell_type"] == "markdown" and bool(cell["metadata"].get("nbgrader", {}).get("solution"))


def todos(notebook: dict) -> list[Todo]:
    """Every exercise of a source notebook, in order.

    Raises ValueError where a TODO has no solution between the two marks, or more than one.
    """
    found = []
    for cell in filter(is_todo, notebook["cells"]):
        named = re.search(r"^def (\w+)", cell["source"], re.M)
        found.append(Todo(cell["metadata"]["nbgrader"]["grade_id"], named[1] if named else "", _between_marks(cell)))
    return found


def written(notebook: dict) -> list[Written]:
    """Every question of a source notebook that is answered in words, in order.

    Raises ValueError where a cell for an answer has no model answer between the two marks, or more than one.
    """
    found = []
    for cell in filter(is_written, notebook["cells"]):
        settings = cell["metadata"]["nbgrader"]
        found.append(Written(settings["grade_id"], settings["points"], _between_marks(cell)))
    return found


def _between_marks(cell: dict) -> tuple[str, ...]:
    lines = cell["source"].splitlines()
    bare = [re.sub(r"^<!-- (.*) -->$", r"\1", line.strip()) for line in lines]
    marks = [line for line in bare if line in (BEGIN, END)]
    if marks != [BEGIN, END]:
        grade_id = cell["metadata"]["nbgrader"]["grade_id"]
        raise ValueError(f"{grade_id} has the marks {marks}; it should have one {BEGIN} and then one {END}.")
    return tuple(lines[bare.index(BEGIN) + 1 : bare.index(END)])


def without_solutions(notebook: dict) -> str:
    """Everything that a source notebook says outside solutions and hidden tests, a line each."""
    text = "\n".join(cell["source"] for cell in notebook["cells"])
    return re.sub(r"(?:<!-- )?### BEGIN (SOLUTION|HIDDEN TESTS).*?### END \1(?: -->)?", "", text, flags=re.S)


def given_away(text: str, exercises: list[Todo | Written], public: str = "", idiom: int = IDIOM) -> list[str]:
    """What a text holds of the solutions: a sentence for each leak, none where all is well.

    text : a module, or all strings of a notebook, a line each
    exercises : the TODOs and written answers whose solutions are looked for
    public : what the source edition says outside the solutions; a line which stands there is nobody's secret
    idiom : a line with fewer characters than this gives nothing away by itself; 0 for no such mercy

    A line of code leaks if it is long or the whole solution. Short ones are idioms, and leak where two neighbours of
    one solution are neighbours in the text as well. Indentation and blank lines make no difference. Of a model answer
    every line leaks, however short it is, and inside a paragraph or broken into lines as well.
    """
    known, lines = set(_lines(public)), _lines(text)
    there, neighbours = set(lines), set(pairwise(lines))
    flowing, known_flowing = (" ".join(part.split()) for part in (text, public))
    leaks = [f"{mark!r} is left" for mark in (BEGIN, END, HIDDEN) if mark in text]
    for todo in exercises:
        solution = _lines("\n".join(todo.solution))
        if isinstance(todo, Written):
            found = [line for line in solution if line in flowing and line not in known_flowing]
            leaks += [f"{todo.grade_id}: {line}" for line in found]
            continue
        for line in solution:
            if line in there - known and (len(line) >= idiom or len(solution) == 1):
                leaks.append(f"{todo.grade_id}: {line}")
        for pair in pairwise(solution):
            if pair in neighbours and not known.issuperset(pair):
                leaks.append(f"{todo.grade_id}: {' / '.join(pair)}")
    return leaks


def _lines(text: str) -> list[str]:
    return [" ".join(line.split()) for line in text.splitlines() if line.strip()]


def all_strings(value) -> str:
    """Every string inside a notebook's dictionary, whatever it is nested in, a line each; keys count too."""
    if isinstance(value, dict):
        return "\n".join(f"{key}\n{all_strings(part)}" for key, part in value.items())
    if isinstance(value, list):
        return "\n".join(map(all_strings, value))
    return str(value)
