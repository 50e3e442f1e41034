"""Numbers written for each photograph: in a text file beside them, or in their names.

Nothing is decided here: whether a number is seconds, 1/seconds or an EV step is for times.py, which
sees the photographs too.
"""

import codecs
import contextlib
import json
import re
from pathlib import PurePosixPath
from typing import NamedTuple

import numpy as np

from hdr_helpers._reading import IMAGE_SUFFIXES, BracketError

SEPARATOR = r"[\s,;:=|\"']"  # what may stand between a name and its number
SUFFIX = "|".join(map(re.escape, IMAGE_SUFFIXES))
UNITS = {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "秒": 1.0, "ms": 1e-3, "毫秒": 1e-3, "": 1.0}
UNIT = "(" + "|".join(sorted(filter(None, UNITS), key=len, reverse=True)) + ")"
TIME_TITLE = re.compile(r"shutter|time|expos|speed|sec|^t$", re.IGNORECASE)
OTHER_TITLE = re.compile(r"f.?stop|f.?num|^f$|apert|iso|gain|^nd", re.IGNORECASE)
IN_SECONDS = re.compile(rf"(?:^|{SEPARATOR})(?:[\d.]+/[\d.]+{UNIT}?|[\d.]+\s*{UNIT})(?=$|{SEPARATOR})")
MAX_TEXT = 2**18  # bytes; a longer file is no list of exposure times
MAX_NAME = 1000  # characters before a suffix in which the name of a photograph is looked for


class Listed(NamedTuple):
    """values, places : the number of each photograph and where it is written; kind : SECONDS, EV or OPEN"""

    values: tuple[float, ...]
    places: tuple[str, ...]
    kind: str
    named: bool = True


SECONDS, EV, OPEN = "seconds", "EV", "seconds, 1/seconds or EV"


def text_values(file: str, data: bytes, names: list[str]) -> Listed | None:
    """What a text file lists for the photographs; None where it is about something else.

    Raises BracketError where it lists photographs, but not these one for one.
    """
    if len(data) > MAX_TEXT:
        return None
    text = _decoded(data)
    rows = _json_rows(text) if file.lower().endswith(".json") else _line_rows(text)
    stems = {PurePosixPath(n).stem.lower() for n in names}
    split = [(place, *_split_row(row, stems)) for place, row in rows]
    named = [(place, label, numbers or []) for place, label, numbers in split if label]
    bare = [(place, numbers) for place, label, numbers in split if not label]
    # 1/60 and 0.5 s can only be seconds; 0.5 and 60 may be anything.
    kind = SECONDS if any(IN_SECONDS.search(row) for _, row in rows) else OPEN
    if any(numbers for _, _, numbers in named):
        values, places = _by_name(file, named, names, _titles(text))
        return Listed(values, places, kind)
    if named or not all(numbers for _, numbers in bare):  # words that are neither names nor numbers
        return None
    flat = [(place, value) for place, numbers in bare for value in numbers]
    if len(flat) == len(names) + 1 and flat[0][1] == len(names):  # how many follow
        del flat[0]
    by_row = [[(place, value) for value in numbers] for place, numbers in bare]
    if len(by_row) == len(names):  # a table without names: it can't be said which column is meant
        by_row = []
    chosen = next((row for row in (flat, *by_row) if len(row) == len(names)), None)
    if chosen is None:
        return None
    places, values = zip(*chosen, strict=True)
    return Listed(values, tuple(f"{file}{place}" for place in places), kind, named=False)


def _by_name(file, named, names, titles) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Each photograph's number, by its name, or by its stem: lists often name .ppm where .png files lie."""
    rows = {}
    for place, label, numbers in named:
        if rows.get(label, (None, numbers))[1] != numbers:
            raise BracketError(f"{file} gives {label} twice, with different times; delete one of the lines.")
        rows[label] = (place, numbers)
    found = {}
    for name in names:
        label = next((k for k in (name.lower(), PurePosixPath(name).stem.lower()) if k in rows), None)
        label = label or next((k for k in rows if PurePosixPath(k).stem == PurePosixPath(name).stem.lower()), None)
        if label is None or not rows[label][1]:
            raise BracketError(
                f"{file} gives no exposure time for {name}; every photograph needs a line, as in: {name} 1/60. "
                "Add the line, or take the photograph out of the folder."
            )
        found[name] = rows.pop(label)
    if rows:
        raise BracketError(
            f"{file} lists {next(iter(rows))}, which is not among the photographs; add the photograph, or "
            "delete its line."
        )
    columns = list(zip(*(numbers for _, numbers in found.values()), strict=False))
    return columns[_time_column(file, columns, titles)], tuple(f"{file}{place}" for place, _ in found.values())


def _time_column(file, columns, titles) -> int:
    """Which column holds the times: by its title, else the first that changes. Aperture or ISO may stand before it."""
    changing = [i for i, column in enumerate(columns) if len(set(column)) > 1]
    if len(titles) == len(columns):
        times = [i for i in changing if TIME_TITLE.search(titles[i])]
        for i in changing:
            if i not in times and OTHER_TITLE.search(titles[i]):
                raise BracketError(
                    f"{file} lists {titles[i]} that changes from photograph to photograph; list one number for each "
                    "instead, its exposure t ISO / N^2."
                )
        changing = times or changing
    counters = [i for i in changing if set(np.diff(sorted(columns[i]))) == {1}]
    return next((i for i in (*changing, 0) if i not in counters), (*changing, 0)[0])


def _titles(text: str) -> list[str]:
    """The titles of the columns after the name, from a heading such as "# Filename shutter iso", or none."""
    for line in text.splitlines():
        words = [word for word in re.split(rf"{SEPARATOR}+", line.strip("# \t\r")) if word]
        if len(words) > 1 and all(_number(word) is None for word in words) and any(map(TIME_TITLE.search, words)):
            return words[1:]
    return []


def _decoded(data: bytes) -> str:
    """Text as editors save it: UTF-8, UTF-16 (PowerShell), GB18030 (Chinese Windows), or at least its digits."""
    marked = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    for encoding in ("utf-16",) if marked else ("utf-8-sig", "gb18030"):
        with contextlib.suppress(UnicodeDecodeError):
            return data.decode(encoding)
    return data.decode("latin-1")


def _line_rows(text: str) -> list[tuple[str, str]]:
    """Lines that may hold times, with their place: no comments, no settings, no headers of words alone."""
    rows = [(f", line {i}", line.split("#")[0].strip()) for i, line in enumerate(text.splitlines(), 1)]
    named = re.compile(SUFFIX, re.IGNORECASE)
    return [(place, row) for place, row in rows if re.search(r"\d", row) and ("=" not in row or named.search(row))]


def _json_rows(text: str) -> list[tuple[str, str]]:
    """A JSON object from names to times, a list of objects, or a list of numbers, as rows of text."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return []
    if isinstance(content, dict):
        return [("", f"{name} {_json_row(value)}") for name, value in content.items()]
    return [("", _json_row(value)) for value in content] if isinstance(content, list) else []


def _json_row(value) -> str:
    return " ".join(map(str, value.values())) if isinstance(value, dict) else str(value)


def _split_row(row: str, stems: set[str]) -> tuple[str | None, list[float] | None]:
    """The photograph that a row names, in lower case, and the row's numbers; None for each where there is none."""
    row = re.sub(rf"(?<=[\d.])\s+(?={UNIT}(?!\w))", "", row)  # 16.7 ms is one word
    if ";" in row:  # a CSV of a country that writes 0,5
        row = re.sub(r"(?<=\d),(?=\d)", ".", row)
    end = re.search(rf"({SUFFIX})(?=$|{SEPARATOR})", row, re.IGNORECASE)
    if end:
        # A name may hold blanks, and a time may stand before it: the longest ending that is a photograph's.
        cut = max(0, end.end() - MAX_NAME)
        before = row[cut : end.end()]
        starts = [0, *(m.end() for m in re.finditer(rf"{SEPARATOR}+", before))]
        labels = [(PurePosixPath(before[start:].replace("\\", "/")).name.lower(), start) for start in starts]
        label, start = next((c for c in labels if PurePosixPath(c[0]).stem in stems), labels[-1])
        rest = row[end.end() :] + " " + row[: cut + start]
        return label, [v for v in map(_number, re.split(rf"{SEPARATOR}+", rest)) if v is not None]
    words = re.split(rf"{SEPARATOR}+", row.strip())
    if len(words) > 1 and words[0].lower() in stems and _number(words[0]) is None:  # a name without its suffix
        return words[0].lower(), [v for v in map(_number, words[1:]) if v is not None]
    numbers = [_number(word) for word in words if word]
    return None, None if None in numbers else numbers


def _number(word: str) -> float | None:
    """15, 0.5, 1/60, 1/60s or 16.7ms as a float, in seconds where there is a unit; None for anything else."""
    parts = re.fullmatch(rf"([^/]+?)(?:/([^/]+?))?{UNIT}?\.?", word, re.IGNORECASE | re.ASCII)
    try:
        value = float(parts[1]) / float(parts[2] or 1) * UNITS[(parts[3] or "").lower()]
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return value if value == 0 or 1e-9 < abs(value) < 1e9 else None  # beyond that nothing is a time, nan neither


# ------------------------------------------------------------------------------------- file names


def name_values(names: list[str]) -> Listed | None:
    """Times spelled in file names: shot_EV-1.33 in EV, exp_1_60 as 1/60, img_0.033 and img_15 in seconds."""
    stems = [PurePosixPath(n).stem for n in names]
    places = tuple(f"the name {n}" for n in names)
    # EV-1.33, ev_2, MultExpEV-4.72; not rev1
    ev = r"(?:(?<![A-Za-z])[Ee][Vv]|(?<=[a-z])EV)[ _]?([+-]?\d{1,3}(?:\.\d{1,9})?)(?!\d)"
    stops = [re.search(ev, s) for s in stems]
    if all(stops):
        return Listed(tuple(float(m[1]) for m in stops), places, EV)
    fractions = [re.search(r"(?:^|\D)(1)[_-](\d{1,9})$|(?<!\d)(\d{1,9})[_-](1)$", s) for s in stems]
    if all(fractions):
        pairs = [(int(m[1] or m[3]), int(m[2] or m[4])) for m in fractions]
        tops, bottoms = (sorted(numbers) for numbers in zip(*pairs, strict=True))
        # set_1_1, set_1_2, set_1_3 count the frames, 20240105_1 is a date, and nothing is divided by 0.
        if _consecutive(bottoms) or _consecutive(tops) or bottoms[0] == 0 or tops[-1] > 60:
            return None
        return Listed(tuple(top / bottom for top, bottom in pairs), places, SECONDS)
    # Not the end of 2024.04.05.
    decimals = [re.search(r"(?<!\d)(?<!\d\.)(\d{1,9}(?:\.\d{1,30})?)s?$", s) for s in stems]
    # Frame counters are whole numbers too; only a decimal point somewhere says that these are times.
    if all(decimals) and any("." in m[1] for m in decimals):
        return Listed(tuple(float(m[1]) for m in decimals), places, OPEN)
    return None


def _consecutive(numbers: list[int]) -> bool:
    """Whether ascending numbers count on by one."""
    return numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def whole_number_names(names: list[str]) -> Listed | None:
    """Names that are nothing but a whole number, such as 1626.jpg for 1/1626 s. They may be mere counters:
    only to be believed if the photographs bear them out."""
    stems = [PurePosixPath(n).stem for n in names]
    if not all(re.fullmatch(r"[1-9]\d{0,4}", s) for s in stems):
        return None
    values = tuple(float(s) for s in stems)
    evenly = np.ptp(np.diff(sorted(values))) == 0  # 10, 20, 30
    counted = evenly or np.ptp(values) < 4 * len(values)  # 3869, 3870, 3872
    return None if counted else Listed(values, tuple(f"the name {n}" for n in names), OPEN)
