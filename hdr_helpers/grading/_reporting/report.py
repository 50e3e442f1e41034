"""What an instructor reads after grading: a table for spreadsheets, and a report of the class.

The report says which TODO the class failed and why: the sentences of the checks, gathered by the mistake they name.
"""

import csv
import io
import re
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

from hdr_helpers.grading._reporting.charts import LOOKS, states, todos_chart, totals_chart
from hdr_helpers.grading._reporting.pages import (
    KINDS,
    Html,
    duration,
    element,
    folded,
    gathered,
    html,
    link,
    listed,
    many,
    notebook_points,
    page,
    picture,
    table,
)
from hdr_helpers.grading._reporting.pages import write_student_pages as write_student_pages
from hdr_helpers.grading.outcome import StudentOutcome
from hdr_helpers.lab.checks._todos import NOT_LOOKED_AT
from hdr_helpers.merge import write_whole

FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")  # may start a formula
MANY = 12  # mistakes; beyond, those that a single student made are folded
SLOWEST = 5
SLOW_COLUMNS = {"Student": "", "Notebook": "", "Took": "number"}
DOER = r"^\S+ (?=stops with |calls |changes the arrays |was stopped|ended with )"  # the name of the student's function


def mistake_of(sentence: str) -> str:
    """What sentences that name one mistake have in common.

    Numbers, quoted text, names of files and of the student's function differ from student to student; an exception
    counts by its type alone, whatever it says and wherever it comes from.
    """
    sentence = re.sub(DOER, "", " ".join(sentence.split()))
    stops = re.match(r"stops with \w+|What it returns could not be looked at \(\w+", sentence)
    if stops:
        return stops[0].replace("(", "with ")
    sentence = re.sub(r"""`[^`]*`|"[^"]*"|(?<!\w)'[^']*'(?!\w)""", "'…'", sentence)
    sentence = re.sub(r"^.+?(?= came out )|\S+\.(?:jpe?g|png|tiff?)\b", "…", sentence, flags=re.I)
    # A digit after a letter belongs to a name: uint8, log10, float64.
    sentence = re.sub(r"(?<![A-Za-z0-9_])[-+−]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|\b(?:nan|inf)\b", "#", sentence)
    return re.sub(r"([(\[])#[#, ]*([)\]])", r"\1#\2", sentence)  # shapes and places, however many axes


class _Class:
    """What holds for all students of a class.

    notebooks : names; todos : from number to most points; written : from (notebook, grade_id) to most points
    """

    def __init__(self, students: list[StudentOutcome]):
        if not students:
            raise ValueError("There are no students to report on; give the outcome of at least one.")
        self.students = students
        every = [notebook for student in students for notebook in student.notebooks]
        self.notebooks = sorted({notebook.name for notebook in every})
        todos = [todo for notebook in every for todo in notebook.todos]
        numbers = sorted({todo.number for todo in todos}, key=lambda number: [int(n) for n in number.split(".")])
        self.todos = {number: max(todo.most for todo in todos if todo.number == number) for number in numbers}
        self.written = {}
        for notebook in sorted(every, key=lambda notebook: notebook.name):
            for answer in notebook.written:
                self.written.setdefault((notebook.name, answer.grade_id), answer.most)
        self.most = sum(self.todos.values()) + sum(self.written.values())


def write_csv(path, students: list[StudentOutcome]) -> None:
    """Write a table with a row for each student, UTF-8 with the mark by which Excel knows it.

    Columns: student, name, each TODO, each answer in words, each notebook, total, most, percent, unmarked, flags.
    A cell is empty where there is nothing to count yet. Text that a spreadsheet would run is led by an apostrophe.
    Raises ValueError where there are no students.
    """
    group = _Class(students)
    ids = Counter(grade_id for _, grade_id in group.written)
    answers = {key: key[1] if ids[key[1]] == 1 else " ".join(key) for key in group.written}
    rows = [["student", "name", *group.todos, *answers.values(), *group.notebooks]]
    rows[0] += ["total", "most", "percent", "unmarked", "flags"]
    for student in students:
        todos = {todo.number: todo.points for todo in student.todos}
        written = {(book.name, answer.grade_id): answer.points for book in student.notebooks for answer in book.written}
        books = {book.name: notebook_points(book) for book in student.notebooks}
        found = [todos.get(k) for k in group.todos] + [written.get(k) for k in answers]
        found += [books.get(k) for k in group.notebooks] + [student.points, group.most]
        percent = round(100 * student.points / group.most, 1) if group.most else None
        flags = " | ".join(" ".join(flag.split()) for flag in student.all_flags)
        rows.append([student.student, student.name, *found, percent, student.unmarked, flags])
    text = io.StringIO(newline="")
    csv.writer(text).writerows([[_cell(value) for value in row] for row in rows])
    write_whole(path, text.getvalue().encode("utf-8-sig", "replace"))


def _cell(value):
    if isinstance(value, float):
        return f"{round(value, 4):.10g}"
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA) else value


def write_report(folder, students, *, title: str, notes: list[str], links: dict[str, str], names=None) -> Path:
    """Write folder/report.html, which needs no other file, and return its path.

    notes : sentences for the top; links : from a student to the relative address of the student's page
    names : from the number of a TODO to the name of its function, where it is to be shown
    Raises ValueError where there are no students.
    """
    group = _Class(students)
    body = [*_summary(group, notes), *_todos(group, names or {}), *_mistakes(group), *_totals(group), *_times(group)]
    Path(folder).mkdir(parents=True, exist_ok=True)
    path = Path(folder) / "report.html"
    write_whole(path, page(title, *body, *_to_look_at(group), *_students(group, links)))
    return path


def _summary(group, notes) -> list:
    points = [student.points for student in group.students]
    low, median, high = (html(float(part)) for part in np.percentile(points, (25, 50, 75)))
    books = [book for student in group.students for book in student.notebooks]
    missing = sum(len(group.notebooks) - len(student.notebooks) for student in group.students)
    missing += sum(book.kind == "missing" for book in books)
    waiting = sum(student.unmarked for student in group.students)
    flagged = sum(bool(student.all_flags) for student in group.students)
    hand = sum(todo.by_hand for student in group.students for todo in student.todos)
    reached = f"{median} of {html(float(group.most))} points"
    if len(points) == 1:
        said = f"1 student has {reached}. "
    else:
        said = f"{len(points)} students have a median of {reached}; the middle half lies between {low} and {high}. "
    books_said = many(len(group.notebooks) * len(points), "notebook")
    said += f"{missing or 'None'} of {books_said} {'is' if missing == 1 else 'are'} missing, "
    said += f"{many(waiting, 'answer waits', 'answers wait').lower()} for marks, and "
    said += f"{many(flagged, 'submission has', 'submissions have').lower()} flags."
    said += f" {many(hand, 'mark was', 'marks were')} set by hand." if hand else ""
    return [element("p", said, kind="lead"), listed(notes)]


def _todos(group, names) -> list:
    heading = element("h2", "Where the class is right, and where it is not")
    found = states(group.students, group.todos)
    counts = {f"{number} {names.get(number, '')}".strip(): row for number, row in found.items()}
    if not counts:
        return [heading, element("p", "No notebook with a TODO was handed in.")]
    columns = {"TODO": ""} | {label: "number" for _, _, label in LOOKS.values()}
    rows = [(name, *(row[state] for state in LOOKS)) for name, row in counts.items()]
    figure = picture(*todos_chart(counts, len(group.students)))
    return [heading, figure, folded("The same in numbers", table("Students in each state", columns, rows))]


def mistakes(students) -> list[tuple[str, str, list[str]]]:
    """(TODO, sentence, ids of the students) of each mistake, the most frequent first. The sentence is an example."""
    sentences, who = defaultdict(Counter), defaultdict(dict)
    for student in students:
        for todo in student.todos:
            for sentence in todo.said if todo.state in ("partial", "wrong") else ():
                if sentence != NOT_LOOKED_AT:  # no mistake of its own
                    key = todo.number, mistake_of(sentence)
                    sentences[key][sentence] += 1
                    who[key][student.student] = True
    order = sorted(who, key=lambda key: (-len(who[key]), [int(n) for n in key[0].split(".")], key[1]))
    return [(key[0], sentences[key].most_common(1)[0][0], list(who[key])) for key in order]


def _mistakes(group) -> list:
    found = mistakes(group.students)
    heading = element("h2", "The mistakes, by name")
    caption = "Most frequent first; of each mistake, one sentence as an example"
    if not found:
        return [heading, element("p", "The checks found no mistake in what was handed in.")]
    several = [mistake for mistake in found if len(mistake[2]) > 1]
    if not several or len(several) == len(found) or len(found) <= MANY:
        return [heading, _mistake_table(caption, found)]
    single = _mistake_table("Mistakes of one student each", found[len(several) :])
    summary = many(len(found) - len(several), "mistake that one student made", "mistakes that one student each made")
    return [heading, _mistake_table(caption, several), folded(summary, single)]


def _mistake_table(caption, found) -> Html:
    columns = {"TODO": "", "Students": "number", "What the check says": "said", "Who": "who"}
    return table(caption, columns, [(number, len(who), said, gathered(who)) for number, said, who in found])


def _totals(group) -> list:
    waiting = sum(student.unmarked for student in group.students)
    chart = totals_chart([student.points for student in group.students], group.most, waiting)
    return [element("h2", "How the points are spread"), picture(*chart)]


def _times(group) -> list:
    took = [(book.seconds, book.name, s.student) for s in group.students for book in s.notebooks if book.seconds > 0]
    heading, rows = element("h2", "How long grading took"), []
    if not took:
        return [heading, element("p", "No times were taken.")]
    for name in group.notebooks:
        times = [time for time, book, _ in took if book == name]
        spread = (duration(np.median(times)), duration(max(times))) if times else ("–", "–")
        rows.append((name, len(times), *spread))
    columns = {"Notebook": "", "Graded": "number", "Median": "number", "Longest": "number"}
    slow = sorted(took, key=lambda entry: (-entry[0], entry[1:]))[:SLOWEST]
    slowest = [(student, name, duration(time)) for time, name, student in slow]
    both = table("Each notebook", columns, rows), table("The slowest", SLOW_COLUMNS, slowest)
    return [heading, element("div", *both, kind="beside")]


def _to_look_at(group) -> list:
    body, of_kind, unasked = [element("h2", "What needs a look")], defaultdict(list), defaultdict(list)
    for student in group.students:
        books = {book.name: book for book in student.notebooks}
        for name in group.notebooks:
            of_kind[name, books[name].kind if name in books else "missing"].append(student.student)
        for book in student.notebooks:
            for todo in book.todos if book.kind in ("graded", "stopped") else ():
                if todo.state == "unasked":
                    unasked[todo.number, " ".join(todo.said)].append(student.student)
    flags = [(student.student, flag) for student in group.students for flag in student.all_flags]
    if flags:
        body.append(table("Flags", {"Student": "", "Flag": "said"}, flags))
    rows = [(name, kind, len(who), gathered(who)) for (name, kind), who in sorted(of_kind.items()) if kind in KINDS]
    if rows:
        columns = {"Notebook": "", "It is": "", "Students": "number", "Who": "who"}
        body.append(table("Notebooks that were not graded, or not to their end", columns, rows))
    if unasked:
        rows = [(number, said, len(who), gathered(who)) for (number, said), who in sorted(unasked.items())]
        columns = {"TODO": "", "Why": "said", "Students": "number", "Who": "who"}
        body.append(table("Checks that could not be run", columns, rows))
    return body if body[1:] else [*body, element("p", "Nothing: every notebook is there and was graded to its end.")]


def _students(group, links) -> list:
    columns = {"Student": "", "Name": ""} | dict.fromkeys((*group.notebooks, "Total", "Flags"), "number")
    rows = []
    for student in group.students:
        books = {book.name: book for book in student.notebooks}
        cells = [_points_cell(books.get(name)) for name in group.notebooks]
        number = student.student
        first = link(number, links[number]) if number in links else number
        rows.append((first, student.name, *cells, float(student.points), len(student.all_flags) or ""))
    caption = f"Points of {html(float(group.most))}{'; the id leads to the page of the student' if links else ''}"
    if any(todo.by_hand for student in group.students for todo in student.todos):
        caption += "; with *, a mark was set by hand"
    return [element("h2", "All students"), table(caption, columns, rows)]


def _points_cell(book):
    if book is None or (book.kind in ("missing", "unreadable") and not notebook_points(book)):
        return element("span", book.kind if book else "missing", kind="soft")
    return html(float(notebook_points(book))) + "*" * any(todo.by_hand for todo in book.todos)
