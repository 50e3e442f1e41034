"""What a check says: a table for people, a bare number for whoever counts points."""

from dataclasses import dataclass, field
from html import escape

MARKS = {"right": "✓", "wrong": "✗", "open": "–"}
COLOURS = {"right": "#009E73", "wrong": "#D55E00", "open": "#808080"}  # legible on light and dark; marks say the same


@dataclass
class Line:
    """One part of a TODO. state : a key of MARKS; points : what it is worth"""

    state: str
    sentence: str
    points: float


@dataclass
class Result:
    """The outcome of a check.

    number : of the TODO; lines : one for each part; last : what to do next
    difference : "yours / spec" line, or empty
    function : the function to go on with: the student's own where it is usable, else the course's
    own : whether it is the student's
    As text it is the points alone, a plain float: nbgrader reads partial credit there.
    """

    number: str
    lines: list[Line]
    last: str
    function: object = None
    own: bool = True
    difference: str = ""
    notes: list[str] = field(default_factory=list)

    @property
    def points(self) -> float:
        return float(sum(line.points for line in self.lines if line.state == "right"))

    @property
    def most(self) -> float:
        return float(sum(line.points for line in self.lines))

    @property
    def passed(self) -> bool:
        return self.points == self.most

    @property
    def started(self) -> bool:
        return any(line.state != "open" for line in self.lines)

    def __repr__(self):
        return repr(self.points)

    def __float__(self):
        return self.points

    def __str__(self):
        rows = [f"TODO {self.number}: {self.points:g} of {self.most:g} points"]
        rows += [f"  {MARKS[line.state]} {line.sentence}" for line in self.lines]
        return "\n".join([*rows, *(f"    {text}" for text in (self.difference, *self.notes, self.last) if text)])

    def _repr_html_(self):
        rows = [
            f'<tr><td style="color:{COLOURS[line.state]};font-weight:bold" aria-label="{line.state}">'
            f'{MARKS[line.state]}</td><td style="text-align:left">{escape(line.sentence)}</td></tr>'
            for line in self.lines
        ]
        rows += [
            f'<tr><td></td><td style="text-align:left">{escape(text)}</td></tr>'
            for text in (self.difference, *self.notes, self.last)
            if text
        ]
        head = f"TODO {self.number} · {self.points:g} of {self.most:g} points"
        return f'<table><caption style="text-align:left">{head}</caption>{"".join(rows)}</table>'


@dataclass(frozen=True)
class Hint:
    """One rung of a ladder of hints."""

    number: str
    rung: int
    rungs: int
    text: str

    def __str__(self):
        return f"Hint {self.rung} of {self.rungs} for TODO {self.number}: {self.text}"

    __repr__ = __str__

    def _repr_html_(self):
        return f"<p><b>Hint {self.rung} of {self.rungs} for TODO {self.number}</b> · {escape(self.text)}</p>"
