"""Figures of the class report: what became of each TODO, and how the points are spread.

Each comes with its message, a text for those who can't see it, and two drawings: for a light page and for a dark one.
From the same numbers come the same bytes.
"""

import base64
import io
from collections import Counter
from typing import NamedTuple

import matplotlib
import numpy as np

from hdr_helpers.lab.figures.style import THREE, new_figure

# The colours of Okabe and Ito. Hatches say the same, and so do the counts and the order.
LOOKS = {
    "right": ("#009E73", None, "right"),
    "partial": ("#E69F00", "//", "right in part"),
    "wrong": ("#D55E00", "xx", "wrong"),
    "empty": ("#A9A9A9", "--", "not started"),
    "unasked": ("#CC79A7", "\\\\", "could not be checked"),
    "absent": ("none", None, "no notebook"),
}
DARK_INK, LIGHT_INK = "#222222", "#E4E4E4"
ON_COLOUR = "#111111"  # legible on every colour above
NARROW = 0.022  # of the class: a bar that is shorter has no room for its count
BINS = 30  # at most, so that dots don't touch
DOTS = 60  # students up to whom each is a dot of its own


class Chart(NamedTuple):
    """message : what it says; alt : the same for those who can't see it; light, dark : data addresses of SVG"""

    message: str
    alt: str
    light: str
    dark: str


def states(students, numbers) -> dict[str, Counter]:
    """From the number of each TODO to how many students are in which state of LOOKS; students : StudentOutcome each."""
    counts = {number: Counter() for number in numbers}
    for student in students:
        left = set(numbers)
        for notebook in student.notebooks:
            for todo in notebook.todos if notebook.kind in ("graded", "stopped") else ():
                counts[todo.number][todo.state] += 1
                left.discard(todo.number)
        for number in left:
            counts[number]["absent"] += 1
    return counts


def todos_chart(rows: dict[str, dict[str, int]], size: int) -> Chart:
    """Stacked bars, one for each TODO.

    rows : from the name of a TODO, which begins with its number, to how many students are in each state of LOOKS
    size : of the class
    """
    right = {name: counts["right"] for name, counts in rows.items()}
    least = min(right.values())
    hardest = [name.split()[0] for name in rows if right[name] == least]
    if least == size:
        message = f"Every TODO is right for {_all_of(size)}"
    elif max(right.values()) == 0:
        message = "No TODO is right for anybody"
    elif size == 1:
        message = f"{sum(right.values())} of {len(rows)} TODOs are right"
    else:
        named = f"{_listed(hardest)} {'was' if len(hardest) == 1 else 'were'}"
        message = f"TODO {named} the hardest: right for {least or 'none'} of {size} students"
    said = f"A bar for each of {len(rows)} TODOs shows how many of {_all_of(size)} got it right, from {least} to "
    alt = f"{said}{max(right.values())}; {_listed(hardest)} has the fewest. The table below has the counts."
    return Chart(message, alt, *_twice(lambda ink: _bars(rows, size, ink)))


def _bars(rows, size, ink):
    fig, ax = new_figure(1, 1, 0.75 + 0.29 * len(rows))
    places, at, before = [], 0.0, None
    for name in rows:
        notebook = name.split(".")[0]
        at += 1.0 + 0.45 * (before not in (None, notebook))  # a gap where another notebook begins
        places.append(at)
        before = notebook
    left = np.zeros(len(rows))
    for state, (colour, hatch, label) in LOOKS.items():
        counts = np.array([row[state] for row in rows.values()])
        if not counts.any():
            continue
        edge = ink if state == "absent" else "white"
        ax.barh(places, counts, 0.8, left, color=colour, hatch=hatch, edgecolor=edge, lw=0.6, label=label,
                alpha=None if state != "absent" else 0.55)  # fmt: skip
        for y, x, count in zip(places, left, counts, strict=True):
            if count >= NARROW * size and count:
                behind = {"boxstyle": "square,pad=0.12", "fc": colour, "ec": "none"} if hatch else None
                ax.text(x + count / 2, y, str(count), ha="center", va="center", fontsize=10, bbox=behind,
                        color=ink if state == "absent" else ON_COLOUR)  # fmt: skip
        left += counts
    ax.set(yticks=places, yticklabels=list(rows), ylim=(places[-1] + 0.6, places[0] - 0.6), xlim=(0, size), xticks=[])
    ax.tick_params(length=0, labelsize=10)
    ax.spines[:].set_visible(False)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside upper left", ncols=6, frameon=False, handlelength=1.6,
               columnspacing=1.6, borderpad=0)  # fmt: skip
    return fig


def totals_chart(points, most: float, unmarked: int = 0) -> Chart:
    """How the points of a class are spread: a dot for each student, or bars where the class is large.

    points : of each student; most : that can be had; unmarked : answers that wait for marks
    """
    points = np.asarray(points, dtype=np.float64)
    low, median, high = np.percentile(points, (25, 50, 75))
    so_far = " so far" if unmarked else ""
    if len(points) == 1:
        message = f"The one student has {median:.4g} of {most:.4g} points{so_far}"
    elif np.ptp(points) == 0:
        message = f"All {len(points)} students have {median:.4g} of {most:.4g} points{so_far}"
    else:
        message = f"Half of the class has {median:.4g} points or more{so_far}, of {most:.4g}"
    kind = "Dots, one a student," if len(points) <= DOTS else "Bars"
    alt = (
        f"{kind} show how the points of {_all_of(len(points))} are spread from {points.min():.4g} to "
        f"{points.max():.4g}; the median is {median:.4g}, and the middle half lies from {low:.4g} to {high:.4g}."
    )
    return Chart(message, alt, *_twice(lambda ink: _spread(points, most, (low, median, high), ink)))


def _spread(points, most, quartiles, ink):
    end = max(most, points.max(), 1.0)
    start = min(0.0, points.min())
    width = max(1.0, np.ceil((end - start) / BINS))
    edges = np.arange(start, end + width, width) - width / 2
    edges = np.append(edges, edges[-1] + width)
    counts, _ = np.histogram(points, edges)
    middles = (edges[:-1] + edges[1:]) / 2
    colour = THREE[1][0] if ink == DARK_INK else "#56B4E9"
    tallest = counts.max()
    low, median, high = quartiles
    dots = len(points) <= DOTS
    fig, ax = new_figure(1, 1, 1.15 + 0.26 * max(tallest, 3) if dots else 3.0)
    top = max(tallest, 3) + 0.6 if dots else 1.08 * tallest
    if high > low:
        ax.axvspan(low, high, color=ink, alpha=0.09, lw=0, label="middle half of the class")
    if dots:
        heights = [height + 0.5 for count in counts for height in range(count)]
        ax.plot(np.repeat(middles, counts), heights, "o", ms=11, color=colour, mec="none")
        ax.set_yticks([])
        ax.spines["left"].set_visible(False)
    else:
        ax.bar(middles, counts, 0.88 * width, color=colour)
        ax.set_ylabel("students")
        ax.yaxis.get_major_locator().set_params(integer=True)
    ax.axvline(median, color=ink, ls="--", lw=1.6, zorder=1, label=f"median, {median:.4g}")
    ax.set(xlim=(start - width, end + width), ylim=(0, top), xlabel=f"points of {most:.4g}")
    ax.spines[["top", "right"]].set_visible(False)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside upper left", ncols=2, frameon=False, borderpad=0)
    return fig


def _twice(draw) -> tuple[str, str]:
    return tuple(_address(draw, ink) for ink in (DARK_INK, LIGHT_INK))


def _address(draw, ink) -> str:
    """The data address of what draw(ink) draws, on a ground that lets the page through."""
    inks = dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), ink)
    fixed = {"svg.hashsalt": "report", "svg.fonttype": "path", "hatch.linewidth": 0.7, "axes.facecolor": "none"}
    buffer = io.BytesIO()
    with matplotlib.rc_context(inks | fixed):
        fig = draw(ink)
        fig.set_facecolor("none")
        fig.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def _all_of(size: int) -> str:
    return "one student" if size == 1 else f"{size} students"


def _listed(names: list[str]) -> str:
    """3.3; 3.3 and 3.4; 3.3, 3.4 and 8 more"""
    if len(names) > 3:
        names = [*names[:2], f"{len(names) - 2} more"]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
