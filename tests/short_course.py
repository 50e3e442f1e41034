"""A short form of the course for tests of grading: the marked cells of two notebooks, and what they import."""

import copy
import json
from pathlib import Path

from hdr_helpers.grading.release import WRITTEN_STUB
from hdr_helpers.grading.solutions import BEGIN, END, read_notebook

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
NAMES = ("03_crf", "04_merge")
FIRST = """import numpy as np
from matplotlib.figure import Figure

from hdr_helpers.lab.checks import check, hint
from hdr_helpers.tonemap import luminance
"""
STUB = "    # YOUR CODE HERE\n    raise NotImplementedError()"


def short_course(folder: Path) -> list[Path]:
    """Write the source edition of a short course to folder. Returns the paths of its notebooks."""
    paths = []
    for name in NAMES:
        notebook = read_notebook(NOTEBOOKS / f"{name}.ipynb")
        first = next(cell for cell in notebook["cells"] if cell["cell_type"] == "code")
        marked = [cell for cell in notebook["cells"] if cell["metadata"].get("nbgrader") and cell is not first]
        notebook["cells"] = [first | {"source": FIRST}, *marked]
        for cell in notebook["cells"]:
            if cell["cell_type"] == "code":
                cell["outputs"], cell["execution_count"] = [], None
        notebook["metadata"] = {key: value for key, value in notebook["metadata"].items() if key != "widgets"}
        paths.append(folder / f"{name}.ipynb")
        folder.mkdir(parents=True, exist_ok=True)
        paths[-1].write_text(json.dumps(notebook), encoding="utf-8")
    return paths


class Student:
    """A submission in the making: the solved notebooks, to be spoilt."""

    def __init__(self, sources: list[Path]):
        self.notebooks = {path.stem: read_notebook(path) for path in sources}

    def cell(self, grade_id: str) -> dict:
        """The cell of this mark, such as "todo-3-1"; to be changed in place."""
        cells = (cell for notebook in self.notebooks.values() for cell in notebook["cells"])
        return next(cell for cell in cells if cell["metadata"].get("nbgrader", {}).get("grade_id") == grade_id)

    def write(self, grade_id: str, body: str) -> "Student":
        """Put another body, in four blanks, in the place of a TODO's solution."""
        cell = self.cell(grade_id)
        before, rest = cell["source"].split(f"    {BEGIN}\n")
        cell["source"] = before + body + rest.split(f"    {END}")[1]
        return self

    def empty(self) -> "Student":
        """Every TODO a stub, every answer in words as it was handed out."""
        for notebook in self.notebooks.values():
            for cell in notebook["cells"]:
                if cell["cell_type"] == "markdown":
                    cell["source"] = WRITTEN_STUB
                elif BEGIN in cell["source"]:
                    self.write(cell["metadata"]["nbgrader"]["grade_id"], STUB)
        return self

    def insert(self, grade_id: str, source: str, after: bool = False) -> "Student":
        """A code cell of the student's own before (or after) a marked one."""
        for notebook in self.notebooks.values():
            for k, cell in enumerate(notebook["cells"]):
                if cell["metadata"].get("nbgrader", {}).get("grade_id") == grade_id:
                    own = {
                        "cell_type": "code",
                        "id": f"own-{k}",
                        "metadata": {},
                        "outputs": [],
                        "execution_count": None,
                    }
                    notebook["cells"].insert(k + after, own | {"source": source})
                    return self
        raise KeyError(grade_id)

    def hand_in(self, folder: Path) -> Path:
        """Write the notebooks to a folder."""
        folder.mkdir(parents=True)
        for name, notebook in self.notebooks.items():
            (folder / f"{name}.ipynb").write_text(json.dumps(copy.deepcopy(notebook)), encoding="utf-8")
        return folder


def shorter_course(folder: Path) -> list[Path]:
    """As short_course, with TODOs 3.1, 3.2 and 3.4 and one answer in words in 03_crf, and TODO 4.3 in 04_merge."""
    kept = {f"{kind}-{number}" for kind in ("todo", "check") for number in ("3-1", "3-2", "3-4", "4-3")}
    kept |= {"setup-3", "setup-4", "answer-3-1"}
    paths = short_course(folder)
    for path in paths:
        notebook = read_notebook(path)
        notebook["cells"] = [cell for cell in notebook["cells"] if cell["metadata"]["nbgrader"]["grade_id"] in kept]
        path.write_text(json.dumps(notebook), encoding="utf-8")
    return paths
