"""The third edition: the student edition with the solutions of the source edition filled back in.

python tests/filling.py FOLDER fills in the notebooks of an unpacked student edition, which then pass every check:

    python -m hdr_helpers.grading release -o FOLDER
    python tests/filling.py FOLDER
    python -m pytest --nbval-lax FOLDER/notebooks
"""

import sys
from pathlib import Path

from hdr_helpers.grading.course import source_notebooks
from hdr_helpers.grading.solutions import is_todo, notebook_bytes, read_notebook, todos
from hdr_helpers.merge import write_whole

STUB = ["# YOUR CODE HERE", "raise NotImplementedError()"]


def filled_in(student: dict, source: dict) -> dict:
    """A student's notebook with every stub replaced by the solution that the source notebook has for it.

    Only the two lines of a stub are touched: what else differs between the editions stays, and is tested.
    Raises ValueError where a TODO has no stub, is there twice, or is missing.
    """
    wanted = {todo.grade_id: todo.solution for todo in todos(source)}
    cells = []
    for cell in student["cells"]:
        if is_todo(cell):
            grade_id = cell["metadata"]["nbgrader"]["grade_id"]
            if grade_id not in wanted:
                raise ValueError(f"The student's notebook has {grade_id} twice, or the source has it not.")
            cell = cell | {"source": _filled(cell["source"].splitlines(), wanted.pop(grade_id), grade_id)}
        cells.append(cell)
    if wanted:
        raise ValueError(f"The student's notebook has no {', '.join(wanted)}.")
    return student | {"cells": cells}


def _filled(lines: list[str], solution, grade_id: str) -> str:
    places = [k for k in range(len(lines)) if [line.strip() for line in lines[k : k + 2]] == STUB]
    if len(places) != 1:
        raise ValueError(f"{grade_id} has {len(places)} stubs; the student edition has one in each TODO.")
    return "\n".join([*lines[: places[0]], *solution, *lines[places[0] + 2 :]])


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
