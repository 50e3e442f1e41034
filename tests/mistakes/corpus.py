"""Answers that students give: wrong ones with the diagnosis that is expected, and right ones written otherwise.

    @wrong("3.1", says="weight 1")      a function that must lose points, and words that must stand in the sentence
    @right("3.1")                       one that must get full points
    slip("3.1", "weight 1", old, new)   the answer of ANSWERS["3.1"] with one piece of its text replaced
says=None : the answer has to be refused, but nobody can tell from outside which mistake it was.
"""

import linecache
import re
from textwrap import dedent
from typing import NamedTuple

import cv2
import numpy as np
from matplotlib.figure import Figure

from hdr_helpers.tonemap import luminance

ANSWERS, WRONG, RIGHT = {}, [], []


class Answer(NamedTuple):
    """number : of the TODO; says : expected words, or None; what : for the test's name; function : the answer"""

    number: str
    says: str | None
    what: str
    function: object


def wrong(number, says):
    def add(function):
        WRONG.append(Answer(number, says, function.__name__, function))
        return function

    return add


def right(number):
    def add(function):
        RIGHT.append(Answer(number, None, function.__name__, function))
        return function

    return add


def answer(number, text):
    """A right answer as text, from which slips are made."""
    ANSWERS[number] = dedent(text).lstrip()
    RIGHT.append(Answer(number, None, "the answer that slips are made of", _defined(ANSWERS[number], number)))


def slip(number, says, *replaced, fine=False):
    """The answer with pieces replaced: old, new, old, new ... fine : it stays right."""
    text = ANSWERS[number]
    for old, new in zip(replaced[::2], replaced[1::2], strict=True):
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in the answer of {number}"
        text = text.replace(old, new)
    what = f"{replaced[-2].strip()} -> {replaced[-1].strip()}"
    (RIGHT if fine else WRONG).append(Answer(number, says, what, _defined(text, number)))


def _defined(text, number):
    """The last function that a text defines, as a notebook's cell would define it."""
    name = f"<TODO {number}, {len(WRONG) + len(RIGHT)}>"
    linecache.cache[name] = len(text), None, text.splitlines(keepends=True), name
    names = {"np": np, "cv2": cv2, "Figure": Figure, "luminance": luminance}
    exec(compile(text, name, "exec"), names)
    return names[re.findall(r"^def (\w+)", text, re.MULTILINE)[-1]]
