"""The words of the notebooks: terms and their Chinese, links, numbers of equations, minutes, length of sentences."""

import re
import statistics
from pathlib import Path

import pytest

from hdr_helpers.grading.solutions import is_written, read_notebook

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
STEPS = ["load", "align", "recover the response", "merge", "tone-map"]
each_notebook = pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)

HAN = "[\u4e00-\u9fff]+"
CHINESE = f"{HAN}(?:-{HAN})?"
GLOSS = rf" \((?:[A-Z]{{2,4}}, )?({CHINESE})\)"  # term (中文) or term (ABC, 中文)
LINK = re.compile(r"\[([^\]]*)\]\(([^)\s]+)\)")
ENTRY = re.compile(r"^\| ([^|]+) \| ([^|]+) \| ([^|]+) \| \[([^\]]+)\]\(([^)]+)\) \|$", re.M)
# Everyday words, which may stand in their usual sense before the place where they become a term.
EVERYDAY = {"contrast", "detail", "local", "shift"}

LONGEST_SENTENCE, LONGEST_PARAGRAPH = 30, 90  # words
MIDDLE, LONG, FEW = 12.5, 20, 0.16  # median length, words of a long sentence, share of long ones
# The pace of a second-language reader, and minutes for a TODO, an answer in words and a look at a figure.
WORDS_A_MINUTE, A_TODO, AN_ANSWER, A_FIGURE = 150, 9, 5, 0.5


def text_cells(notebook):
    """(id, text) of what a student reads: no model answers, and not the glossary."""
    cells = [cell for cell in read_notebook(notebook)["cells"] if cell["cell_type"] == "markdown"]
    return [(cell["id"], cell["source"]) for cell in cells if not is_written(cell) and cell["id"] != "05-glossary"]


def whole_text(notebook):
    return "\n\n".join(text for _, text in text_cells(notebook))


def intro(notebook):
    return text_cells(notebook)[0][1].splitlines()


def figures(cell):
    return sum(kind.startswith("image/") for output in cell.get("outputs", []) for kind in output.get("data", {}))


def without_markup(text):
    return re.sub(r"[*`]", "", LINK.sub(r"\1", text))


# Terms and their Chinese


def glossary():
    """Entries of the glossary: English, Chinese, meaning, name of the link, its target."""
    (cell,) = (cell for cell in read_notebook(NOTEBOOKS[-1])["cells"] if cell["id"] == "05-glossary")
    assert cell["source"].startswith("## Glossary (术语表)\n")
    entries = ENTRY.findall(cell["source"])
    assert len(entries) == cell["source"].count("\n|") - 2, "a row of the glossary can't be read"
    return entries


def as_term(english):
    return rf"(?<![\w-]){re.escape(english)}s?(?!\w)"


def glossed_terms():
    """(notebook, section, English, Chinese) of each gloss; English is the longest entry that stands before it."""
    entries = sorted((entry[0] for entry in glossary()), key=len, reverse=True)
    for notebook in NOTEBOOKS:
        section = None
        for line in without_markup(whole_text(notebook)).splitlines():
            section = line.removeprefix("## ") if line.startswith("## ") else section
            for gloss in re.finditer(GLOSS, line):
                before = line[: gloss.start()]
                fitting = [english for english in entries if re.search(as_term(english) + "$", before, re.I)]
                assert fitting, f"{notebook.stem}: no entry in the glossary for ...{before[-30:]} ({gloss[1]})"
                yield notebook, section, fitting[0], gloss[1]


@each_notebook
def test_chinese_stands_in_brackets_behind_its_term_and_nowhere_else(notebook):
    for name, text in text_cells(notebook):
        left = re.sub(GLOSS, "", without_markup(text))
        assert not re.search(HAN, left), (name, re.findall(rf".{{0,30}}{HAN}", left))


def test_every_gloss_is_in_the_glossary_and_every_entry_is_glossed_once_with_the_same_chinese():
    in_text = [(english, chinese) for _, _, english, chinese in glossed_terms()]
    in_table = [(entry[0], entry[1]) for entry in glossary()]
    assert in_table == sorted(in_table, key=lambda entry: entry[0].lower()) and len(in_table) >= 100
    assert all(2 <= count_words(meaning) <= 20 for _, _, meaning, *_ in glossary())
    assert len(dict(in_text)) == len(in_text), "a term is glossed twice"
    assert sorted(in_text) == sorted(in_table)
    assert len({chinese for _, chinese in in_table}) == len(in_table), "one Chinese word for two terms"


def test_the_glossary_links_each_term_to_the_notebook_and_section_where_it_is_glossed():
    links = {entry[0]: entry[3:] for entry in glossary()}
    links = {entry[0]: entry[3:] for entry in glossary()}
    for notebook, section, english, _ in glossed_terms():
        name, place = notebook.stem[1], notebook.name
        if section:
            name, place = f"{name}, {section}", f"{place}#{section.replace(' ', '-')}"
        assert links[english] == (name, place), english


def test_no_term_is_used_before_it_is_glossed():
    # Headings, and the goals at the top of a notebook, announce what is explained below them.
    lines = []
    for notebook in NOTEBOOKS:
        for name, text in text_cells(notebook):
            text = re.sub(r"\$[^$]*\$", "", without_markup(text))
            if name.endswith("-01"):
                text = "\n".join(found[0] for found in re.finditer(rf"[\w -]+{GLOSS}", text))
            lines += [line for line in text.splitlines() if not line.startswith(("#", "Before:", "Next:"))]
    course = "\n".join(lines)
    entries = sorted(glossary(), key=lambda entry: -len(entry[0]))
    for english, chinese, *_ in entries:  # so that "high dynamic range", glossed, is no use of "dynamic range"
        course = re.sub(as_term(english) + rf"(?= \((?:[A-Z]{{2,4}}, )?{chinese}\))", "", course, flags=re.I)
    for english, chinese, *_ in entries:
        if english not in EVERYDAY:
            before = course[: course.index(f"{chinese})")]
            assert not re.search(as_term(english).replace(r"\-", "[ -]"), before, re.I), english


# Links


@each_notebook
def test_links_to_notebooks_sections_and_cells_lead_somewhere(notebook):
    cells = read_notebook(notebook)["cells"]
    targets = LINK.findall("\n".join(cell["source"] for cell in cells if cell["cell_type"] == "markdown"))
    for target in (target for _, target in targets if not target.startswith("https://")):
        name, _, fragment = target.partition("#")
        there = ROOT / "notebooks" / name if name else notebook
        assert there in NOTEBOOKS, target
        headings = re.findall("^#{1,3} (.*)$", whole_text(there), re.M)
        known = {f"cell-id={cell['id']}" for cell in read_notebook(there)["cells"]}
        assert fragment in {"", *known, *(heading.replace(" ", "-") for heading in headings)}, target


@each_notebook
def test_the_five_steps_at_the_top_link_all_notebooks_but_this_one_which_is_bold(notebook):
    steps = zip([f"{k} {step}" for k, step in enumerate(STEPS, 1)], NOTEBOOKS, strict=True)
    line = " → ".join(f"**{step}**" if path == notebook else f"[{step}]({path.name})" for step, path in steps)
    assert line in intro(notebook)


@each_notebook
def test_the_end_links_the_neighbours_by_their_titles(notebook):
    k, last = NOTEBOOKS.index(notebook), whole_text(notebook).splitlines()[-1]
    neighbours = [("Before", path) for path in NOTEBOOKS[:k][-1:]] + [("Next", path) for path in NOTEBOOKS[k + 1 :][:1]]
    for which, path in neighbours:
        assert f"**{which}:** [{intro(path)[0].removeprefix('# ')}]({path.name})" in last


# Equations


@each_notebook
def test_a_displayed_equation_has_the_papers_number_or_says_whose_it_is(notebook):
    for equation in re.findall(r"\$\$(.*?)\$\$", whole_text(notebook), re.S):
        tag = re.search(r"\\qquad \\text\{\((.*)\)\}$", equation)
        assert tag, equation
        whose = r"paper, eq\. [1-6]( with eq\. [1-6])?|their eq\. \d(, \d)*|.*[A-Z][a-z]+.* \d{4}"
        assert re.fullmatch(whose, tag[1]), tag[1]


def test_all_six_equations_of_the_paper_are_shown_and_no_other_number_is_named():
    text = "\n".join(whole_text(notebook) for notebook in NOTEBOOKS)
    shown = {number for tag in re.findall(r"\\text\{\(paper, (.*?)\)\}", text) for number in re.findall(r"\d", tag)}
    named = re.findall(r"(?:[Ee]quation|eq\.) (\d+)", re.sub(r"\$\$.*?\$\$", "", text, flags=re.S))
    assert shown == set("123456")
    assert len(named) >= 5 and set(named) <= shown


# Minutes


def estimated_minutes(notebook):
    text = whole_text(notebook)
    todos, answers = (len(re.findall(rf"^### {kind} \d\.\d", text, re.M)) for kind in ("TODO", "Question"))
    shown = sum(figures(cell) for cell in read_notebook(notebook)["cells"])
    return count_words(text) / WORDS_A_MINUTE + A_TODO * todos + AN_ANSWER * answers + A_FIGURE * shown


@each_notebook
def test_minutes_agree_with_both_readmes_and_within_a_third_with_words_todos_answers_and_figures(notebook):
    (minutes,) = re.findall(r"About (\d+) minutes", "\n".join(intro(notebook)))
    assert 2 / 3 < int(minutes) / estimated_minutes(notebook) < 4 / 3
    for readme in (ROOT / "README.md", ROOT / "hdr_helpers" / "grading" / "STUDENT.md"):
        text = readme.read_text(encoding="utf-8")
        assert re.findall(rf"^\| .*{notebook.name}.*\| (\d+) \|$", text, re.M) == [minutes]


# Sentences


def without_formulas(text):
    return re.sub(r"\$\$.*?\$\$|\$[^$]*\$|`[^`]*`", "X", LINK.sub(r"\1", text), flags=re.S)


def count_words(text):
    return len(re.findall(r"[^\W\d_][\w'’-]*|\d[\d.,/]*", re.sub(HAN, "", without_formulas(text))))


def paragraphs(notebook):
    """(id, paragraph) of each paragraph and each item of a list; no headings, tables, displayed equations or code."""
    for name, text in text_cells(notebook):
        text = re.sub(r"```.*?```|\$\$.*?\$\$|(?m:^[#|][^\n]*)", "\n\n", text, flags=re.S)
        for paragraph in re.split(r"\n\s*\n|\n(?=[-*] |\d+\. )", text):
            if count_words(paragraph):
                yield name, re.sub(r"^\s*(?:[-*]|\d+\.) ", "", paragraph).strip()


def sentences(paragraph):
    text = without_formulas(paragraph).replace("*", "").replace("eq. ", "eq.")
    return [part for part in re.split(r"(?<=[.?!])[)\"]*\s+(?=[(\"]?[A-Z0-9])", text) if count_words(part)]


def test_sentences_and_words_are_counted_as_a_reader_would():
    text = 'By eq. 6, $a. b$ is `c. D` here (so it is). "Is it?" 24 bits at last: it *is* (是).'
    assert [count_words(sentence) for sentence in sentences(text)] == [10, 2, 6]


@each_notebook
def test_no_sentence_and_no_paragraph_is_too_long(notebook):
    for name, paragraph in paragraphs(notebook):
        assert count_words(paragraph) <= LONGEST_PARAGRAPH, (name, paragraph[:60])
        for sentence in sentences(paragraph):
            assert count_words(sentence) <= LONGEST_SENTENCE, (name, sentence)


@each_notebook
def test_the_middle_sentence_is_short_and_few_are_long(notebook):
    lengths = [count_words(sentence) for _, paragraph in paragraphs(notebook) for sentence in sentences(paragraph)]
    assert len(lengths) >= 80
    assert statistics.median(lengths) <= MIDDLE
    assert sum(length > LONG for length in lengths) / len(lengths) <= FEW


# The form of a notebook


@each_notebook
def test_a_notebook_opens_with_a_verb_goals_and_the_problem_as_a_picture_and_ends_with_a_summary(notebook):
    first, cells = intro(notebook), read_notebook(notebook)["cells"]
    assert re.fullmatch(rf"# {notebook.stem[1]} · (Load|Align|Recover|Merge|Tone-map) .+", first[0])
    assert [line.split("**")[1] for line in first[2:6]] == ["You'll do", "You'll learn", "You'll need", "You'll get"]
    todo = next(k for k, cell in enumerate(cells) if "### TODO" in cell["source"])
    assert any(figures(cell) for cell in cells[:todo])
    end = re.findall("^## (Going further|Questions to answer in words|Summary)", whole_text(notebook), re.M)
    assert end == ["Going further", "Questions to answer in words", "Summary"]
