"""Pages of HTML that need nothing but themselves: what they are made of, and the page that one student gets.

A page has no script and loads nothing, follows the reader's light or dark, and prints. Text is escaped wherever it
enters a page, unless it is Html: names, flags and sentences come from students.
"""

import re
from html import escape
from pathlib import Path

from hdr_helpers.merge import write_whole

KINDS = {
    "missing": "This notebook was not handed in.",
    "unreadable": "What was handed in could not be read as a notebook.",
    "stopped": "The notebook stopped before its end; it was graded as far as it ran.",
}
STATES = {
    "right": "✓ right",
    "partial": "◐ right in part",
    "wrong": "✗ wrong",
    "empty": "– not started",
    "unasked": "? could not be checked",
}
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
STYLE = """
:root { color-scheme: light dark; --ink: #222; --soft: #5c5c5c; --line: #d9d9d9; --paper: #fff; --band: #f5f5f3;
  --link: #005a8d; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e4e4; --soft: #a6a6a6; --line: #3c3f43; --paper: #17191c; --band: #202327; --link: #7cc4ef; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 2.5rem 1.5rem 4rem; max-width: 63rem; color: var(--ink); background: var(--paper);
  font: 1rem/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 1rem; }
h2 { font-size: 1.3rem; line-height: 1.3; margin: 3rem 0 .6rem; }
h3 { font-size: 1.05rem; margin: 1.8rem 0 .4rem; }
p, ul { margin: .5rem 0; max-width: 46rem; }
.lead { font-size: 1.15rem; }
.soft, caption { color: var(--soft); }
a { color: var(--link); }
figure { margin: 1rem 0; }
figcaption { font-weight: 600; margin-bottom: .5rem; }
img { display: block; width: 100%; height: auto; }
.wide { overflow-x: auto; margin: .6rem 0 1.6rem; }
table { border-collapse: collapse; width: 100%; font-size: .94rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; padding-bottom: .3rem; }
th, td { text-align: left; vertical-align: top; padding: .38rem 1.1rem .38rem 0; border-bottom: 1px solid var(--line); }
th:last-child, td:last-child { padding-right: 0; }
thead th { font-weight: 600; color: var(--soft); border-bottom-width: 2px; }
tbody th { font-weight: 600; white-space: nowrap; }
.number { text-align: right; white-space: nowrap; width: 1%; }
.beside { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(24rem, 100%), 1fr)); gap: 0 3rem; }
.who { width: 10.5rem; min-width: 8rem; }
.state { width: 11rem; padding-left: 1rem; }
.said { min-width: 18rem; overflow-wrap: anywhere; }
.state + .said { width: 60%; }
td ul { margin: 0; padding-left: 1.1rem; }
summary { cursor: pointer; color: var(--link); }
@media print {
  body { max-width: none; padding: 0; font-size: 10pt; }
  h2, h3, figcaption { break-after: avoid; }
  figure, tr { break-inside: avoid; }
  thead { display: table-header-group; }
  ::details-content { content-visibility: visible; block-size: auto; } }
"""


class Html(str):
    """Text that is HTML already."""


def html(value) -> Html:
    """A value as HTML: points without needless zeros, nothing for None, any other text escaped."""
    if isinstance(value, Html):
        return value
    if isinstance(value, float):
        value = f"{round(value, 2):.10g}"
    return Html("" if value is None else escape(str(value)))


def element(tag: str, *parts, **attributes) -> Html:
    """<tag attributes>parts</tag>; class is given as kind, for Python keeps that word to itself."""
    names = {"kind": "class"}
    given = "".join(f' {names.get(name, name)}="{escape(str(value))}"' for name, value in attributes.items())
    return Html(f"<{tag}{given}>{''.join(map(html, parts))}</{tag}>")


def table(caption: str, columns: dict[str, str], rows) -> Html:
    """A table whose first column names the row.

    columns : from the name of a column to the class of its cells: number, said, who, state, or empty
    rows : a sequence of cells each
    """

    def cell(tag, kind, value, **attributes):
        return element(tag, value, **attributes, **({"kind": kind} if kind else {}))

    head = [cell("th", kind, name, scope="col") for name, kind in columns.items()]
    body = []
    for first, *others in rows:
        cells = [cell("td", kind, value) for kind, value in zip(list(columns.values())[1:], others, strict=True)]
        body.append(element("tr", element("th", first, scope="row"), *cells))
    parts = element("caption", caption), element("thead", element("tr", *head)), element("tbody", *body)
    return element("div", element("table", *parts), kind="wide", role="region", tabindex="0", **{"aria-label": caption})


def listed(sentences) -> Html:
    return element("ul", *(element("li", sentence) for sentence in sentences)) if sentences else Html()


def folded(summary: str, *parts) -> Html:
    """Parts that show when the reader asks for them."""
    return element("details", element("summary", summary), *parts)


def gathered(ids: list[str]) -> Html:
    """Two ids as they are, more of them folded."""
    return html(", ".join(ids)) if len(ids) <= 2 else folded("who", ", ".join(ids))


def many(count: int, one: str, several: str = "") -> str:
    """No students, 1 student, 2 students. several : where it is not one with an s"""
    return f"{count or 'No'} {one if count == 1 else several or one + 's'}"


def duration(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds < 100 else f"{seconds / 60:.1f} min"


def link(text: str, address: str) -> Html:
    return element("a", text, href=address)


def picture(message: str, alt: str, light: str, dark: str) -> Html:
    """A figure under its message. light, dark : data addresses of the image for either kind of page"""
    source = f'<source media="(prefers-color-scheme: dark)" srcset="{dark}">'
    image = Html(f'<picture>{source}<img src="{light}" alt="{escape(alt)}"></picture>')
    return element("figure", element("figcaption", message), image)


def page(title: str, *body) -> bytes:
    """A whole page in English; title is its heading too."""
    head = (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"{element('title', title)}\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n"
    )
    content = "\n".join(map(html, (element("h1", title), *body)))
    # A name that came from a file system may hold halves of characters, which UTF-8 can't.
    return f"{head}{content}\n</main>\n</body>\n</html>\n".encode("utf-8", "replace")


def notebook_points(notebook) -> float:
    """Of TODOs and of answers that are marked."""
    return sum(todo.points for todo in notebook.todos) + sum(answer.points or 0 for answer in notebook.written)


def write_student_pages(folder, students, pages: dict[tuple[str, str], str]) -> None:
    """Write folder/STUDENT/index.html for each StudentOutcome: points, and a sentence for each part that is wrong.

    pages : from (student, name of a notebook) to the relative address of nbgrader's feedback on it, where there is one
    Raises ValueError where a student's id can't be the name of a folder.
    """
    for student in students:
        if student.student in ("", ".", "..") or any(sign in student.student for sign in "/\\:\0"):
            raise ValueError(
                f"The student {student.student!r} can't have a folder of that name; use letters and digits."
            )
    for student in students:
        place = Path(folder) / student.student / "index.html"
        place.parent.mkdir(parents=True, exist_ok=True)
        write_whole(place, _student_page(student, pages))


def _student_page(student, pages) -> bytes:
    waiting = student.unmarked
    so_far = f" so far; {many(waiting, 'answer in words waits', 'answers in words wait')} for marks"
    body = [
        element(
            "p", float(student.points), " of ", float(student.most), f" points{so_far if waiting else ''}.", kind="lead"
        )
    ]
    for notebook in student.notebooks:
        body.append(element("h2", notebook.name))
        body.append(listed(notebook.flags))
        if notebook.kind in KINDS:
            body.append(element("p", KINDS[notebook.kind]))
        if (student.student, notebook.name) in pages:
            address = pages[student.student, notebook.name]
            body.append(element("p", link(f"Your notebook {notebook.name} with comments", address)))
        rows = [*map(_todo_row, notebook.todos), *map(_written_row, notebook.written)]
        looked_at = notebook.kind not in ("missing", "unreadable")
        if rows and (looked_at or any(part.points for part in (*notebook.todos, *notebook.written))):
            most = sum(part.most for part in (*notebook.todos, *notebook.written))
            caption = f"{html(float(notebook_points(notebook)))} of {html(float(most))} points in {notebook.name}"
            body.append(table(caption, COLUMNS, rows))
    name = f"{student.name} ({student.student})" if student.name else student.student
    return page(f"Feedback for {name}", *body)


COLUMNS = {"Part": "", "Points": "number", "State": "state", "What the check says": "said"}


def _todo_row(todo) -> tuple:
    by_hand = [element("p", "The points were set by the instructor.")] if todo.by_hand else []
    said = Html("".join([listed(list(dict.fromkeys(todo.said))), *by_hand]))
    return f"TODO {todo.number}", f"{html(todo.points)} of {html(todo.most)}", STATES[todo.state], said


def _written_row(answer) -> tuple:
    points = "–" if answer.points is None else html(answer.points)
    state = ("not marked yet" if answer.points is None else "marked") if answer.answered else "– not answered"
    return question(answer.grade_id), f"{points} of {html(answer.most)}", state, ""


def question(grade_id: str) -> str:
    """ "Question 1.2" for answer-1-2; other names as they are."""
    found = re.fullmatch(r"answer-(\d+)-(\d+)", grade_id)
    return f"Question {found[1]}.{found[2]}" if found else grade_id
