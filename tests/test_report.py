"""The class report, the table for spreadsheets and the students' pages say what the outcomes say, and nothing runs."""

import base64
import csv
import importlib
import re
import sys
from collections import Counter
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from hdr_helpers.grading._reporting.report import mistake_of, mistakes, write_csv, write_report, write_student_pages
from hdr_helpers.grading.outcome import NotebookOutcome, StudentOutcome, TodoOutcome, WrittenOutcome
from hdr_helpers.lab.checks import check
from hdr_helpers.lab.checks._todos import NOT_LOOKED_AT

sys.path.insert(0, str(Path(__file__).parent))
corpus = importlib.import_module("mistakes.corpus")
for stage in ("load", "crf"):
    importlib.import_module(f"mistakes.{stage}")

NUMBERS = {"01_load": ("1.1", "1.2", "1.10"), "03_crf": ("3.1", "3.3")}
SCRIPT = '<script>alert("1")</script>'
SAID = "The curve of <b>red</b> was used, yours 0.31 at value 128."
VOID = {"meta", "img", "source", "br"}


def student(k, rng):
    """One student with points, states, marks, flags and a notebook's fate by chance."""
    books = []
    for name, numbers in NUMBERS.items():
        kind = str(rng.choice(["graded", "graded", "graded", "missing", "stopped"]))
        todos = [todo(number, kind, rng) for number in numbers]
        points = 0.0 if kind == "missing" else None if rng.random() < 0.4 else float(rng.integers(0, 9)) / 2
        flags = ["The kernel ended."] if kind == "stopped" else []
        books.append(NotebookOutcome(name, kind, todos, [WrittenOutcome("answer-1", points, 4.0)], flags, rng.random()))
    return StudentOutcome(f"s{k:03d}", f"Zoë {k}, Ł.", books, ["Handed in late."] if rng.random() < 0.2 else [])


def todo(number, kind, rng):
    if kind == "missing":
        return TodoOutcome(number, 0.0, 4.0, "empty")
    points = float(rng.choice([0, 0, 1, 2.5, 4, 4, 4]))
    if points == 4:
        return TodoOutcome(number, 4.0, 4.0, "right")
    state = "partial" if points else str(rng.choice(["wrong", "empty", "unasked"]))
    said = [SAID.replace("128", str(rng.integers(256))), NOT_LOOKED_AT] if state in ("partial", "wrong") else []
    return TodoOutcome(number, points, 4.0, state, said, bool(rng.random() < 0.1))


def class_of(size, seed=0):
    rng = np.random.default_rng(seed)
    return [student(k, rng) for k in range(size)]


def report(folder, students, **given):
    facts = {"title": "The class", "notes": [], "links": {}} | given
    return write_report(folder, students, **facts).read_text(encoding="utf-8")


def rows_of(path):
    with open(path, encoding="utf-8-sig", newline="") as file:
        return list(csv.DictReader(file))


class Reader(HTMLParser):
    """What a page holds: elements that are not closed fail, tables by caption, text, attributes."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.tables, self.text = [], [], {}, ""
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "caption":
            self.caption = ""
        elif tag == "tr":
            self.tables.setdefault(self.caption, []).append([])
        elif tag in ("td", "th"):
            self.tables[self.caption][-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" in self.open:
            return
        self.text += data
        if "caption" in self.open:
            self.caption += data
        elif {"td", "th"} & set(self.open):
            self.tables[self.caption][-1][-1] += data

    def table(self, caption):
        (found,) = (rows for name, rows in self.tables.items() if name.startswith(caption))
        return found[1:]


# The mistake that a sentence names


@pytest.mark.parametrize(
    "one, other",
    [
        ("w differs: yours 0.31 at value 128.", "w differs: yours 0.32 at value 17."),
        ("w differs: yours -1.5e-07 at value 1.", "w differs: yours nan at value 17."),
        ("A has shape (3, 24, 31); it should be flat.", "A has shape (266,); it should be flat."),
        ("The time is the text '15'; it is none.", "The time is the text '1.6'; it is none."),
        ("Look at `a = b[1]` again.", "Look at `x = y.z` again."),
        ("my hat 3.jpg came out as 55: too long.", "IMG_60.png came out as 60: too long."),
        ("hat stops with IndexError (index 3) in line 4 of its cell: w[3] = 1", "f stops with IndexError."),
        (
            "What it returns could not be looked at (TypeError: a).",
            "What it returns could not be looked at (TypeError)",
        ),
        ("hat was stopped, because it gets 20 seconds.", "bell was stopped, because it gets 4 seconds."),
    ],
)
def test_sentences_that_differ_by_number_quotation_or_exceptions_words_name_one_mistake(one, other):
    assert mistake_of(one) == mistake_of(other)


@pytest.mark.parametrize(
    "one, other",
    [
        ("hat stops with IndexError (1).", "hat stops with ValueError (1)."),
        ("The picture is uint8; it is not.", "The picture is float64; it is not."),
        ("hat calls hat_weights, which is there.", "hat calls createMergeDebevec, which is there."),
        ("It's the course's own mean.", "It's the student's own mean."),
        ("It is log10 of the light.", "It is log2 of the light."),
    ],
)
def test_sentences_that_differ_in_what_is_wrong_name_two_mistakes(one, other):
    assert mistake_of(one) != mistake_of(other)


def test_an_exceptions_mistake_is_its_type():
    assert mistake_of("hat stops with IndexError (index 3) in line 4 of its cell: w[3]") == "stops with IndexError"


def test_the_same_wrong_answer_on_other_data_is_nearly_always_the_same_mistake():
    answers = [answer for answer in corpus.WRONG if answer.number in ("1.1", "1.2", "3.1", "3.2")]
    told = [[_told(answer, seed) for seed in (0, 1)] for answer in answers]
    assert len(answers) > 30
    assert sum(one != other for one, other in told) <= 0.03 * len(told)
    assert len({(answer.number, *one) for answer, (one, _) in zip(answers, told, strict=True)}) > 0.6 * len(told)


def _told(answer, seed):
    lines = check(answer.number, answer.function, seed=seed).lines
    return tuple(sorted({mistake_of(line.sentence) for line in lines if line.state == "wrong"}))


def test_a_mistake_counts_students_once_each_the_most_frequent_first_and_what_follows_from_it_not_at_all():
    said = {"a": ["x is 1.", "x is 2.", NOT_LOOKED_AT], "b": ["x is 3."], "c": ["y is 3."]}
    students = [
        StudentOutcome(who, "", [NotebookOutcome("n", "graded", [TodoOutcome("3.1", 0, 2, "wrong", sentences)])])
        for who, sentences in said.items()
    ]
    assert [(number, who) for number, _, who in mistakes(students)] == [("3.1", ["a", "b"]), ("3.1", ["c"])]


# The table for spreadsheets


def test_the_csv_read_back_holds_what_went_in(tmp_path):
    students = class_of(30)
    write_csv(tmp_path / "points.csv", students)
    assert (tmp_path / "points.csv").read_bytes().startswith(b"\xef\xbb\xbf")
    rows = rows_of(tmp_path / "points.csv")
    assert len(rows) == 30
    assert list(rows[0])[2:7] == ["1.1", "1.2", "1.10", "3.1", "3.3"]
    for row, one in zip(rows, students, strict=True):
        assert (row["student"], row["name"]) == (one.student, one.name)
        for book in one.notebooks:
            parts = [float(row[number]) for number in NUMBERS[book.name]]
            assert parts == [todo.points for todo in book.todos]
            mark = row[f"{book.name} answer-1"]
            assert mark == ("" if book.written[0].points is None else f"{book.written[0].points:g}")
            assert float(row[book.name]) == sum(parts) + float(mark or 0)
        assert float(row["total"]) == sum(float(row[book]) for book in NUMBERS)
        assert float(row["most"]) == 5 * 4 + 2 * 4
        assert float(row["percent"]) == pytest.approx(100 * float(row["total"]) / 28, abs=0.051)
        assert int(row["unmarked"]) == sum(row[f"{book} answer-1"] == "" for book in NUMBERS)
        assert row["flags"] == " | ".join(one.all_flags)
    assert {row["unmarked"] for row in rows} == {"0", "1", "2"}


def test_answers_are_called_by_their_id_alone_where_that_is_enough(tmp_path):
    write_csv(tmp_path / "t.csv", [StudentOutcome("s", "", [NotebookOutcome("n", "graded", [], [_answer(None)])])])
    (row,) = rows_of(tmp_path / "t.csv")
    assert row["answer-n"] == "" and row["unmarked"] == "1"


def _answer(points):
    return WrittenOutcome("answer-n", points, 4.0)


@pytest.mark.parametrize("start", list("=+-@\t\r\n"))
def test_no_cell_of_the_csv_begins_like_a_formula(tmp_path, start):
    bad = f"{start}HYPERLINK(1)"
    write_csv(tmp_path / "t.csv", [StudentOutcome(bad, bad, [NotebookOutcome("n", "graded")], [f"{start}x"])])
    (row,) = rows_of(tmp_path / "t.csv")
    assert row["student"] == row["name"] == f"'{bad}"
    assert not row["flags"].startswith(start)


def test_a_notebook_without_outcomes_neither_lowers_the_most_nor_fills_a_cell(tmp_path):
    full, bare = class_of(2, seed=3)
    bare.notebooks = [NotebookOutcome("01_load", "unreadable")]
    write_csv(tmp_path / "t.csv", [full, bare])
    rows = rows_of(tmp_path / "t.csv")
    assert {row["most"] for row in rows} == {"28"}
    assert rows[1]["1.1"] == rows[1]["03_crf"] == "" and rows[1]["total"] == "0"


# The report


def test_the_report_counts_what_the_outcomes_say(tmp_path):
    students = class_of(40, seed=1)
    page = Reader(report(tmp_path, students))
    states = Counter()
    for one in students:
        for book in one.notebooks:
            for part in book.todos:
                states[part.number, "absent" if book.kind == "missing" else part.state] += 1
    order = ("right", "partial", "wrong", "empty", "unasked", "absent")
    table = page.table("Students in each state")
    assert [row[0] for row in table] == ["1.1", "1.2", "1.10", "3.1", "3.3"]
    for number, *counts in table:
        assert [int(count) for count in counts] == [states[number, state] for state in order]
        assert sum(map(int, counts)) == 40
    for row, one in zip(page.table("Points of 28"), students, strict=True):
        assert (row[0], row[1]) == (one.student, one.name)
        assert float(row[4]) == one.points == sum(float(part.strip("*").replace("missing", "0")) for part in row[2:4])
        assert int(row[5] or 0) == len(one.all_flags)
    assert len(page.table("Flags")) == sum(len(one.all_flags) for one in students)


def test_the_first_paragraph_has_the_numbers_of_the_class(tmp_path):
    students = class_of(21, seed=2)
    lead = re.search(r'<p class="lead">(.*?)</p>', report(tmp_path, students))[1]
    points = sorted(one.points for one in students)
    books = [book for one in students for book in one.notebooks]
    missing = sum(book.kind == "missing" for book in books)
    waiting = sum(answer.points is None for book in books for answer in book.written)
    flagged = sum(len(one.all_flags) > 0 for one in students)
    hand = sum(part.by_hand for book in books for part in book.todos)
    assert lead == (
        f"21 students have a median of {points[10]:g} of 28 points; the middle half lies between {points[5]:g} and "
        f"{points[15]:g}. {missing} of 42 notebooks are missing, {waiting} answers wait for marks, and {flagged} "
        f"submissions have flags. {hand} marks were set by hand."
    )


def test_marks_set_by_hand_are_shown(tmp_path):
    students = class_of(2)
    for one in students:
        one.notebooks = [NotebookOutcome("n", "graded", [TodoOutcome("1.1", 1.5, 3.0, "partial", [], False)])]
    students[1].notebooks[0].todos[0].by_hand = True
    table = Reader(report(tmp_path, students)).table("Points of 3")
    assert [row[2] for row in table] == ["1.5", "1.5*"]


def test_the_slowest_notebooks_are_named(tmp_path):
    students = class_of(9)
    students[4].notebooks[1].seconds = 250.0
    page = Reader(report(tmp_path, students))
    assert page.table("The slowest")[0] == ["s004", "03_crf", "4.2 min"]
    assert len(page.table("The slowest")) == 5


@pytest.mark.parametrize("size", [1, 2, 30, 300])
def test_the_report_has_all_its_parts_in_order_whatever_the_size_of_the_class(tmp_path, size):
    text = report(tmp_path, class_of(size))
    page = Reader(text)
    assert len(re.findall(r"<h1>", text)) == 1
    assert re.findall(r"<h2>(.*?)</h2>", text) == [
        "Where the class is right, and where it is not",
        "The mistakes, by name",
        "How the points are spread",
        "How long grading took",
        "What needs a look",
        "All students",
    ]
    assert text.index('class="lead"') < text.index("<h2>")
    assert len(page.table("Points of")) == size
    assert len(text) < 1e6


def test_a_class_without_points_and_without_one_notebook_gets_its_report(tmp_path):
    students = class_of(5)
    for one in students:
        one.notebooks = [
            NotebookOutcome("01_load", "graded", [TodoOutcome("1.1", 0.0, 3.0, "empty")]),
            NotebookOutcome("02_align", "missing"),
        ]
    text = report(tmp_path, students)
    assert "No TODO is right for anybody" in text and "All 5 students have 0 of 3 points" in text
    assert "5 of 10 notebooks are missing" in text
    for one in students:
        one.notebooks = [NotebookOutcome("02_align", "missing")]
    assert "No notebook with a TODO was handed in." in report(tmp_path, students)


def test_an_empty_class_is_refused_with_a_sentence(tmp_path):
    for write in (lambda: report(tmp_path, []), lambda: write_csv(tmp_path / "t.csv", [])):
        with pytest.raises(ValueError, match=r"There are no students to report on; give .*\."):
            write()
    assert list(tmp_path.iterdir()) == []


def test_the_same_outcomes_make_the_same_bytes(tmp_path):
    assert report(tmp_path / "a", class_of(12)) == report(tmp_path / "b", class_of(12))
    assert report(tmp_path / "a", class_of(12)) != report(tmp_path / "b", class_of(12, seed=5))


# What holds for every page


def hostile():
    books = [
        NotebookOutcome(SCRIPT, "graded", [TodoOutcome("1.1", 0.0, 2.0, "wrong", [SCRIPT])], [], [SCRIPT]),
        NotebookOutcome("n", "stopped", [TodoOutcome("1.2", 0.0, 2.0, "unasked", [SCRIPT])], [_answer(None)], [SCRIPT]),
    ]
    return StudentOutcome("s<i>1", f"{SCRIPT}\udc80", books, [SCRIPT])


def pages_of(folder):
    students = [hostile()]
    links = {"s<i>1": 'x"><script>.html'}
    report(folder, students, title=SCRIPT, notes=[SCRIPT], links=links, names={"1.1": SCRIPT})
    write_student_pages(folder, students, {("s<i>1", "n"): 'y"><script>.html'})
    return [path.read_text(encoding="utf-8") for path in sorted(folder.rglob("*.html"))]


def test_nothing_from_students_becomes_markup(tmp_path):
    pages = pages_of(tmp_path)
    assert len(pages) == 2
    for text in pages:
        tags = {tag for tag, _ in Reader(text).tags}
        assert not tags & {"script", "i", "b"}
        assert text.count("&lt;script&gt;alert") >= 5


def test_a_page_loads_nothing_and_allows_nothing(tmp_path):
    for text in pages_of(tmp_path):
        policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
        assert f'<meta http-equiv="Content-Security-Policy" content="{policy}">' in text
        assert not re.search(r"https?:|@import|url\(", text)
        for tag, attributes in Reader(text).tags:
            assert tag not in ("script", "link", "iframe")
            assert not [name for name in attributes if name.startswith("on")]
            for name in {"src", "srcset"} & attributes.keys():
                assert attributes[name].startswith("data:image/svg+xml;base64,")
                assert b"<svg" in base64.b64decode(attributes[name].split(",")[1])


def test_a_page_can_be_read_by_a_screen_reader(tmp_path):
    for text in pages_of(tmp_path):
        page = Reader(text)
        assert '<html lang="en">' in text and re.search(r"<title>.+</title>", text)
        levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch("h[1-6]", tag)]
        assert levels[0] == 1 and levels.count(1) == 1
        assert all(after <= before + 1 for before, after in pairwise(levels))
        assert all(attributes.get("scope") in ("col", "row") for tag, attributes in page.tags if tag == "th")
        for tag, attributes in page.tags:
            if tag == "img":
                alt = attributes["alt"]
                assert alt[0].isupper() and alt.endswith(".") and len(alt.split()) >= 6


def test_a_figure_has_a_message_and_a_drawing_for_dark_pages(tmp_path):
    text = report(tmp_path, class_of(30))
    assert text.count("<figure>") == text.count('(prefers-color-scheme: dark)"') == 2
    for figure in re.findall(r"<figure>.*?</figure>", text):
        light, dark = re.findall(r"base64,([^\"]+)", figure)
        assert light != dark
        assert len(re.search(r"<figcaption>(.*?)</figcaption>", figure)[1].split()) >= 5


# The pages of students


def test_a_students_page_says_points_sentences_marks_and_where_comments_are(tmp_path):
    todos = [
        TodoOutcome("3.1", 1.0, 2.0, "partial", ["The ends have weight 1."], True),
        TodoOutcome("3.2", 2, 2, "right"),
    ]
    books = [
        NotebookOutcome("03_crf", "graded", todos, [_answer(None)], asides=["Same as s2."]),
        NotebookOutcome("04_merge", "missing", [TodoOutcome("4.1", 0.0, 6.0, "empty")]),
    ]
    students = [StudentOutcome("s1", "Zoë", books, ["Late."]), StudentOutcome("s2", "", [])]
    write_student_pages(tmp_path, students, {("s1", "03_crf"): "03_crf.html"})
    text = (tmp_path / "s1" / "index.html").read_text(encoding="utf-8")
    page = Reader(text)
    table = page.table("3 of 8 points in 03_crf")
    assert [row[:2] for row in table] == [["TODO 3.1", "1 of 2"], ["TODO 3.2", "2 of 2"], ["answer-n", "– of 4"]]
    assert "The ends have weight 1." in table[0][3] and "set by the instructor" in table[0][3]
    assert table[2][2] == "not marked yet"
    assert "3 of 14 points so far; 1 answer in words waits for marks." in page.text
    assert "This notebook was not handed in." in page.text
    assert [attributes["href"] for tag, attributes in page.tags if tag == "a"] == ["03_crf.html"]
    assert "s2" not in page.text and "Late." not in page.text
    assert (tmp_path / "s2" / "index.html").is_file()


def test_a_student_reads_the_flags_that_are_meant_for_students_only(tmp_path):
    book = NotebookOutcome("n", "graded", flags=["A cell was put back."], asides=["Pasted?"])
    write_student_pages(tmp_path, [StudentOutcome("s1", "", [book], ["Like s2's."])], {})
    text = (tmp_path / "s1" / "index.html").read_text(encoding="utf-8")
    assert "A cell was put back." in text and "s2" not in text and "Pasted?" not in text


@pytest.mark.parametrize("name", ["", "..", "../x", "a/b", "a\\b", "C:x"])
def test_a_student_whose_page_would_leave_the_folder_is_refused(tmp_path, name):
    with pytest.raises(ValueError, match="can't have a folder of that name"):
        write_student_pages(tmp_path / "pages", [StudentOutcome("s1", "", []), StudentOutcome(name, "", [])], {})
    assert list(tmp_path.iterdir()) == []
