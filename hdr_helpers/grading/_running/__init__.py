"""Rooms behind grade: running what was handed in, each notebook in a kernel of its own, and looking at it."""

import sys

# jsonschema, which nbformat needs, would build a parser of internationalised web addresses when it is imported. That
# takes a second or two of every job, and no notebook is checked for them; without the parser it does without.
sys.modules.setdefault("rfc3987_syntax", None)
