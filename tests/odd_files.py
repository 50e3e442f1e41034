"""Odd submissions, as in odd_class: cells and files that are not as they were, and answers that are not one's own."""

import copy
import inspect
import json

import nbformat
from odd_class import ALL, NONE, as_bytes, begin, due, each

from hdr_helpers import crf
from hdr_helpers.grading.solutions import BEGIN


def cells(student):
    return student.notebooks["03_crf"]["cells"]


def double(student, grade_id, **changes):
    """Put a copy of a cell, with changes, behind it."""
    twin = copy.deepcopy(student.cell(grade_id)) | {"id": f"twin-{grade_id}"} | changes
    cells(student).insert(cells(student).index(student.cell(grade_id)) + 1, twin)


# Cells that are not as they were


@due("right wrong right", "check-3-1 was deleted; it was put", "check-3-2 was edited; it was put back", t32="float")
def deletes_a_check_and_edits_another_and_the_points(student):
    cells(student).remove(student.cell("check-3-1"))
    student.write("todo-3-2", "    return 22.0")
    student.cell("check-3-2")["metadata"]["nbgrader"] |= {"points": 400.0, "grade": False, "locked": False}
    student.cell("check-3-2")["source"] = "22.0"
    student.cell("check-3-4")["metadata"]["nbgrader"]["points"] = 400.0


@due(ALL, *each("{} had lost its marks; they were put back", "todo-3-1", "todo-3-2", "todo-3-4", "answer-3-1"))
def strips_all_marks(student):
    for cell in cells(student):
        cell["metadata"] = {}


@due("wrong right right", *each("{} is there 2 times; the last", "todo-3-1", "todo-3-2", "check-3-4"), t31="is a float")
def copies_cells(student):
    double(student, "todo-3-1", source="def hat():\n    return 22.0")
    double(student, "todo-3-2")
    double(student, "check-3-4")
    student.write("todo-3-2", "    return 22.0")


@due("right empty right", *each("{} is there 2 times; the last one counts", "todo-3-1", "todo-3-2"))
def splits_two_todos_and_moves_a_check(student):
    begin(student, "todo-3-1", "    return mine()\n\ndef mine():")
    for grade_id, at in (("todo-3-1", "def mine():"), ("todo-3-2", f"    {BEGIN}")):
        above, below = student.cell(grade_id)["source"].split(at)
        double(student, grade_id, source=at + below)
        student.cell(grade_id)["source"] = above
    check = student.cell("check-3-4")
    cells(student).remove(check)
    cells(student).insert(1, check)


@due(ALL, "a kernel for r; it was run with Python", "todo-3-1 had become markdown", "todo-3-2 had become raw")
def names_a_kernel_for_r_and_retypes_cells(student):
    student.notebooks["03_crf"]["metadata"] = {"kernelspec": {"name": "ir", "display_name": "R", "language": "R"}}
    for grade_id, kind in (("todo-3-1", "markdown"), ("todo-3-2", "raw")):
        cell = student.cell(grade_id)
        cell |= {"cell_type": kind, "attachments": {}}
        del cell["outputs"], cell["execution_count"]


@due(ALL, "todo-3-1 had lost its marks")
def has_metadata_and_characters_that_nobody_can_read(student):
    student.notebooks["03_crf"]["metadata"] = {"kernelspec": "python", "language_info": "R"}
    student.insert("todo-3-1", "print('\\ud800', chr(0))\nimport os\nos.write(1, b'\\xff')\n'\ud800'")
    student.cell("todo-3-2")["metadata"]["tags"] = 22
    student.cell("todo-3-1")["metadata"] = {"nbgrader": {"grade_id": ["todo-3-1"]}}


# Files that are not as they were


@due(ALL, "'03_crf (1) final.ipynb' was taken for 03_crf")
def is_written_in_nbformat_3_and_renamed(student):
    old = nbformat.convert(nbformat.from_dict(student.notebooks["03_crf"]), 3)
    return {"03_crf (1) final.ipynb": json.dumps(old).encode()}


@due(ALL)
def is_written_in_nbformat_4_0_by_python_3_8(student):
    kernel = {"name": "python3.8", "display_name": "Python 3.8", "language": "python"}
    student.notebooks["03_crf"] |= {"nbformat_minor": 0, "metadata": {"kernelspec": kernel}}
    for cell in cells(student):
        cell["metadata"]["id"] = cell.pop("id")


@due(f"{NONE} right", "no notebook (NotJSONError)", kinds=("unreadable", "graded"), t31="no notebook")
def is_half_a_file_beside_a_whole_one(student):
    return {"03_crf.ipynb": as_bytes(student)[:-500], "04_merge.ipynb": as_bytes(student, "04_merge")}


@due(NONE, "is empty", "a conflict in git", kinds=("unreadable", "unreadable"), t31="empty", t43="conflict in git")
def is_empty_and_has_a_conflict_in_git(student):
    text = as_bytes(student, "04_merge").replace(b'{"cell_type"', b'\n<<<<<<< HEAD\n{"cell_type"', 1)
    return {"03_crf.ipynb": b"", "04_merge.ipynb": text}


@due(NONE, "only 'essay.pdf'", "It was not handed in", kinds=("missing", "missing"), t31="It was not handed in")
def is_an_essay(student):
    return {"essay.pdf": b"%PDF"}


# Answers that are not one's own


@due(ALL, *each("{0} has the structure of {0} in hdr_helpers/crf.py; was it pasted?", "_ties", "_solve_reduced"))
def pastes_the_helpers(student):
    used = "from hdr_helpers import crf\nglobals().update({k: v for k, v in vars(crf).items() if k[:2] != '__'})"
    pasted = [inspect.getsource(function) for function in (crf._chunks, crf._ties, crf._solve_reduced)]
    student.insert("todo-3-1", "\n".join([used, *pasted]).replace("edges", "links"))
    student.write("todo-3-4", "    return _solve_reduced(Z, B, lam, w)[:2]")


@due("wrong right wrong", t31="calls hat_weights, which is an answer that already exists", t34="calls gsolve, which is")
def calls_the_helpers(student):
    student.write("todo-3-1", "    from hdr_helpers import hat_weights\n    return hat_weights()")
    student.write("todo-3-4", "    import hdr_helpers\n    return hdr_helpers.gsolve(Z, B, lam, w)")
