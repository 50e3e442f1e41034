"""The course as nbgrader sees it: an assignment a notebook, staged from the flat notebooks/ into build/.

One assignment with five notebooks would lose all five where one file is corrupt or ends its kernel; one assignment
a notebook loses only that one. nbgrader is imported late: students, and the tests of CI, do without it.
"""

import os
import sys
from pathlib import Path

from hdr_helpers.grading.solutions import is_todo, notebook_bytes, read_notebook, todos
from hdr_helpers.merge import write_whole

ROOT = Path(__file__).parents[2]
BUILD = "build"
SEED = 1997  # of the data that submissions are graded with; that of the notebooks' own checks is 0
IMAGES = {"image/jpeg": "expected.jpg", "image/png": "expected.png"}


class InstructorError(Exception):
    """What keeps an instructor's command from being done, in a sentence."""


def source_notebooks(root=ROOT) -> list[Path]:
    """The notebooks of the source edition, by name. Raises InstructorError where there are none."""
    notebooks = sorted((Path(root) / "notebooks").glob("*.ipynb"))
    if not notebooks:
        raise InstructorError(f"There are no notebooks in {Path(root) / 'notebooks'}; run this in the course folder.")
    return notebooks


def stage(notebooks, place=ROOT / BUILD) -> list[str]:
    """Write each notebook to source/NAME/NAME.ipynb in place, where nbgrader looks for assignments.

    Returns the names of the assignments. Raises ValueError where a file is not a notebook or a TODO is not marked.
    """
    for path in notebooks:
        folder = Path(place) / "source" / path.stem
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / path.name, notebook_bytes(with_expected_pictures(read_notebook(path))))
    return [path.stem for path in notebooks]


def with_expected_pictures(notebook: dict) -> dict:
    """The same notebook with a TODO's expected picture folded away before it, and no stored state of widgets.

    nbgrader clears all outputs, and rightly: a student predicts before looking. But a picture to compare one's own
    with is a help, so it goes into a text cell, which stays. It is the first picture that a cell after the TODO, up
    to the next TODO or section, draws with the TODO's function. The code that makes it stays behind.
    """
    exercises = {todo.grade_id: todo for todo in todos(notebook)}
    cells = []
    for k, cell in enumerate(notebook["cells"]):
        if is_todo(cell):
            todo = exercises[cell["metadata"]["nbgrader"]["grade_id"]]
            cells += _expected_picture(todo, notebook["cells"][k + 1 :])
        cells.append(cell)
    metadata = {key: value for key, value in notebook["metadata"].items() if key != "widgets"}
    return notebook | {"cells": cells, "metadata": metadata}


def _expected_picture(todo, following: list[dict]) -> list[dict]:
    for cell in following:
        if is_todo(cell) or (cell["cell_type"] == "markdown" and "## " in cell["source"]):
            break
        if cell["cell_type"] != "code" or f"{todo.function}(" not in cell["source"]:
            continue
        for output in cell["outputs"]:
            for kind in (kind for kind in IMAGES if kind in output.get("data", {})):
                content = "".join(output["data"][kind]).replace("\n", "")
                alt = output["metadata"].get(kind, {}).get("alt", "The picture to expect.")
                return [_picture_cell(todo.grade_id, kind, content, alt.translate({91: "(", 93: ")"}))]
    return []


def _picture_cell(grade_id: str, kind: str, content: str, alt: str) -> dict:
    name = IMAGES[kind]
    return {
        "cell_type": "markdown",
        "id": f"{grade_id}-expected",
        "metadata": {},
        "attachments": {name: {kind: content}},
        "source": f"<details><summary>The picture to expect</summary>\n\n![{alt}](attachment:{name})\n\n</details>",
    }


def require_nbgrader() -> None:
    """Raise InstructorError where nbgrader is not installed."""
    try:
        import nbgrader.apps  # noqa: F401
    except ImportError as problem:
        raise InstructorError(
            f'This needs nbgrader ({problem}); install the extra "instructor" in the course folder: '
            'python -m pip install -e ".[instructor]"'
        ) from None


def nbgrader_api(place=ROOT / BUILD):
    """nbgrader's programming interface for the course that is staged in place.

    Raises InstructorError where nbgrader is not installed.
    """
    require_nbgrader()
    from nbgrader.apps import NbGraderAPI
    from traitlets.config import Config

    # nbgrader calls alembic by its bare name, and an environment need not be activated to be used.
    scripts = str(Path(sys.executable).parent)
    if scripts not in os.environ.get("PATH", "").split(os.pathsep):
        os.environ["PATH"] = os.pathsep.join([scripts, os.environ.get("PATH", "")])
    Path(place).mkdir(parents=True, exist_ok=True)
    config = Config()
    config.CourseDirectory.root = str(place)  # each step has its folder in there, and the gradebook is gradebook.db
    return NbGraderAPI(config=config)


def generate(notebooks, place=ROOT / BUILD):
    """Stage notebooks in place and make their student versions, release/NAME/NAME.ipynb, by nbgrader.

    The gradebook, gradebook.db, then knows the points and the hidden tests of every check.
    Returns nbgrader's interface. Raises InstructorError where nbgrader is missing or refuses a notebook.
    """
    api = nbgrader_api(place)
    for name in stage(notebooks, place):
        result = api.generate_assignment(name)
        if not result["success"]:
            said = [line for line in (result.get("log") or result.get("error") or "").splitlines() if line.strip()]
            raise InstructorError(f"nbgrader could not make the student version of {name}:\n" + "\n".join(said[-12:]))
    return api
