"""A course of one notebook with one TODO, small enough to be released in a second, for the tests of grading."""

import json
from pathlib import Path

PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"

SECRET = "    weight = z * (255 - z) ** 2  # nobody else would write it like that"


def cell(kind, source, **more):
    more = {"execution_count": 7, "outputs": []} | more if kind == "code" else more
    return {"cell_type": kind, "id": more.pop("id"), "metadata": {}, "source": source} | more


def mark(grade_id, **settings):
    fields = {"grade": False, "locked": False, "schema_version": 3, "solution": False, "task": False}
    return {"metadata": {"nbgrader": fields | {"grade_id": grade_id} | settings}}


def tiny_notebook():
    """A notebook with one TODO, a check that draws, and a hidden test."""
    todo = f'def hat(z):\n    """Weight."""\n    ### BEGIN SOLUTION\n{SECRET}\n    return weight\n    ### END SOLUTION'
    picture = {"image/png": "iVBORw0KGgo=\n", "text/plain": "<Figure>"}
    drawn = {"output_type": "display_data", "data": picture, "metadata": {"image/png": {"alt": "A [hat]."}}}
    said = {"output_type": "stream", "name": "stdout", "text": "16581375"}
    hidden = "### BEGIN HIDDEN TESTS\nassert hat(85) == 2456500\n### END HIDDEN TESTS"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {
        "cells": [
            cell("markdown", "### TODO 9.1", id="a"),
            cell("code", todo, id="b", outputs=[said], **mark("todo-9-1", solution=True)),
            cell("code", "print(hat(1))", id="c", outputs=[said]),
            cell("code", "draw(hat(2))", id="d", outputs=[said, drawn]),
            cell("code", hidden, id="e", **mark("check-9-1", grade=True, locked=True, points=1)),
        ],
        "metadata": {"kernelspec": kernel, "widgets": {}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }


def tiny_course(root):
    """Write a course of one notebook, one module and one photograph to the folder root, and return it."""
    for name, text in {
        "notebooks/09_tiny.ipynb": json.dumps(tiny_notebook()),
        "notebooks/results/mine.npy": "mine",
        "hdr_helpers/__init__.py": "",
        "hdr_helpers/grading/release.py": "",
        "hdr_helpers/__pycache__/old.pyc": "",
        "data/chapel/chapel_1.jpg": "light",
        "data/chapel_hdr/picture.png": "a result",
        "environment.txt": "-e .\n",
        "pyproject.toml": PYPROJECT.read_text(encoding="utf-8"),
        "tests/mistakes.py": SECRET,
    }.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(text.encode())
    return root
