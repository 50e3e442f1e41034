"""A function of the course that was pasted into a notebook is found, and an answer of one's own never is."""

import ast
import importlib
import inspect
import linecache
import sys
from pathlib import Path
from textwrap import dedent

import nbformat
import pytest

from hdr_helpers import crf, merge
from hdr_helpers.grading._intake.copies import copied_from_the_course
from hdr_helpers.grading.course import source_notebooks
from hdr_helpers.grading.solutions import BEGIN, read_notebook
from hdr_helpers.papers import reinhard2002, ward2003

sys.path.insert(0, str(Path(__file__).parent))
corpus = importlib.import_module("mistakes.corpus")
for stage in ("load", "align", "crf", "system", "curves", "merge", "tonemap"):
    importlib.import_module(f"mistakes.{stage}")


class Renamed(ast.NodeTransformer):
    """Every name of a function's own becomes another one."""

    def __init__(self, function):
        self.own = {name: f"my_{k}" for k, name in enumerate(function.__code__.co_varnames)}

    def visit_Name(self, node):
        node.id = self.own.get(node.id, node.id)
        return node

    def visit_arg(self, node):
        node.arg = self.own.get(node.arg, node.arg)
        return node

    def visit_FunctionDef(self, node):
        self.generic_visit(node)
        node.name, node.returns = "mine", None
        return node


def disguised(function) -> str:
    """A function's source with other names, no docstring, and a comment in every line."""
    tree = Renamed(function).visit(ast.parse(dedent(inspect.getsource(function))))
    tree.body[0].body = tree.body[0].body[1:] if ast.get_docstring(tree.body[0]) else tree.body[0].body
    return "\n".join(f"{line}  # I thought of this" for line in ast.unparse(tree).splitlines())


def notebook_of(*sources):
    return nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in sources])


@pytest.mark.parametrize(
    "function",
    [crf._solve_reduced, crf._ties, merge.merge_debevec, ward2003.disagreement, reinhard2002.tonemap_reinhard_global],
    ids=lambda function: function.__name__,
)
def test_a_function_of_the_course_is_found_in_any_cell_under_other_names_and_with_comments(function):
    (said,) = copied_from_the_course(notebook_of("x = 1", disguised(function), "%%bash\nls"))
    file = Path(inspect.getsourcefile(function)).name
    assert said.startswith(f"mine has the structure of {function.__name__} in ") and file in said


@pytest.mark.parametrize("number", sorted({answer.number for answer in corpus.RIGHT}))
def test_no_right_answer_is_taken_for_the_courses(number):
    for answer in (answer for answer in corpus.RIGHT if answer.number == number):
        file = answer.function.__code__.co_filename
        source = "".join(linecache.cache[file][2]) if file.startswith("<") else inspect.getsource(answer.function)
        assert copied_from_the_course(notebook_of(source)) == [], answer.what


def test_no_solution_of_a_notebook_and_nothing_that_it_hands_out_is_taken_for_the_courses():
    assert len(corpus.RIGHT) >= 49
    for path in source_notebooks():
        sources = [cell["source"] for cell in read_notebook(path)["cells"] if cell["cell_type"] == "code"]
        assert any(BEGIN in source for source in sources)
        assert copied_from_the_course(notebook_of(*sources)) == [], path.name
