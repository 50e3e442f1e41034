"""A graded notebook that can be looked at: instructors open it in a browser, in which a student's page must not act.

nbgrader's feedback and formgrader put HTML from outputs and from text cells into their pages as it is, beside the
instructor's own session. So the graded copy keeps text and pictures alone; what was handed in stays as it was.
"""

import re
from html import escape

from nbformat import from_dict

SHOWN = ("text/plain", "image/png", "image/jpeg")
PICTURE = re.compile(r"[A-Za-z0-9+/=\s]*")  # base64
# Where a browser would see a tag begin; those of the course's own folded pictures may stay.
TAG = re.compile(r"<(?!/?(?:details|summary)>)(?=[A-Za-z/!?])")
# The address of a link, inline or in a list of references, unless it is plainly one of a page, a picture or a place.
ADDRESS = re.compile(r"(\]\(\s*|^\s*\[[^\]]*\]:\s*)(?!https?://|mailto:|attachment:|#|[\w./-]+[)#\s])[^)\s]*", re.M)


def harmless(cell) -> None:
    """Take out of a cell of a graded notebook, in place, what a browser would act on."""
    cell.metadata = from_dict({key: part for key, part in cell.metadata.items() if key == "nbgrader"})
    if cell.cell_type != "code":
        cell.source = ADDRESS.sub(r"\1#", TAG.sub("&lt;", cell.source))
        if "attachments" in cell:
            cell.attachments = from_dict({name: _pictures(data) for name, data in cell.attachments.items()})
        return
    outputs = []
    for output in cell.outputs:
        if output.output_type in ("display_data", "execute_result"):
            alts = {kind: facts.get("alt") for kind, facts in output.metadata.items() if isinstance(facts, dict)}
            output.data = from_dict(_pictures(output.data) or {"text/plain": "(left out of the graded copy)"})
            output.metadata = from_dict({k: {"alt": escape(str(alts[k]))} for k in output.data if alts.get(k)})
        if output.output_type in ("display_data", "execute_result", "stream", "error"):
            outputs.append(output)
    cell.outputs = outputs


def _pictures(data: dict) -> dict:
    """Text, and pictures that are nothing but pictures."""
    kept = {}
    for kind in SHOWN:
        content = data.get(kind)
        content = "".join(content) if isinstance(content, list) else content
        if isinstance(content, str) and (kind == "text/plain" or PICTURE.fullmatch(content)):
            kept[kind] = content
    return kept
