"""What instructors open in a browser after grading: nothing that a student has written acts there."""

import json
from html.parser import HTMLParser
from importlib.util import find_spec

import pytest
from short_course import Student, short_course

if find_spec("nbgrader") is None:
    pytest.skip("nbgrader is not installed: the instructor extra", allow_module_level=True)

from hdr_helpers.grading._running.sandbox import bubblewrap
from hdr_helpers.grading.grade import Options, grade

SHOWN = r"""
from IPython.display import HTML, Javascript, SVG, Image, display
display(HTML("<script>evil(1)</script><b onclick='evil(2)'>bold</b>"), Javascript("evil(3)"))
display(SVG("<svg xmlns='http://www.w3.org/2000/svg' onload='evil(4)'><rect/></svg>"))
display({"image/png": 'AAAA" onerror="evil(5)', "text/plain": "<script>evil(6)</script>"}, raw=True)
display({"image/png": "iVBORw0KGgo="}, raw=True, metadata={"image/png": {"alt": '" onerror="evil(7)'}})
display({"text/markdown": "<img src=x onerror=evil(8)>"}, raw=True)
print("<script>evil(9)</script>")
raise ValueError("<script>evil(10)</script>")
"""
WRITTEN = """a < b, $x<y$ <img src=x onerror=evil(11)> <script>evil(12)</script> <javascript:evil(13)>
[one](javascript:evil(16)) [two](java&#115;cript:evil(17)) [three]( JavaScript:evil(18)) [four][ref] ![five](data:evil)
[good](https://example.org/a?b=1) [next](04_merge.ipynb)

[ref]: javascript:evil(19)
"""


class Acting(HTMLParser):
    """Gathers what a browser would act on: scripts, handlers, frames, addresses that are programs."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.found += [tag] * (tag in ("iframe", "object", "embed", "form"))
        self.found += [name for name, value in attributes if name.startswith("on") or "javascript:" in (value or "")]

    def handle_data(self, data):
        if self.cdata_elem == "script" and "evil" in data:
            self.found.append(data)


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("class")
    sources = short_course(folder / "course")[:1]
    student = Student(sources).insert("todo-3-1", SHOWN)
    student.cell("answer-3-1")["source"] = WRITTEN
    student.cell("todo-3-2")["metadata"]["tags"] = ['"><script>evil(14)</script>']
    cells = student.notebooks["03_crf"]["cells"]
    cells.append(
        {
            "cell_type": "raw",
            "id": "raw",
            "metadata": {"raw_mimetype": "text/html"},
            "source": "<script>evil(15)</script>",
        }
    )
    cells.append(
        {
            "cell_type": "markdown",
            "id": "folded",
            "metadata": {},
            "source": "<details><summary>More</summary>\n\nhere</details>",
        }
    )
    student.hand_in(folder / "in" / "eve")
    options = Options(sandboxed=bubblewrap() is not None)
    grade(folder / "in", folder / "out", options, lambda sentence: None, sources)
    return folder / "out"


def test_nbgraders_feedback_shows_what_a_student_wrote_and_runs_none_of_it(pages):
    text = (pages / "feedback" / "eve" / "03_crf" / "03_crf.html").read_text(encoding="utf-8")
    assert Acting(text).found == []
    assert "evil(9)" in text and "evil(11)" in text and "a &lt; b" in text  # it is there, as text


def test_the_copy_that_formgrader_shows_holds_text_and_pictures_alone(pages):
    notebook = json.loads((pages / "autograded" / "eve" / "03_crf" / "03_crf.ipynb").read_text(encoding="utf-8"))
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", ()) if "data" in output]
    tables = [output for output in outputs if "text/html" in output["data"]]
    assert len(tables) == 6 and all("TODO 3." in "".join(table["data"]["text/html"]) for table in tables)
    assert {kind for output in outputs for kind in output["data"]} == {"text/plain", "text/html", "image/png"}
    assert not [cell for cell in notebook["cells"] if "raw_mimetype" in cell["metadata"]]
    answer = next(cell for cell in notebook["cells"] if cell["id"] == "answer-3-1")
    assert "](https://example.org/a?b=1)" in "".join(answer["source"]) and "](04_merge.ipynb)" in "".join(
        answer["source"]
    )


def test_what_was_handed_in_stays_as_it_was(pages):
    assert "evil(12)" in (pages / "submitted" / "eve" / "03_crf" / "03_crf.ipynb").read_text(encoding="utf-8")


def test_the_detector_of_these_tests_finds_each_kind():
    for text in (
        '<img onerror="evil(1)">',
        "<script>evil(1)</script>",
        "<iframe></iframe>",
        '<a href="javascript:evil(1)">x</a>',
    ):
        assert Acting(text).found
