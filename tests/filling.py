"""The third edition: the student edition with the solutions and model answers of the source edition filled back in.

python tests/filling.py FOLDER fills in the notebooks of an unpacked student edition, which then pass every check:

    python -m hdr_helpers.grading release -o FOLDER
    python tests/filling.py FOLDER
    python -m pytest --nbval-lax FOLDER/notebooks
"""

import sys
from pathlib import Path

from hdr_helpers.grading.course import source_notebooks
from hdr_helpers.grading.solutions import is_todo, is_written, notebook_bytes, read_notebook, todos, written
from hdr_helpers.merge import write_whole

STUB = ["# YOUR CODE HERE", "raise NotImplementedError()"]
WRITTEN_STUB = ["YOUR ANSWER HERE"]


def filled_in(student: dict, source: dict) -> dict:
    """A student's notebook with every stub replaced by the solution that the source notebook has for it.

    Only the lines of a stub are touched: what else differs between the editions stays, and is tested.
    Raises ValueError where a TODO or an answer in words has no stub, is there twice, or is missing.
    """
    wanted = {todo.grade_id: todo.solution for todo in (*todos(source), *written(source))}
    cells = []
    for cell in student["cells"]:
        if is_todo(cell) or is_written(cell):
            grade_id, stub = cell["metadata"]["nbgrader"]["grade_id"], STUB if is_todo(cell) else WRITTEN_STUB
            if grade_id not in wanted:
                raise ValueError(f"The student's notebook has {grade_id} twice, or the source has it not.")
            cell = cell | {"source": _filled(cell["source"].splitlines(), wanted.pop(grade_id), grade_id, stub)}
        cells.append(cell)
    if wanted:
        raise ValueError(f"The student's notebook has no {', '.join(wanted)}.")
    return student | {"cells": cells}


def _filled(lines: list[str], solution, grade_id: str, stub: list[str]) -> str:
    size = len(stub)
    places = [k for k in range(len(lines)) if [line.strip() for line in lines[k : k + size]] == stub]
    if len(places) != 1:
        raise ValueError(f"{grade_id} has {len(places)} stubs; the student edition has one in each TODO and answer.")
    return "\n".join([*lines[: places[0]], *solution, *lines[places[0] + size :]])


def fill_in(folder) -> list[Path]:
    """Fill in all notebooks of an unpacked student edition, where they are. Returns their paths.

    Raises ValueError, before anything is written, where a notebook is missing or can't be filled in.
    """
    filled = {}
    for source in source_notebooks():
        path = Path(folder) / "notebooks" / source.name
        if not path.is_file():
            raise ValueError(f"{path} is missing; give the folder of a student edition.")
        filled[path] = notebook_bytes(filled_in(read_notebook(path), read_notebook(source)))
    for path, content in filled.items():
        write_whole(path, content)
    return list(filled)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python tests/filling.py FOLDER")
    try:
        print(*fill_in(sys.argv[1]), sep="\n")
    except ValueError as problem:
        sys.exit(str(problem))
