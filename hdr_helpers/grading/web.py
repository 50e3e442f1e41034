"""The course as static pages, to be read before anything is installed: nbconvert's pages without the solutions.

Nothing is fetched from elsewhere: equations become MathML, pictures are inside, and there is no script.
"""

import html
import json
import re
from pathlib import Path

from hdr_helpers.grading.course import ROOT, InstructorError, source_notebooks
from hdr_helpers.grading.release import STUB, WRITTEN_STUB
from hdr_helpers.grading.solutions import BEGIN, END, is_todo, is_written, read_notebook
from hdr_helpers.merge import write_whole

TEMPLATE = """{% extends "lab/index.html.j2" %}
{% block html_head_js %}{% endblock %}
{% block jupyter_widgets %}{% endblock %}
{% block html_head_js_mathjax %}{% endblock %}
{% block html_head_js_mermaidjs %}{% endblock %}
{% block extra_css %}<style>
main { max-width: 60rem; margin: 0 auto; }
nav.course { padding: 0.5rem; font-family: sans-serif; }
nav.course a[aria-current] { font-weight: bold; }
math { font-size: 1.1em; }
.jp-RenderedImage img { max-width: 100%; height: auto; }
</style>{% endblock %}
{% block body_header %}{{ super() }}
<nav class="course" aria-label="The course">{{ nb.metadata.course_links }}</nav>{% endblock %}
{% macro figure(output, kind) %}<div class="jp-RenderedImage jp-OutputArea-output">
<img src="data:{{ kind }};base64,{{ output.data[kind] | escape_html }}"
alt="{{ output | get_metadata('alt', kind) | escape_html }}"></div>{% endmacro %}
{% block data_png scoped %}{{ figure(output, "image/png") }}{% endblock %}
{% block data_jpg scoped %}{{ figure(output, "image/jpeg") }}{% endblock %}
"""
WIDGET = "application/vnd.jupyter.widget-view+json"
SLIDERS = "Here sliders stand in JupyterLab; the figure below shows the same without them."
MATH = re.compile(r"(?P<code>```.*?```|`[^`\n]*`)|\$\$.+?\$\$|\$[^\s$](?:[^$\n]*[^\s$\\])?\$", re.S)


def write_pages(out, root=ROOT) -> list[Path]:
    """Write index.html and a page for each notebook to the folder out. Returns their paths.

    Raises InstructorError where out holds something else, or the extra "pages" is not installed.
    """
    root, out = Path(root), Path(out).resolve()
    if out.exists() and any(path.suffix != ".html" for path in out.iterdir()):
        raise InstructorError(f"{out} is there and holds other things than pages; give another folder with -o.")
    notebooks = source_notebooks(root)
    titles = {"index": "The course"} | {path.stem: title_of(read_notebook(path)) for path in notebooks}
    pages = {"index": _page(_of_readme(root), "index", titles, root)}
    for path in notebooks:
        pages[path.stem] = _page(to_be_read(read_notebook(path)), path.stem, titles, path.parent)
    out.mkdir(parents=True, exist_ok=True)
    for name, page in pages.items():
        write_whole(out / f"{name}.html", page.encode("utf-8"))
    return [out / f"{name}.html" for name in pages]


def title_of(notebook: dict) -> str:
    """The first heading of a notebook."""
    return re.search(r"^# (.+)$", notebook["cells"][0]["source"], re.M)[1]


def to_be_read(notebook: dict) -> dict:
    """A notebook without solutions, model answers and sliders, with its outputs."""
    cells = []
    for cell in notebook["cells"]:
        cell = dict(cell)
        if is_todo(cell):
            cell["source"] = re.sub(
                rf" *{BEGIN}.*?{END}", f"    # YOUR CODE HERE\n    {STUB}", cell["source"], flags=re.S
            )
        elif is_written(cell):
            cell["source"] = f"*{WRITTEN_STUB.capitalize()}.*"
        if cell["cell_type"] == "code":
            cell["outputs"] = [_without_widgets(output) for output in cell["outputs"]]
        cells.append(cell)
    return notebook | {"cells": cells, "metadata": {k: v for k, v in notebook["metadata"].items() if k != "widgets"}}


def _without_widgets(output: dict) -> dict:
    if WIDGET not in output.get("data", {}):
        return output
    return output | {"data": {"text/html": f"<p><em>{SLIDERS}</em></p>"}, "metadata": {}}


def _of_readme(root: Path) -> dict:
    text = (root / "README.md").read_text(encoding="utf-8").replace("](notebooks/", "](")
    cell = {"cell_type": "markdown", "id": "readme", "metadata": {}, "source": text}
    return {"cells": [cell], "metadata": {}, "nbformat": 4, "nbformat_minor": 5}


def _page(notebook: dict, name: str, titles: dict, folder: Path) -> str:
    try:
        import nbformat
        from nbconvert import HTMLExporter
        from traitlets.config import Config
    except ImportError as problem:
        raise InstructorError(f"The pages need nbconvert ({problem}), which comes with environment.txt.") from None
    equations = []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "markdown":
            source = re.sub(r"\]\(([\w./-]+)\.ipynb(#[^)]*)?\)", _to_page, cell["source"])
            cell["source"] = without_equations(source, equations)
    links = [
        f'<a href="{other}.html"{" aria-current=page" if other == name else ""}>{html.escape(title)}</a>'
        for other, title in titles.items()
    ]
    node = nbformat.reads(json.dumps(notebook), as_version=4)  # which puts the lines of outputs together
    node.metadata.update(title=titles[name], course_links=" · ".join(links))
    exporter = HTMLExporter(config=Config(), embed_images=True)
    exporter.raw_template = TEMPLATE
    page, _ = exporter.from_notebook_node(node, {"metadata": {"path": str(folder), "name": titles[name]}})
    return with_equations(page, equations)


def _to_page(link) -> str:
    return f"]({Path(link[1]).name}.html{link[2] or ''})"


def without_equations(text: str, equations: list[str]) -> str:
    """Markdown with a word in the place of each equation, which is added to equations; code is left as it is."""

    def word(found):
        if found["code"] is not None:
            return found[0]
        equations.append(found[0])
        return f"equation{len(equations) - 1}here"

    return MATH.sub(word, text)


def with_equations(page: str, equations: list[str]) -> str:
    """A page with its equations as MathML, which browsers show by themselves, in the place of the words.

    They are put in last, because nbconvert does not keep MathML whole. Raises InstructorError where the converter is
    not installed.
    """
    try:
        from latex2mathml.converter import convert
    except ImportError as problem:
        raise InstructorError(
            f'The pages need latex2mathml ({problem}); install the extra "pages" in the course folder: '
            'python -m pip install -e ".[pages]"'
        ) from None

    def equation(found):
        text = equations[int(found[1])]
        plain = text.strip("$").strip().replace(r"\{", r"\lbrace ").replace(r"\}", r"\rbrace ")
        return convert(plain, display="block" if text.startswith("$$") else "inline")

    return re.sub(r"equation(\d+)here", equation, page)
