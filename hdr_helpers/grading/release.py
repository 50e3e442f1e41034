"""The student edition: a folder and a zip, made from the source edition by nbgrader's own tools."""

import json
import os
import shutil
import tempfile
import tomllib
import zipfile
from pathlib import Path

from hdr_helpers.grading.course import BUILD, ROOT, InstructorError, generate, source_notebooks
from hdr_helpers.grading.solutions import (
    all_strings,
    given_away,
    is_todo,
    is_written,
    notebook_bytes,
    read_notebook,
    todos,
    without_solutions,
    written,
)

TOP = "hdr_course"  # the one folder in the zip, whatever the folder beside it is called
README = Path(__file__).with_name("STUDENT.md")
STUB = "raise NotImplementedError()"
WRITTEN_STUB = "YOUR ANSWER HERE"
EPOCH = (1980, 1, 1, 0, 0, 0)  # the first moment that a zip can hold
TABLES = ("build-system", "project", "tool.setuptools.packages.find")  # of pyproject.toml; the others are for CI
NOT_HANDED_OUT = {"__pycache__", "grading", ".ipynb_checkpoints"}


def release(out, overwrite=False, root=ROOT) -> tuple[Path, Path]:
    """Make the student edition of the course in root.

    out : folder to make; the zip is written beside it, with the same name and .zip
    overwrite : replace an earlier student edition there
    Returns the folder and the zip. Everything is made and searched for solutions beside its place, then moved, so
    that what is there is whole. The zip has the same bytes whenever and wherever it is made from the same source.
    Raises InstructorError where out can't be used, nbgrader is missing or refuses a notebook, or a solution leaks.
    """
    root, out = Path(root).resolve(), Path(out).resolve()
    archive = out.with_name(out.name + ".zip")
    _check_place(out, archive, overwrite, root)
    notebooks = source_notebooks(root)
    out.parent.mkdir(parents=True, exist_ok=True)
    # On Windows the gradebook may still be open for a moment.
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=".release_", ignore_cleanup_errors=True) as aside:
        aside = Path(aside)
        generate(notebooks, aside / BUILD)
        folder, packed = aside / TOP, aside / f"{TOP}.zip"
        assemble(folder, [aside / BUILD / "release" / path.stem / path.name for path in notebooks], root)
        leaks = leaks_of(folder, notebooks)
        if leaks:
            raise InstructorError("The student edition would give solutions away:\n" + "\n".join(leaks))
        pack(folder, packed)
        _move([(folder, out), (packed, archive)], aside)
    return out, archive


def _check_place(out: Path, archive: Path, overwrite: bool, root: Path) -> None:
    for part in ("notebooks", "hdr_helpers", "data"):
        if out.is_relative_to(root / part):
            raise InstructorError(f"{out} lies within {root / part}, which is handed out; give another folder with -o.")
    for there in filter(Path.exists, (out, archive)):
        if not is_release(there):
            raise InstructorError(f"{there} is there and is no student edition; give another folder with -o.")
        if not overwrite:
            raise InstructorError(f"{there} is there already; give another folder with -o, or --overwrite.")


def is_release(place) -> bool:
    """Is this folder or zip a student edition? It is known by the first line of its README."""
    try:
        if Path(place).is_dir():
            text = (Path(place) / "README.md").read_text(encoding="utf-8")
        else:
            with zipfile.ZipFile(place) as archive:
                text = archive.read(f"{TOP}/README.md").decode("utf-8")
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return False
    return text.splitlines()[:1] == README.read_text(encoding="utf-8").splitlines()[:1]


def assemble(folder: Path, notebooks: list[Path], root: Path) -> None:
    """Make the folder that a student gets.

    folder : must not be there; notebooks : as nbgrader made them; root : the course
    Raises InstructorError where a notebook has a TODO or a written answer without its stub, or a stored output.
    """
    (folder / "notebooks").mkdir(parents=True)
    for path in notebooks:
        (folder / "notebooks" / path.name).write_bytes(notebook_bytes(_checked(read_notebook(path), path.name)))
    for part in ("hdr_helpers", "data", ".binder"):
        for source in files(root / part):
            target = folder / source.relative_to(root)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
    shutil.copyfile(root / "environment.txt", folder / "environment.txt")
    project = student_pyproject((root / "pyproject.toml").read_text(encoding="utf-8"))
    (folder / "pyproject.toml").write_bytes(project.encode("utf-8"))
    shutil.copyfile(README, folder / "README.md")


def _checked(notebook: dict, name: str) -> dict:
    for cell in notebook["cells"]:
        stub = STUB if is_todo(cell) else WRITTEN_STUB if is_written(cell) else ""
        if stub not in cell["source"]:
            raise InstructorError(f"{cell['metadata']['nbgrader']['grade_id']} in {name} has no stub.")
        if cell.get("outputs") or cell.get("execution_count"):
            raise InstructorError(f"{name} still has the output of a cell: {cell['source'][:60]!r}")
    return notebook


def files(folder: Path) -> list[Path]:
    """Every file of a folder that is handed out, sorted: no caches, nothing hidden, no results, no grading."""
    found = []
    for path in sorted(folder.rglob("*"), key=lambda path: path.as_posix()):
        parts = path.relative_to(folder).parts
        kept = not any(part in NOT_HANDED_OUT or part.startswith(".") or part.endswith("_hdr") for part in parts)
        if path.is_file() and kept and path.suffix != ".pyc":
            found.append(path)
    return found


def student_pyproject(text: str) -> str:
    """The course's pyproject.toml without extras, tests and linters: what pip needs to install the course."""
    kept, wanted = [], False
    for line in text.splitlines():
        if line.startswith("["):
            wanted = line.strip("[] ") in TABLES
        if wanted:
            kept.append(line)
    text = "\n".join(kept).strip() + "\n"
    missing = {"build-system", "project"} - tomllib.loads(text).keys()
    if missing:
        raise InstructorError(f"pyproject.toml has no table {' and '.join(sorted(missing))}.")
    return text


def leaks_of(folder: Path, notebooks: list[Path]) -> list[str]:
    """What a student edition gives away, a sentence each with its file. notebooks : the source edition's."""
    sources = [read_notebook(path) for path in notebooks]
    exercises = [exercise for source in sources for exercise in (*todos(source), *written(source))]
    public = "\n".join(map(without_solutions, sources))
    leaks = []
    for path in sorted(folder.rglob("*")):
        if path.suffix == ".ipynb":
            text = all_strings(json.loads(path.read_text(encoding="utf-8")) | {"cells": read_notebook(path)["cells"]})
            found = given_away(text, exercises, public, idiom=0)
        elif path.suffix in (".py", ".md", ".txt", ".toml"):
            found = given_away(path.read_text(encoding="utf-8"), exercises)
        else:
            continue
        leaks += [f"{path.relative_to(folder).as_posix()}: {leak}" for leak in found]
    return leaks


def pack(folder: Path, archive: Path) -> None:
    """Zip a folder: sorted names, one date, one system, stored as they are.

    Not compressed: it would save a tenth, for photographs are compressed already, and the bytes would depend on the
    version of the compressor.
    """
    with zipfile.ZipFile(archive, "w") as packed:
        for path in sorted(folder.rglob("*"), key=lambda path: path.relative_to(folder).as_posix()):
            if path.is_file():
                info = zipfile.ZipInfo(f"{folder.name}/{path.relative_to(folder).as_posix()}", EPOCH)
                info.create_system, info.external_attr = 3, 0o100644 << 16
                packed.writestr(info, path.read_bytes())


def _move(pairs: list[tuple[Path, Path]], aside: Path) -> None:
    """Move each new thing into its place; where one can't be moved, all is as it was."""
    undo = []
    try:
        for k, (new, place) in enumerate(pairs):
            if place.exists():
                os.rename(place, aside / f"old_{k}")
                undo.append((aside / f"old_{k}", place))
            os.rename(new, place)
            undo.append((place, new))
    except OSError as problem:
        for moved, back in reversed(undo):
            os.rename(moved, back)
        raise InstructorError(f"The student edition could not be moved into its place: {problem}") from None
