"""Binder makes the environment of environment.txt, with a Python that the course and its CI know.

repo2docker, which builds Binder's images, takes the folder .binder, runs pip in the folder of the repository, and
doesn't look for environment.txt.
"""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[1]
BINDER = ROOT / ".binder"
# Any of these would be taken in the place of requirements.txt, or beside it would change what is installed.
RIVALS = [
    "Dockerfile",
    "environment.yml",
    "environment.yaml",
    "Pipfile",
    "Pipfile.lock",
    "default.nix",
    "install.R",
    "Project.toml",
]


def requirements(path: Path) -> list[tuple[Path, str]]:
    """Each requirement with the file it stands in. As for pip, the path after -r starts at the file that has it."""
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        line = re.sub(r"(^|\s)#.*", "", line).strip()
        if line.startswith("-r"):
            found += requirements(path.parent / line.removeprefix("-r").strip())
        elif line:
            found.append((path.resolve(), line))
    return found


@pytest.fixture
def binder_python():
    """The version in runtime.txt. repo2docker has an environment for each x.y and refuses x.y.z."""
    text = (BINDER / "runtime.txt").read_text(encoding="utf-8")
    stated = re.fullmatch(r"python-(3\.\d+)\n?", text)
    assert stated, f"runtime.txt holds {text!r}; repo2docker reads python-3.11"
    return stated[1]


def test_every_requirement_of_binder_is_one_of_environment_txt_and_none_is_left_out():
    environment = (ROOT / "environment.txt").resolve()
    found = requirements(BINDER / "requirements.txt")
    assert {path for path, _ in found} == {environment}
    assert found == requirements(environment)


def test_the_course_is_installed_as_the_folder_in_which_pip_runs_so_that_its_data_is_found():
    # Unlike the path after -r, that after -e starts where pip runs; and only -e leaves the package beside data/.
    installed = [line for _, line in requirements(BINDER / "requirements.txt") if "==" not in line]
    assert installed == ["-e ."]
    assert (ROOT / "pyproject.toml").is_file() and (ROOT / "data" / "chapel").is_dir()


def test_the_python_of_binder_satisfies_the_course(binder_python):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert binder_python in SpecifierSet(project["requires-python"])


def test_the_python_of_binder_is_one_that_ci_tests(binder_python):
    workflow = (ROOT / ".github" / "workflows" / "test.yml").read_text(encoding="utf-8")
    tested = re.search(r"^\s*python: \[(.*)\]", workflow, re.M)
    assert binder_python in re.findall(r'"([\d.]+)"', tested[1])


def test_repo2docker_finds_nothing_that_it_would_rather_take():
    assert not (ROOT / "binder").exists()  # it refuses a repository with both folders
    assert [name for name in RIVALS if (BINDER / name).exists()] == []
