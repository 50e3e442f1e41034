"""The student edition as it comes. That its notebooks run, empty and filled in, is seen where both are graded whole."""

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from hdr_helpers.grading.release import release

pytestmark = pytest.mark.skipif(find_spec("nbgrader") is None, reason="nbgrader is not installed: the instructor extra")


@pytest.fixture(scope="module")
def edition(tmp_path_factory):
    folder, _ = release(tmp_path_factory.mktemp("release") / "course")
    return folder


def test_every_check_of_an_empty_todo_says_so_and_gives_no_points(edition, tmp_path):
    stubs = {path: json.loads(path.read_text(encoding="utf-8")) for path in (edition / "notebooks").glob("*.ipynb")}
    assert len(stubs) == 5
    script = ["from hdr_helpers.lab.checks import check"]
    for notebook in stubs.values():
        for cell in notebook["cells"]:
            grade_id = cell["metadata"].get("nbgrader", {}).get("grade_id", "")
            if grade_id.startswith("check-"):
                number, name = grade_id.removeprefix("check-").replace("-", "."), "".join(cell["source"])
                name = name.split(", ")[1].split(")")[0]
                script.append(f"def {name}(*_, **__): raise NotImplementedError()")
                script.append(f'result = check("{number}", {name}); print(result.points, result.started, result.last)')
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(script)], capture_output=True, text=True, cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(edition), "HDR_CHECKS_MUST_PASS": "0"},
    )  # fmt: skip
    lines = done.stdout.splitlines()
    assert len(lines) == 17, done.stderr
    assert all(line.startswith("0.0 False Not started yet") for line in lines)


def test_the_edition_is_where_it_says(edition):
    assert Path(edition, "hdr_helpers", "lab", "checks", "__init__.py").is_file()
    assert not Path(edition, "hdr_helpers", "grading").exists()
