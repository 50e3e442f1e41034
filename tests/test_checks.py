"""Checks name the mistake, survive whatever they are given, and never refuse a right answer."""

import ast
import importlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from hdr_helpers.lab import checks
from hdr_helpers.lab.checks import CheckFailed, check, hint, most_points
from hdr_helpers.lab.checks._todos import TODOS

sys.path.insert(0, str(Path(__file__).parent))
corpus = importlib.import_module("mistakes.corpus")
for stage in ("load", "align", "crf", "system", "curves", "merge", "tonemap"):
    importlib.import_module(f"mistakes.{stage}")

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
LIMIT = 4  # seconds; only endless loops come near


def named(answer):
    return f"{answer.number} {answer.what[:60]}"


def crosses(result):
    return " ".join(line.sentence for line in result.lines if line.state == "wrong")


@pytest.fixture(scope="module")
def outcomes():
    """Each wrong answer with its result."""
    return [(answer, check(answer.number, answer.function, limit=LIMIT)) for answer in corpus.WRONG]


def test_the_corpus_covers_every_todo_with_wrong_and_right_answers():
    assert {answer.number for answer in corpus.WRONG} == {answer.number for answer in corpus.RIGHT} == set(TODOS)
    assert len(corpus.WRONG) >= 60 and len(corpus.RIGHT) >= 20


def test_every_wrong_answer_loses_points(outcomes):
    assert not [named(answer) for answer, result in outcomes if result.passed]


def test_nearly_every_wrong_answer_is_told_its_mistake(outcomes):
    missed = [named(answer) for answer, result in outcomes if answer.says and answer.says not in crosses(result)]
    assert len(missed) <= 0.03 * len(outcomes), missed
    assert sum(bool(answer.says) for answer, _ in outcomes) >= 0.95 * len(outcomes)


def test_a_wrong_answer_is_not_taken_for_an_empty_one(outcomes):
    assert not [named(answer) for answer, result in outcomes if not result.started]


def test_points_follow_the_parts(outcomes):
    for answer, result in outcomes:
        assert type(result.points) is float and 0 <= result.points < result.most == most_points(answer.number)
        assert float(repr(result)) == result.points
    assert any(result.points > 0 for _, result in outcomes)


def test_no_sentence_is_given_for_right_and_wrong_alike(outcomes):
    for answer, result in outcomes:
        assert any(line.state == "wrong" for line in result.lines), named(answer)
        for line in result.lines:
            assert line.sentence[0].isalnum() and len(line.sentence) < 420, line.sentence


@pytest.mark.parametrize("answer", corpus.RIGHT, ids=named)
def test_a_right_answer_gets_full_points(answer):
    result = check(answer.number, answer.function)
    assert result.passed, str(result)


@pytest.mark.parametrize("number", sorted(TODOS))
def test_a_right_answer_is_right_on_data_of_other_seeds_too(number):
    right = next(answer for answer in corpus.RIGHT if answer.number == number)
    for seed in (1, 2024):
        result = check(number, right.function, seed=seed)
        assert result.passed, str(result)


@pytest.mark.parametrize("number", sorted(TODOS))
def test_the_courses_own_answer_is_right(number, monkeypatch):
    own = TODOS[number].course.__wrapped__
    monkeypatch.setattr(TODOS[number], "barred", ())  # it is made of the helpers' own
    result = check(number, lambda *args, **keywords: own(*args, **keywords))
    assert result.passed, str(result)


def functions_of(notebook):
    """Every function that a notebook defines, with the notebook's imports; TODOs by their number."""
    names, todos = {}, {}
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] != "code":
            continue
        source = "".join(cell["source"])
        wanted = (ast.Import, ast.ImportFrom, ast.FunctionDef)
        body = [node for node in ast.parse(source).body if isinstance(node, wanted)]
        exec(compile(ast.Module(body, []), notebook.name, "exec"), names)
        grade_id = cell["metadata"].get("nbgrader", {}).get("grade_id", "")
        if grade_id.startswith("todo-"):
            todos[grade_id.removeprefix("todo-").replace("-", ".")] = names[body[-1].name]
    return todos


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda n: n.stem)
def test_the_notebooks_own_solutions_get_full_points(notebook):
    todos = functions_of(notebook)
    assert todos
    for number, function in todos.items():
        result = check(number, function)
        assert result.passed, str(result)
        assert result.function is function
        assert TODOS[number].name == function.__name__


def test_every_todo_of_the_notebooks_has_a_check_and_hints():
    numbers = {number for notebook in NOTEBOOKS for number in functions_of(notebook)}
    assert numbers == set(TODOS)


def raises(*_):
    """A stub."""
    raise NotImplementedError()


def passes(*_):
    """A stub."""


def returns_none(*_):
    return None


@pytest.mark.parametrize("stub", [raises, passes, returns_none])
@pytest.mark.parametrize("number", sorted(TODOS))
def test_an_empty_todo_is_not_started_yet_and_the_course_goes_on_in_its_place(number, stub):
    result = check(number, stub)
    assert repr(result) == "0.0" and not result.started and "not started yet" in str(result)
    assert result.function is not stub and result.function.__name__ == TODOS[number].name
    again = check(number, result.function)  # the cell was run twice
    assert not again.started and repr(again) == "0.0"


def test_the_courses_own_functions_work_where_todos_are_empty(small_bracket):
    own = {todo.name: check(number, passes).function for number, todo in TODOS.items()}
    images, B = list(small_bracket.images), small_bracket.log_times
    rows, cols = np.random.default_rng(0).integers(0, 100, (2, 60))
    Z = own["sample_values"](images, rows, cols, 1)
    A, b = own["build_system"](Z, B, 20.0, own["hat"]())
    x = np.linalg.lstsq(A, b, rcond=None)[0]
    g, _ = own["my_gsolve"](Z, B, 20.0, own["hat"]())
    assert np.allclose(x[:256], g, atol=1e-6)
    crf = own["my_crf"](images, B, 20.0, own["hat"](), rows, cols)
    assert np.allclose(crf[1], g)
    assert own["plot_curves"](crf).axes
    radiance = own["my_merge"](images, B, crf, own["hat"]())
    assert np.allclose(own["merge_channel"](np.stack(images)[..., 0], B, crf[0], own["hat"]()), radiance[..., 0])
    assert own["stops_above_median"](radiance).shape == radiance.shape[:2]
    for name in ("reinhard_global", "reinhard_by_opencv"):
        assert own[name](radiance).shape == radiance.shape


def test_a_function_that_needs_an_earlier_todo_is_checked_although_that_is_empty():
    names = {"np": np}
    exec(corpus.ANSWERS["3.4"] + "\ndef build_system(*_):\n    raise NotImplementedError\n", names)
    mine = names["build_system"]
    assert check("3.4", names["my_gsolve"]).passed
    assert names["build_system"] is mine


def test_the_points_are_a_bare_number_and_the_table_is_for_people():
    result = check("3.1", lambda: np.ones(256))
    assert repr(result) == "1.0"
    html = result._repr_html_()
    assert html.startswith("<table>") and "✓" in html and "✗" in html and "hint(" in html
    assert "<script>" not in check("1.2", lambda name: "<script>")._repr_html_()


def test_where_all_is_right_the_praise_says_what_is_next_and_where_not_how_far_it_is_off():
    assert "?" in check("3.1", TODOS_RIGHT["3.1"]).last
    assert "yours 1, spec 0" in check("3.1", lambda: np.minimum(np.arange(256.0), 255 - np.arange(256)) + 1).difference


TODOS_RIGHT = {answer.number: answer.function for answer in corpus.RIGHT}


def test_under_the_environment_variable_a_check_short_of_points_raises(monkeypatch):
    monkeypatch.setenv("HDR_CHECKS_MUST_PASS", "1")
    with pytest.raises(CheckFailed, match="weight 1"):
        check("3.1", lambda: np.minimum(np.arange(256.0), 255 - np.arange(256)) + 1)
    assert check("3.1", TODOS_RIGHT["3.1"]).passed


def test_hints_ask_first_and_go_on_from_rung_to_rung_without_code():
    for number, todo in TODOS.items():
        assert 3 <= len(todo.hints) <= 4
        checks._asked.pop(number, None)
        rungs = [hint(number) for _ in range(len(todo.hints) + 1)]
        assert [rung.text for rung in rungs] == [*todo.hints, todo.hints[-1]]
        for rung in rungs:
            assert "?" in rung.text and "=" not in rung.text and "\n" not in rung.text
            assert number in repr(rung) and "<p>" in rung._repr_html_()


def test_an_unknown_todo_is_answered_with_those_there_are():
    for call in (lambda: check("9.9", passes), lambda: hint("9.9"), lambda: most_points("9.9")):
        with pytest.raises(ValueError, match=r"9\.9.*3\.3"):
            call()
