"""The course as web pages: whole, without solutions, without a network, and made without a warning."""

import logging
import re
import warnings
from html.parser import HTMLParser
from importlib.util import find_spec

import pytest

from hdr_helpers.grading.__main__ import main
from hdr_helpers.grading.course import ROOT, InstructorError, source_notebooks
from hdr_helpers.grading.solutions import given_away, read_notebook, todos, without_solutions, written
from hdr_helpers.grading.web import MATH, to_be_read, with_equations, without_equations, write_pages

needs_converter = pytest.mark.skipif(
    find_spec("latex2mathml") is None, reason="latex2mathml is not installed: the pages extra"
)
NOTEBOOKS = source_notebooks()


class Page(HTMLParser):
    """What a browser would fetch, run and show of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.links, self.fetched, self.words, self.ids = [], [], [], [], set()
        self.feed(text)
        self.text = "".join(self.words)

    def handle_starttag(self, tag, attributes):
        facts = dict(attributes)
        self.tags.append((tag, facts))
        self.ids.add(facts.get("id"))
        if tag == "a" and "href" in facts:
            self.links.append(facts["href"])
        if tag in ("img", "script", "iframe", "link") and not (facts.get("src") or "").startswith("data:"):
            self.fetched.append((tag, facts))

    def handle_data(self, data):
        if self.cdata_elem is None:
            self.words.append(data)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Pages by name, and what was warned of while they were made."""
    said = []
    handler = logging.Handler(logging.WARNING)
    handler.emit = lambda record: said.append(record.getMessage())
    loggers = [logging.getLogger(name) for name in (None, "traitlets", "nbconvert")]
    for logger in loggers:
        logger.addHandler(handler)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        paths = write_pages(tmp_path_factory.mktemp("pages"))
    for logger in loggers:
        logger.removeHandler(handler)
    pages = {path.name: path.read_text(encoding="utf-8") for path in paths}
    return pages, said + [str(warning.message) for warning in caught]


@needs_converter
def test_the_pages_are_the_readme_and_the_five_notebooks_made_without_a_warning(made):
    pages, said = made
    assert list(pages) == ["index.html", *(f"{path.stem}.html" for path in NOTEBOOKS)]
    assert said == []


@needs_converter
def test_a_page_fetches_nothing_and_runs_nothing(made):
    for name, text in made[0].items():
        assert Page(text).fetched == [], name


@needs_converter
def test_links_between_the_pages_and_within_them_lead_somewhere(made):
    pages = {name: Page(text) for name, text in made[0].items()}
    for name, page in pages.items():
        for link in page.links:
            if link.startswith(("https://", "http://", "mailto:")):
                continue
            target, _, place = link.partition("#")
            assert (target or name) in pages, f"{link} in {name}"
            assert not place or place in pages[target or name].ids, f"{link} in {name}"


@needs_converter
def test_every_picture_on_a_page_has_words_in_its_place(made):
    for name, text in made[0].items():
        pictures = [facts for tag, facts in Page(text).tags if tag == "img"]
        assert pictures or name == "index.html"
        assert all(len(facts.get("alt") or "") > 20 for facts in pictures), name
        assert "No description" not in text


@needs_converter
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_page_gives_no_solution_away_and_keeps_what_the_cells_have_shown(made, path):
    notebook = read_notebook(path)
    text = Page(made[0][f"{path.stem}.html"]).text
    assert given_away(text, [*todos(notebook), *written(notebook)], without_solutions(notebook), idiom=0) == []
    assert text.count("raise NotImplementedError()") == len(todos(notebook))
    assert f"TODO {path.stem[1]}.1" in text and "points" in text


@needs_converter
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_equation_is_there_as_mathml(made, path):
    cells = [cell for cell in to_be_read(read_notebook(path))["cells"] if cell["cell_type"] == "markdown"]
    found = [m for cell in cells for m in MATH.finditer(cell["source"]) if m["code"] is None]
    page = Page(made[0][f"{path.stem}.html"])
    assert sum(tag == "math" for tag, _ in page.tags) == len(found)
    assert not re.search(r"equation\d+here|\$\\|\\frac|\\sum", page.text)


@needs_converter
def test_money_and_code_are_no_equations_and_an_equation_survives_markdown():
    equations = []
    text = without_equations("`$x$` costs 5$ or 6$; $a_1 * b_1 * c$ and\n```\n$y$\n```", equations)
    assert equations == ["$a_1 * b_1 * c$"] and "`$x$`" in text and "$y$" in text
    page = with_equations(text, equations)
    assert page.count("<math") == 1 and page.count("<msub>") == 2


def test_a_folder_with_other_things_in_it_is_left_alone(tmp_path, capsys):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InstructorError, match="other things than pages"):
        write_pages(tmp_path)
    assert main(["pages", "-o", str(tmp_path)]) == 1
    assert str(tmp_path) in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_the_readme_is_found():
    assert (ROOT / "README.md").is_file()
