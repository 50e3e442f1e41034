"""Is a function in a submission one of the course's own, pasted? Names, comments and texts make no difference."""

import ast
import functools
from difflib import SequenceMatcher

from hdr_helpers.grading.course import ROOT, source_notebooks
from hdr_helpers.grading.solutions import is_todo, read_notebook

ALIKE = 0.9  # share of a function's structure
SHORTEST = 40  # nodes; below, two functions may be alike by chance


def copied_from_the_course(notebook) -> list[str]:
    """A sentence for each function in a notebook that has the structure of one in hdr_helpers.

    notebook : an nbformat notebook, version 4
    Every cell is looked at, for a TODO may call what was pasted elsewhere.
    For an instructor to look at; it costs no points by itself.
    """
    flags = []
    for cell in (cell for cell in notebook.cells if cell.cell_type == "code"):
        for name, structure in _functions(cell.source):
            place = next((place for place, other in _of_the_course() if _alike(structure, other)), None)
            if place:
                flags.append(f"{name} has the structure of {place}; was it pasted?")
    return flags


def _alike(structure, other) -> bool:
    shortest, longest = sorted((len(structure), len(other)))
    return shortest >= ALIKE * longest and SequenceMatcher(None, structure, other, False).ratio() >= ALIKE


@functools.cache
def _of_the_course() -> tuple:
    """Place and structure of every function of hdr_helpers, except for those that a notebook hands out itself."""
    cells = [cell for path in source_notebooks() for cell in read_notebook(path)["cells"] if not is_todo(cell)]
    sources = [cell["source"] for cell in cells if cell["cell_type"] == "code"]
    handed_out = [structure for source in sources for _, structure in _functions(source)]
    found = []
    for path in sorted((ROOT / "hdr_helpers").rglob("*.py")):
        if "grading" in path.parts or path.parent.name in ("checks", "figures"):
            continue
        for name, structure in _functions(path.read_text(encoding="utf-8")):
            if not any(_alike(structure, given) for given in handed_out):
                found.append((f"{name} in {path.relative_to(ROOT).as_posix()}", structure))
    return tuple(found)


def _functions(source: str) -> list[tuple[str, tuple]]:
    """Name and structure of every function that is long enough."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            body = node.body[1:] if ast.get_docstring(node) else node.body
            structure = tuple(_kind(part) for statement in body for part in ast.walk(statement))
            if len(structure) >= SHORTEST:
                found.append((node.name, structure))
    return found


def _kind(node) -> str:
    """What a node is; of attributes and numbers also which, since a structure alone says little."""
    if isinstance(node, ast.Attribute):
        return f".{node.attr}"
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
        return repr(node.value)
    return type(node).__name__
