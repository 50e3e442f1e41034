"""Whatever students do to their cells, what nbgrader needs is put back, and nothing that they wrote is lost."""

import copy
import json
import random
import re
from itertools import pairwise

import nbformat
import pytest
from short_course import NOTEBOOKS, Student, short_course

from hdr_helpers.grading._intake.mend import Unreadable, marked_cells, mend
from hdr_helpers.grading.solutions import read_notebook

pytestmark = [
    pytest.mark.filterwarnings("ignore:Cell is missing an id field"),
    pytest.mark.filterwarnings("ignore:Non-unique cell id"),
]
TODO, CHECK = "todo-3-2", "check-3-2"


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    return short_course(tmp_path_factory.mktemp("course"))


@pytest.fixture(scope="module")
def marked(sources):
    """The marked cells of 03_crf as it is handed out."""
    return marked_cells(Student(sources).empty().notebooks["03_crf"])


@pytest.fixture
def cells(sources):
    """The cells of 03_crf, solved, an own one before each; every text is there once."""
    found = []
    for k, cell in enumerate(Student(sources).notebooks["03_crf"]["cells"]):
        kind = ("markdown", "code")[k % 2]
        more = {"outputs": [], "execution_count": None} if kind == "code" else {}
        found += [{"cell_type": kind, "id": f"own-{k}", "metadata": {}, "source": f"own = {k}", **more}, cell]
    return found


def as_bytes(cells):
    return json.dumps({"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}).encode()


def mark(cell) -> str:
    facts = cell["metadata"].get("nbgrader")
    return facts.get("grade_id", "") if isinstance(facts, dict) else ""


def named(cells, grade_id):
    return next(cell for cell in cells if mark(cell) == grade_id)


def retype(cell, kind):
    cell["cell_type"] = kind
    cell.pop("outputs", None)
    cell.pop("execution_count", None)
    if kind == "code":
        cell |= {"outputs": [], "execution_count": None}


def is_fixed(grade_id) -> bool:
    return grade_id.startswith(("setup", "check"))


def everything(notebook):
    return [(cell.cell_type, cell.source, cell.metadata.get("nbgrader")) for cell in notebook.cells]


# Whatever is done, in any order


def copied(cells, cell, rng):
    twin = copy.deepcopy(cell) | {"id": rng.choice([cell["id"], f"twin-{rng.random()}"[:20]])}
    if not is_fixed(cell["origin"]):
        twin["source"] += f"\n# {rng.random()}"
    cells.insert(rng.randrange(len(cells) + 1), twin)


def deleted(cells, cell, rng):
    cells.remove(cell)


def moved(cells, cell, rng):
    cells.remove(cell)
    cells.insert(rng.randrange(len(cells) + 1), cell)


def retyped(cells, cell, rng):
    retype(cell, rng.choice(["code", "markdown", "raw"]))


def stripped(cells, cell, rng):
    cell["metadata"] = rng.choice([{}, {"nbgrader": {}}, {"nbgrader": None}, {"nbgrader": {"grade_id": ["x"]}}])


def other_points(cells, cell, rng):
    if isinstance(cell["metadata"].get("nbgrader"), dict):
        cell["metadata"]["nbgrader"] |= {"points": 400, "solution": True, "grade": rng.random() < 0.5, "locked": False}


def edited(cells, cell, rng):
    cell["source"] += f"\n# {rng.random()}"


def other_id(cells, cell, rng):
    if mark(cell):  # without mark and id nobody can tell
        cell["id"] = f"new-{rng.random()}"[:20]


EDITS = (copied, deleted, moved, retyped, stripped, other_points, edited, other_id)


def spoilt(cells, seed):
    """The cells after 1 to 30 edits. Each cell says in "origin" what it was."""
    rng = random.Random(seed)
    cells = [copy.deepcopy(cell) | {"origin": mark(cell)} for cell in cells]
    for _ in range(rng.randint(1, 30)):
        candidates = [cell for cell in cells if cell["origin"]]
        if candidates:
            rng.choice(EDITS)(cells, rng.choice(candidates), rng)
    return cells


@pytest.mark.parametrize("seed", range(150))
def test_after_any_edits_every_marked_cell_stands_once_in_its_place_and_no_text_of_a_student_is_lost(
    cells, marked, seed, tmp_path
):
    submitted = spoilt(cells, seed)
    notebook, flags = mend(as_bytes([{k: v for k, v in c.items() if k != "origin"} for c in submitted]), marked)
    nbformat.validate(notebook)
    assert len({cell.id for cell in notebook.cells}) == len(notebook.cells)
    names, found = [mark(form) for form in marked], [mark(cell) for cell in notebook.cells]
    gone = {name for name in names if f"The cell {name} was deleted." in flags}
    assert gone <= {name for name in names if name.startswith("todo")}
    assert sorted(name for name in found if name) == sorted(set(names) - gone)
    for form in marked:
        if mark(form) in gone:
            assert not any(cell["id"] == form["id"] or mark(cell) == mark(form) for cell in submitted)
            continue
        cell = named(notebook.cells, mark(form))
        assert cell.metadata.nbgrader == form["metadata"]["nbgrader"] and cell.cell_type == form["cell_type"]
        assert cell.source == form["source"] or not is_fixed(mark(form))

    # A fixed cell stands right behind one that was handed out before it, and behind all of them.
    for k, name in enumerate(names):
        if is_fixed(name) and k:
            before = [found.index(other) for other in names[:k] if other in found]
            assert found.index(name) == max(before) + 1

    written = [cell["source"] for cell in submitted if not is_fixed(cell["origin"])]
    assert [cell.source for cell in notebook.cells if cell.source in set(written)] == written
    nbformat.write(notebook, tmp_path / "mended.ipynb")
    again, more = mend((tmp_path / "mended.ipynb").read_bytes(), marked)
    assert everything(again) == everything(notebook)
    known, new = ({re.sub(r"\d+ times", "again", flag) for flag in some} for some in (flags, more))
    assert new <= known


def test_checks_stand_right_behind_their_todo_where_todos_keep_their_order(cells, marked):
    for seed in range(20):
        shuffled = [cell for cell in cells if not is_fixed(mark(cell))]
        for check in (cell for cell in cells if is_fixed(mark(cell))):
            shuffled.insert(random.Random(seed).randrange(len(shuffled) + 1), check)
        found = [mark(cell) for cell in mend(as_bytes(shuffled), marked)[0].cells]
        for todo, check in pairwise(found):
            assert check == todo.replace("todo", "check") or not todo.startswith("todo")


# One thing at a time

LOST = "had lost its marks; they were put back."
EMPTY = "was deleted; an empty one was put in its place."
ALONE = {
    "nothing": (lambda cells: None, []),
    "a check deleted": (
        lambda cells: cells.remove(named(cells, CHECK)),
        [f"{CHECK} was deleted; it was put back."],
    ),
    "a check edited": (
        lambda cells: named(cells, CHECK).update(source="22.0"),
        [f"{CHECK} was edited; it was put back as it was handed out."],
    ),
    "a check twice": (
        lambda cells: cells.append(copy.deepcopy(named(cells, CHECK)) | {"id": "twin"}),
        [f"{CHECK} is there 2 times; the last one counts."],
    ),
    "a check moved": (lambda cells: cells.insert(0, cells.pop(cells.index(named(cells, CHECK)))), []),
    "other points": (lambda cells: named(cells, CHECK)["metadata"]["nbgrader"].update(points=400), []),
    "a TODO without marks": (lambda cells: named(cells, TODO).update(metadata={}), [f"{TODO} {LOST}"]),
    "a TODO deleted": (lambda cells: cells.remove(named(cells, TODO)), [f"{TODO} was deleted."]),
    "a TODO in markdown": (
        lambda cells: retype(named(cells, TODO), "markdown"),
        [f"{TODO} had become markdown; it was taken as code."],
    ),
    "half a character": (lambda cells: named(cells, TODO).update(source="def sample_values(): '\ud800'"), []),
    "an answer deleted": (lambda cells: cells.remove(named(cells, "answer-3-1")), [f"answer-3-1 {EMPTY}"]),
    "no mark and no id": (
        lambda cells: [cell.update(metadata={}, id=f"new-{k}") for k, cell in enumerate(cells)],
        [f"todo-3-{k} {LOST}" for k in range(1, 7)] + [f"answer-3-{k} {EMPTY}" for k in (1, 2)],
    ),
}


@pytest.mark.parametrize("edit, expected", ALONE.values(), ids=ALONE)
def test_what_was_found_is_said_and_nothing_else(cells, marked, edit, expected):
    edit(cells)
    notebook, flags = mend(as_bytes(cells), marked)
    assert flags == [f"The cell {words}" for words in expected]
    assert json.dumps(notebook, ensure_ascii=False).encode("utf-8")


@pytest.mark.parametrize("name", ["01_load", "02_align", "03_crf", "04_merge", "05_tonemap"])
@pytest.mark.parametrize("answered", [True, False])
def test_an_answer_in_words_that_lost_mark_and_id_is_found_behind_its_question_and_nothing_else_is_taken_for_it(
    name, answered
):
    cells = read_notebook(NOTEBOOKS / f"{name}.ipynb")["cells"]
    answers = [mark(cell) for cell in cells if mark(cell).startswith("answer")]
    marked = marked_cells({"cells": copy.deepcopy(cells)})
    kept = [cell for cell in cells if answered or mark(cell) not in answers]
    for k, cell in enumerate(kept):
        cell |= {"metadata": {}, "id": f"new-{k}"}
    notebook, flags = mend(as_bytes(kept), marked)
    said = LOST if answered else EMPTY
    assert [flag for flag in flags if "answer" in flag] == [f"The cell {grade_id} {said}" for grade_id in answers]
    if answered:
        mended, before = (
            [cell["source"] for cell in some if cell["cell_type"] == "markdown"] for some in (notebook.cells, cells)
        )
        assert mended == before


GOOD = {"cells": [], "metadata": {}, "nbformat": 4, "nbformat_minor": 5}


@pytest.mark.parametrize(
    "data, said",
    [
        (b"", "The file is empty."),
        (b" \n", "The file is empty."),
        (b"\xff\xfe{", "no text in UTF-8"),
        (b"[]", "no notebook"),
        (b"[" * 100_000, "no notebook"),
        (b"<html>Log in</html>", "no notebook"),
        (json.dumps(GOOD).encode()[:-9], "no notebook"),
        (b"<<<<<<< HEAD\n" + json.dumps(GOOD).encode(), "a conflict in git"),
        (json.dumps(GOOD | {"nbformat": 9}).encode(), "no notebook"),
        (json.dumps(GOOD | {"cells": None}).encode(), "no notebook"),
        (json.dumps(GOOD | {"cells": [{"cell_type": "code", "metadata": {}, "source": 22}]}).encode(), "no notebook"),
    ],
    ids=range(11),
)
def test_a_file_that_is_no_notebook_is_refused_in_a_sentence(marked, data, said):
    with pytest.raises(Unreadable, match=said):
        mend(data, marked)
