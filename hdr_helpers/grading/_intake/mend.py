"""A submitted notebook as nbgrader needs it: every marked cell there once, in its place, with its marks.

Students copy, split, move and delete cells, strip metadata and edit checks. nbgrader then gives 0 in silence, or stops
for the whole class. So what can be told is put right first, and what was found is said.
"""

import json
import re
from collections import Counter
from itertools import pairwise

import nbformat

LARGEST = 100 * 2**20  # bytes of a notebook
UNUSED = ("outputs", "attachments", "before", "after")  # of a marked cell, where it is put back
MINOR = 5  # of nbformat 4: from here on every cell has an id


class Unreadable(ValueError):
    """The file is no notebook; the text says why, in a sentence."""


def marked_cells(released: dict) -> list[dict]:
    """The cells of a notebook that nbgrader has marked, as mend wants them: each knows its neighbours' texts."""
    nobody, cells = {"source": ""}, released["cells"]
    return [
        cell | {"before": before["source"], "after": after["source"]}
        for before, cell, after in zip([nobody, *cells], cells, [*cells[1:], nobody], strict=False)
        if cell["metadata"].get("nbgrader", {}).get("grade_id")
    ]


def mend(data: bytes, marked: list[dict]) -> tuple[nbformat.NotebookNode, list[str]]:
    """Read a submitted notebook and put its marked cells right.

    data : the bytes of the file; marked : marked_cells of the notebook as it was handed out
    Returns the notebook, without outputs, and sentences about what was found. Raises Unreadable.
    """
    notebook, flags = _read(data)
    kept, found = [], {}
    for cell in notebook.cells:
        name = _marked_as(cell, marked)
        if name:
            found.setdefault(name, []).append(cell)
        if not (name and _is_fixed(_form(name, marked))):
            kept.append(cell)
    for form in marked:
        name = form["metadata"]["nbgrader"]["grade_id"]
        _settle(form, found.get(name) or _by_question(form, notebook.cells, marked), kept, flags)
    _order(kept, marked)
    notebook.cells = kept
    return notebook, flags


def _read(data):
    if not data.strip():
        raise Unreadable("The file is empty.")
    if len(data) > LARGEST:
        raise Unreadable(f"The file has more than {LARGEST // 2**20} MB.")
    try:
        notebook = nbformat.reads(data.decode("utf-8-sig"), as_version=4)
        for cell in notebook.cells:
            cell.source = "".join(cell.source)
            if not re.fullmatch(r"[\w-]{1,64}", str(cell.get("id")), re.ASCII):
                cell.pop("id", None)  # it is given another one
            if cell.cell_type == "code":
                cell.outputs, cell.execution_count = [], None
        # JSON can hold half a character, "\\ud800", which could not be written to a file again.
        notebook = json.loads(json.dumps(notebook, ensure_ascii=False).encode("utf-8", "replace"))
        notebook["nbformat_minor"] = max(notebook["nbformat_minor"], MINOR)
        notebook = nbformat.from_dict(nbformat.validator.normalize(notebook, strip_invalid_metadata=True)[1])
    except UnicodeDecodeError:
        raise Unreadable("The file is no text in UTF-8, as a notebook is.") from None
    except Exception as problem:  # nbformat raises whatever a broken structure leads to
        git = " It holds the marks of a conflict in git." if b"<<<<<<< " in data else ""
        raise Unreadable(f"The file is no notebook ({type(problem).__name__}).{git}") from None
    return notebook, _about_kernel(notebook)


def _about_kernel(notebook) -> list[str]:
    language = notebook.metadata.get("language_info", {})
    kernel = notebook.metadata.get("kernelspec", {})
    spoken = str(kernel.get("language") or language.get("name") or "python").lower()
    if "python" not in spoken:
        return [f"It was made with a kernel for {spoken}; it was run with Python."]
    return []


def _form(name, marked):
    return next(form for form in marked if form["metadata"]["nbgrader"]["grade_id"] == name)


def _is_fixed(form) -> bool:
    """Is this a cell that a student is not to change, so that it is put back as it was?"""
    return not form["metadata"]["nbgrader"].get("solution")


def _mark(cell) -> str:
    """The grade_id in a cell's mark, empty where there is none or no proper one."""
    facts = cell.metadata.get("nbgrader")
    name = facts.get("grade_id") if isinstance(facts, dict) else None
    return name if isinstance(name, str) else ""


def _marked_as(cell, marked) -> str | None:
    """Which marked cell this is: by its mark, by its id, or by the function that it defines or checks."""
    names = {form["metadata"]["nbgrader"]["grade_id"]: form for form in marked}
    own = _mark(cell)
    for name in (own, cell.get("id")):
        if name in names:
            return name
    for name, form in names.items():
        if cell.get("id") == form.get("id"):
            return name
        if _is_fixed(form) and cell.source.strip() == form["source"].strip():
            return name
    if not own and cell.cell_type == "code":
        for name, form in names.items():
            begin = _beginning(form)
            if begin and re.search(rf"^{re.escape(begin)}", cell.source, re.M):
                return name
    return None


def _by_question(form, cells, marked) -> list:
    """The text that stands behind a question, where nothing else tells that it is the answer."""
    asked, handed_out = form["before"].strip(), form["after"].strip()
    for before, cell in pairwise(cells):
        if form["cell_type"] == "markdown" and asked and before.source.strip() == asked:
            others = cell.cell_type != "markdown" or cell.source.strip() == handed_out or _marked_as(cell, marked)
            return [] if others else [cell]
    return []


def _beginning(form) -> str:
    """What a line of this cell begins with, and of no other cell: a TODO's def NAME(, or result = check("3.1"."""
    found = re.search(r'^(def \w+\(|result = check\("[\d.]+")', form["source"], re.M)
    return found[1] if found else ""


def _settle(form, cells, kept, flags):
    """Put one marked cell right in the list of cells that are kept."""
    name = form["metadata"]["nbgrader"]["grade_id"]
    for cell in cells[:-1]:
        cell.metadata.pop("nbgrader", None)
    if len(cells) > 1:
        flags.append(f"The cell {name} is there {len(cells)} times; the last one counts.")
    if _is_fixed(form):
        if not cells:
            flags.append(f"The cell {name} was deleted; it was put back.")
        elif cells[-1].source.strip() != form["source"].strip():
            flags.append(f"The cell {name} was edited; it was put back as it was handed out.")
        kept.append(_as_handed_out(form))
    elif cells:
        cell = cells[-1]
        if _mark(cell) != name:
            flags.append(f"The cell {name} had lost its marks; they were put back.")
        if cell.cell_type != form["cell_type"]:
            flags.append(f"The cell {name} had become {cell.cell_type}; it was taken as {form['cell_type']}.")
            _change_type(cell, form["cell_type"])
        cell.metadata["nbgrader"] = nbformat.from_dict(dict(form["metadata"]["nbgrader"]))
    elif form["cell_type"] == "markdown":
        flags.append(f"The cell {name} was deleted; an empty one was put in its place.")
        kept.append(_as_handed_out(form))
    else:
        flags.append(f"The cell {name} was deleted.")


def _change_type(cell, kind):
    cell.cell_type = kind
    if kind == "code":
        cell.outputs, cell.execution_count = [], None
        cell.pop("attachments", None)
    else:
        cell.pop("outputs", None)
        cell.pop("execution_count", None)


def _as_handed_out(form):
    cell = nbformat.from_dict({key: value for key, value in form.items() if key not in UNUSED})
    cell.source = "".join(cell.source)
    if cell.cell_type == "code":
        cell.outputs, cell.execution_count = [], None
    return cell


def _order(kept, marked):
    """Each cell that was put back behind its predecessor; marks left on no other cell; every id there once."""
    names = [form["metadata"]["nbgrader"]["grade_id"] for form in marked]
    for k, name in enumerate(names):
        here = _places(kept).get(name)
        if here is None or not _is_fixed(marked[k]):
            continue
        cell = kept.pop(here)
        places = _places(kept)
        before = [places[other] for other in names[:k] if other in places]
        kept.insert(max(before) + 1 if before else 0, cell)
    ids = Counter()
    for cell in kept:
        if _mark(cell) not in names:
            cell.metadata.pop("nbgrader", None)
        ids[cell.get("id")] += 1
        if ids[cell.get("id")] > 1:
            cell["id"] = f"{str(cell.get('id'))[:50]}-{ids[cell.get('id')]}"


def _places(cells) -> dict:
    """Where each marked cell is: the last one, as only that still has its mark."""
    return {_mark(cell): k for k, cell in enumerate(cells) if _mark(cell)}
