"""The student edition as it comes, and with the solutions filled back in: all notebooks of both, executed by nbval."""

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from filling import fill_in

from hdr_helpers.grading.release import release

pytestmark = pytest.mark.skipif(find_spec("nbgrader") is None, reason="nbgrader is not installed: the instructor extra")


@pytest.fixture(scope="module")
def edition(tmp_path_factory):
    folder, _ = release(tmp_path_factory.mktemp("release") / "course")
    return folder


def run_notebooks(folder, must_pass):
    """nbval's output for all notebooks of an edition, run with the edition's own helpers."""
    environment = os.environ | {
        "HDR_CHECKS_MUST_PASS": str(int(must_pass)),
        "HDR_RESULTS": str(folder / "results"),
        "PYTHONPATH": str(folder),
    }
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-c",
        os.devnull,
        "--rootdir",
        str(folder),
    ]
    nbval = ["--nbval-lax", "--nbval-current-env", "--nbval-cell-timeout=180", str(folder / "notebooks")]
    return subprocess.run(command + nbval, env=environment, cwd=folder, capture_output=True, text=True)


def test_with_every_todo_empty_all_notebooks_run_to_their_end_and_with_the_solutions_every_check_passes(edition):
    empty = run_notebooks(edition, must_pass=False)
    assert empty.returncode == 0, empty.stdout[-3000:]
    # Nothing that the course made is kept as the student's.
    assert not list((edition / "results").glob("*.npy"))
    fill_in(edition)
    filled = run_notebooks(edition, must_pass=True)
    assert filled.returncode == 0, filled.stdout[-3000:]
    assert {path.name for path in (edition / "results").glob("*.npy")} == {"crf.npy", "radiance.npy"}


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
