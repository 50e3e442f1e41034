"""The house itself: who may import whom, what every notebook must have, what the README promises."""

import ast
import json
import re
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
from packaging.markers import Marker

from hdr_helpers.lab.checks import most_points

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
STAGES = ["load", "align", "crf", "merge", "tonemap"]
ROOMS = {"_reading": "load", "_registering": "align", "_response": "crf", "_merging": "merge"}  # behind which stage


def imports(path):
    """Every module that a file imports."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module


def code_cells(notebook):
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    return [cell | {"source": "".join(cell["source"])} for cell in cells if cell["cell_type"] == "code"]


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_imports_only_numbers_and_earlier_stages(stage):
    earlier = {f"hdr_helpers.{name}" for name in STAGES[: STAGES.index(stage)]}
    for module in imports(ROOT / "hdr_helpers" / f"{stage}.py"):
        if module.startswith("hdr_helpers"):
            behind = [f"hdr_helpers.{rooms}" for rooms, owner in ROOMS.items() if owner == stage]
            rooms = ("hdr_helpers.papers", *behind)
            assert module in earlier or module.startswith(rooms)
        else:
            assert module.split(".")[0] not in {"matplotlib", "IPython", "ipywidgets", "nbgrader"}


@pytest.mark.parametrize("behind, stage", ROOMS.items())
def test_a_room_behind_a_stage_imports_only_its_neighbours_earlier_stages_and_papers(behind, stage):
    rooms = list((ROOT / "hdr_helpers" / behind).glob("*.py"))
    earlier = {f"hdr_helpers.{name}" for name in STAGES[: STAGES.index(stage)]}
    assert rooms
    for room in rooms:
        for module in imports(room):
            if module.startswith("hdr_helpers"):
                assert module in earlier or module.startswith((f"hdr_helpers.{behind}", "hdr_helpers.papers")), (
                    room.name
                )


def test_every_room_is_small():
    modules = [*(ROOT / "hdr_helpers").rglob("*.py")]
    assert modules
    assert not [path.name for path in modules if len(path.read_text(encoding="utf-8").splitlines()) > 260]


def test_nothing_outside_of_grading_imports_it():
    for path in (ROOT / "hdr_helpers").rglob("*.py"):
        if "grading" not in path.relative_to(ROOT).parts:
            assert not [module for module in imports(path) if module.startswith("hdr_helpers.grading")], path.name


def test_every_function_is_called_by_the_course_and_not_by_tests_alone():
    modules = {path: path.read_text(encoding="utf-8") for path in (ROOT / "hdr_helpers").rglob("*.py")}
    words = {path: Counter(re.findall(r"\w+", text)) for path, text in modules.items()}
    cells = [cell["source"] for notebook in NOTEBOOKS for cell in code_cells(notebook)]
    used = Counter(re.findall(r"\w+", "\n".join([*cells, (ROOT / "README.md").read_text(encoding="utf-8")])))
    for path, counted in words.items():
        if path.name != "__init__.py":  # where a name that is passed on would count as a use
            used += counted
    for path, text in modules.items():
        for node in ast.parse(text).body:
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and node.name != "_":
                own = words[path][node.name] if path.name == "__init__.py" else 0
                assert used[node.name] + own > 1, f"{node.name} in {path.name}"


def test_a_paper_imports_no_stage():
    papers = list((ROOT / "hdr_helpers" / "papers").glob("*.py"))
    assert papers
    for paper in papers:
        ours = [module for module in imports(paper) if module.startswith("hdr_helpers")]
        assert all(module.startswith("hdr_helpers.papers") for module in ours), paper.name


def test_there_are_five_notebooks_named_like_the_five_stages():
    assert [n.stem for n in NOTEBOOKS] == [f"0{i}_{stage}" for i, stage in enumerate(STAGES, 1)]


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda n: n.stem)
def test_a_notebook_was_run_from_top_to_bottom_and_says_nothing_on_stderr(notebook):
    cells = code_cells(notebook)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    for cell in cells:
        kinds = {output.get("name", output["output_type"]) for output in cell["outputs"]}
        assert not kinds & {"stderr", "error"}, cell["source"]
    assert notebook.stat().st_size < 3e6


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda n: n.stem)
def test_every_picture_in_a_notebook_has_a_sentence_for_those_who_can_not_see_it(notebook):
    pictures = 0
    for cell in code_cells(notebook):
        for output in cell["outputs"]:
            for kind in output.get("data", {}):
                if kind.startswith("image/"):
                    pictures += 1
                    alt = output["metadata"][kind]["alt"]
                    assert alt[0].isupper() and alt.endswith(".") and len(alt.split()) >= 6, alt
    assert pictures >= 5


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda n: n.stem)
def test_every_todo_has_signature_docstring_and_a_marked_solution(notebook):
    text = notebook.read_text(encoding="utf-8")
    announced = re.findall(r"### TODO (\d\.\d)", text)
    todos = [cell for cell in code_cells(notebook) if cell["metadata"].get("nbgrader", {}).get("solution")]
    assert [f"todo-{number.replace('.', '-')}" for number in announced] == [
        cell["metadata"]["nbgrader"]["grade_id"] for cell in todos
    ]
    for cell in todos:
        assert cell["source"].count("### BEGIN SOLUTION") == cell["source"].count("### END SOLUTION") == 1
        (function,) = ast.parse(cell["source"]).body
        assert ast.get_docstring(function)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda n: n.stem)
def test_every_todo_says_what_comes_in_and_goes_out_in_how_many_lines_and_asks_for_a_prediction(notebook):
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    text = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    exercises = re.split(r"### TODO \d\.\d", text)[1:]
    assert len(exercises) >= 2
    for exercise in exercises:
        exercise = re.split(r"^#", exercise, maxsplit=1, flags=re.M)[0]
        for promised in (r"\*Out:\*", r"\*[^*]*\d lines?[^*]*\*", r"\*\*Predict:\*\*"):
            assert re.search(promised, exercise), (promised, exercise[:60])


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda n: n.stem)
def test_every_todo_is_followed_by_its_check_worth_its_points(notebook):
    cells = code_cells(notebook)
    checks = 0
    for todo, cell in pairwise(cells):
        if not todo["metadata"].get("nbgrader", {}).get("solution"):
            continue
        number = todo["metadata"]["nbgrader"]["grade_id"].removeprefix("todo-").replace("-", ".")
        (function,) = (node.name for node in ast.parse(todo["source"]).body)
        assert f'result = check("{number}", {function})' in cell["source"]
        assert cell["source"].endswith(f"{function} = result.function\nresult")
        graded = cell["metadata"]["nbgrader"]
        assert (graded["grade"], graded["locked"], graded["solution"]) == (True, True, False)
        assert graded["points"] == most_points(number)
        (output,) = cell["outputs"]
        assert "".join(output["data"]["text/plain"]) == repr(most_points(number))
        checks += 1
    assert checks >= 2


def test_the_readme_says_how_many_points_each_notebook_has_by_checks_and_for_answers_in_words():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for notebook in NOTEBOOKS:
        points = {"code": 0, "markdown": 0}
        for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
            points[cell["cell_type"]] += cell["metadata"].get("nbgrader", {}).get("points", 0)
        both = rf"{points['code']:g} \+ {points['markdown']:g}"
        assert re.search(rf"notebooks/{notebook.stem}\.ipynb.*\| {both} \| \d+ \|$", text, re.M), notebook.stem


def test_the_readmes_test_command_is_what_ci_runs():
    (command,) = re.findall(
        r"^python3 -m venv \.venv-test && .*$", (ROOT / "README.md").read_text(encoding="utf-8"), re.M
    )
    for path in (".ci/run", ".github/workflows/test.yml"):
        assert command in (ROOT / path).read_text(encoding="utf-8"), path


def test_the_environment_is_the_seven_packages_pinned_and_the_course_itself():
    lines = [line for line in (ROOT / "environment.txt").read_text().splitlines() if not line.startswith("#")]
    pinned = [re.fullmatch(r"([\w-]+)==[\d.]+(?:; (python_version (?:<|>=) \"3\.15\"))?", line) for line in lines[:-1]]
    seven = ["numpy", "scipy", "opencv-python-headless", "matplotlib", "jupyterlab", "nbval", "ipywidgets"]
    for python in ("3.11", "3.15"):  # lowest and newest: each package once
        here = [pin[1] for pin in pinned if not pin[2] or Marker(pin[2]).evaluate({"python_version": python})]
        assert here == seven
    assert lines[-1] == "-e ."
