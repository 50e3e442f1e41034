"""The container to grade in holds what grading needs, and nothing that is not there."""

import re
import tomllib
from pathlib import Path

from packaging.specifiers import SpecifierSet

from hdr_helpers.grading import course
from hdr_helpers.lab.data import DATA

ROOT = Path(__file__).parents[1]
LINES = (ROOT / ".container" / "Dockerfile").read_text(encoding="utf-8").splitlines()


def arguments(instruction):
    return [line.split()[1:] for line in LINES if line.startswith(f"{instruction} ")]


def test_every_part_of_the_course_that_grading_reads_is_copied_to_where_it_looks_for_it():
    copied = {}
    for *sources, target in arguments("COPY"):
        copied |= {source: target for source in sources}
    assert all((ROOT / source).exists() for source in copied)
    folders = {"hdr_helpers", course.source_notebooks()[0].parent.name, DATA.name}
    assert {source: target for source, target in copied.items() if target != "./"} == {name: name for name in folders}
    assert {"pyproject.toml", "environment.txt"} <= copied.keys()


def test_its_python_satisfies_the_course_and_what_is_installed_is_pinned_with_the_instructors_extra():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    ((image,),) = arguments("FROM")
    assert re.search(r"python:([\d.]+)", image)[1] in SpecifierSet(project["requires-python"])
    (pip,) = (words for words in arguments("RUN") if "pip" in words)
    assert pip[pip.index("-r") + 1] == "environment.txt"
    assert re.fullmatch(r'"\.\[(\w+)\]"', pip[pip.index("-e") + 1])[1] in project["optional-dependencies"]


def test_it_brings_the_sandbox_and_its_command_is_the_one_that_the_readme_gives():
    assert any("bubblewrap" in words for words in arguments("RUN"))
    assert 'ENTRYPOINT ["python", "-m", "hdr_helpers.grading"]' in LINES
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "-f .container/Dockerfile" in readme
    # Without these two a container lets nobody make namespaces, and no /proc in them.
    assert re.search(r"docker run .*seccomp=unconfined .*systempaths=unconfined .*hdr-grading grade ", readme)
