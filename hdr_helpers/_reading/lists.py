"""Numbers written for each photograph in a text file beside them.

Nothing is decided here: whether a number is seconds, 1/seconds or an EV step is for times.py, which
sees the photographs too.
"""

import codecs
import contextlib
import json
import re
import unicodedata
from pathlib import PurePosixPath
from typing import NamedTuple

import numpy as np

from hdr_helpers._reading import IMAGE_SUFFIXES, BracketError

SEPARATOR = r"[\s,;:=|\"'\[\]]"  # what may stand between a name and its number
SUFFIX = "|".join(map(re.escape, IMAGE_SUFFIXES))
UNITS = {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "秒": 1.0, "ms": 1e-3, "毫秒": 1e-3, "": 1.0}
UNIT = "(" + "|".join(sorted(filter(None, UNITS), key=len, reverse=True)) + ")"
TIME_TITLE = re.compile(r"shutter|time|expos|speed|sec|^t$", re.IGNORECASE)
OTHER_TITLE = re.compile(r"f.?stop|f.?num|^f$|apert|iso|gain|^nd", re.IGNORECASE)
IN_SECONDS = re.compile(rf"[\d.]+/[\d.]+{UNIT}?|[\d.]+{UNIT}")  # a word that can't be 1/seconds or EV
MAX_TEXT = 2**18  # bytes; a longer file is no list of exposure times
MAX_NAME = 1000  # characters before a suffix in which the name of a photograph is looked for


class Listed(NamedTuple):
    """values, places : the number of each photograph and where it is written; kind : SECONDS, EV or OPEN;
    named : whether it says which photograph each number is for"""

    values: tuple[float, ...]
    places: tuple[str, ...]
    kind: str
    named: bool = True


SECONDS, EV, OPEN = "seconds", "EV", "seconds, 1/seconds or EV"


class _Row(NamedTuple):
    """place : where it stands; label : the photograph it names, in lower case, or None; words : the rest"""

    place: str
    label: str | None
    words: list[str]

    @property
    def numbers(self) -> list[float]:
        return [v for v in map(_number, self.words) if v is not None]


def text_values(file: str, data: bytes, names: list[str]) -> Listed | None:
    """What a text file lists for the photographs; None where it is about something else.

    Raises BracketError where it lists photographs, but not these one for one.
    """
    if len(data) > MAX_TEXT:
        return None
    text = _decoded(data)
    stems = {_stem(n) for n in names}
    lines = _json_rows(file, text) if file.lower().endswith(".json") else _line_rows(text, stems)
    if len(lines) == len(names) and all(re.fullmatch(r"\d+,\d+", line) for _, line in lines):
        lines = [(place, line.replace(",", ".")) for place, line in lines]  # one 0,5 a line
    rows = [_split_row(place, line, stems) for place, line in lines]
    if sorted(row.words[0].lower() for row in rows if len(row.words) > 1) == sorted(stems):
        rows = [_Row(row.place, row.words[0].lower(), row.words[1:]) for row in rows]  # 1 1/60, for 1.png
    named = [row for row in rows if row.label]
    bare = [row for row in rows if not row.label]
    # 1/60 and 0.5 s can only be seconds; 0.5 and 60 may be anything.
    kind = SECONDS if any(IN_SECONDS.fullmatch(word) for row in rows for word in row.words) else OPEN
    if any(row.numbers for row in named):
        values, places = _by_name(file, named, names, _titles(text))
        return Listed(values, places, kind)
    if named or not all(len(row.numbers) == len(row.words) > 0 for row in bare):  # words that say something else
        return None
    return _by_order(file, bare, names, kind)


def _by_order(file, rows, names, kind) -> Listed | None:
    """Numbers alone, one for each photograph in the order of the names: all of them, or those of one line."""
    flat = [(row.place, value) for row in rows for value in row.numbers]
    if len(flat) == len(names) + 1 and flat[0][1] == len(names):  # how many follow
        del flat[0]
    by_row = [[(row.place, value) for value in row.numbers] for row in rows]
    if len(by_row) == len(names):  # a table without names: it can't be said which column is meant
        by_row = []
    chosen = next((row for row in (flat, *by_row) if len(row) == len(names)), None)
    if chosen is None:
        if len(flat) > 1:
            raise BracketError(
                f"{file} lists {len(flat)} numbers for {len(names)} photographs; list one for each, in the order "
                f"{names[0]}, {names[1]}, ..., or beside its name."
            )
        return None
    places, values = zip(*chosen, strict=True)
    return Listed(values, tuple(f"{file}{place}" for place in places), kind, named=False)


def _by_name(file, named, names, titles) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Each photograph's number, by its name, or by its stem: lists often name .ppm where .png files lie."""
    rows = {}
    for row in named:
        if row.label in rows and rows[row.label].words != row.words:
            raise BracketError(f"{file} gives {row.label} twice, with different times; delete one of the lines.")
        rows[row.label] = row
    found = []
    for name in names:
        keys = (_plain(name).lower(), _stem(name))
        label = next((k for k in keys if k in rows), None)
        label = label or next((k for k in rows if _stem(k) == keys[1]), None)
        if label is None or not rows[label].numbers:
            raise BracketError(
                f"{file} gives no exposure time for {name}; every photograph needs a line, as in: {name} 1/60. "
                "Add the line, or take the photograph out of the folder."
            )
        found.append(rows.pop(label))
    if rows:
        raise BracketError(
            f"{file} lists {next(iter(rows))}, which is not among the photographs; add the photograph, or "
            "delete its line."
        )
    places = tuple(f"{file}{row.place}" for row in found)
    # Where each row has one word that can only be seconds, 1/60 or 0.5 s, it is that one.
    sure = [[word for word in row.words if IN_SECONDS.fullmatch(word) and _number(word)] for row in found]
    if all(len(words) == 1 for words in sure):
        return tuple(_number(word) for (word,) in sure), places
    columns = list(zip(*(row.numbers for row in found), strict=False))
    return columns[_time_column(file, columns, titles)], places


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
            return _plain(data.decode(encoding))
    return _plain(data.decode("latin-1"))


def _plain(text: str) -> str:
    """Full-width forms, composed letters and typographic signs as the plain ones: １，＝ é − ⁄ as 1,= é - /."""
    return unicodedata.normalize("NFKC", text).translate({0x2044: "/", 0x2212: "-", 0x3001: ","})


def _stem(name: str) -> str:
    return PurePosixPath(_plain(name)).stem.lower()


def _line_rows(text: str, stems: set[str]) -> list[tuple[str, str]]:
    """Lines that may hold times, with their place: no comments, no settings, no headers of words alone."""
    rows = [(f", line {i}", line.split("#")[0].strip()) for i, line in enumerate(text.splitlines(), 1)]
    named = re.compile(SUFFIX, re.IGNORECASE)

    def setting(row):
        return "=" in row and not named.search(row) and row.split("=")[0].strip().lower() not in stems

    return [(place, row) for place, row in rows if re.search(r"\d", row) and not setting(row)]


def _json_rows(file: str, text: str) -> list[tuple[str, str]]:
    """A JSON object from names to times, a list of objects or lists, or a list of numbers, as rows of text."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as problem:
        if re.search(SUFFIX, text, re.IGNORECASE):
            raise BracketError(f"{file} is not valid JSON ({problem}); correct it, or write a plain list.") from None
        return []
    if isinstance(content, dict):
        return [("", f"{name} {_json_row(value)}") for name, value in content.items()]
    return [("", _json_row(value)) for value in content] if isinstance(content, list) else []


def _json_row(value) -> str:
    """One entry as words; of an object whose keys say what is a time only the texts and the times."""
    if isinstance(value, dict):
        times = any(TIME_TITLE.search(key) and not isinstance(v, str) for key, v in value.items())
        value = [v for key, v in value.items() if not times or isinstance(v, str) or TIME_TITLE.search(key)]
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def _split_row(place: str, row: str, stems: set[str]) -> _Row:
    """A row of a list: the photograph that it names, if it names one, and its other words."""
    row = re.sub(r'(\d)"(\d)', r"\1.\2", row)  # 1"3 is how cameras show 1.3 s
    row = re.sub(r'"(\d+),(\d+)"', r"\1.\2", row)
    row = re.sub(rf"(?<=[\d.])\s+(?={UNIT}(?!\w))", "", row)  # 16.7 ms is one word
    end = re.search(rf"({SUFFIX})(?=$|{SEPARATOR})", row, re.IGNORECASE)
    if end:
        # A name may hold blanks, and a time may stand before it: the longest ending that is a photograph's.
        cut = max(0, end.end() - MAX_NAME)
        before = row[cut : end.end()]
        starts = [0, *(m.end() for m in re.finditer(rf"{SEPARATOR}+", before))]
        labels = [(PurePosixPath(before[start:].replace("\\", "/")).name.lower(), start) for start in starts]
        label, start = next((c for c in labels if PurePosixPath(c[0]).stem in stems), labels[-1])
        return _Row(place, label, _words(row[end.end() :] + " " + row[: cut + start]))
    lower = row.lower()
    bare = [s for s in stems if lower.startswith(s) and re.match(SEPARATOR, row[len(s) :]) and _number(s) is None]
    if bare:  # a name without its suffix
        label = max(bare, key=len)
        return _Row(place, label, _words(row[len(label) :]))
    return _Row(place, None, _words("," + row))


def _words(rest: str) -> list[str]:
    """What stands beside a name: no dates, no times of day; 0,5 is 0.5 unless commas part the columns."""
    rest = re.sub(r"\d+([:-]\d+){2}", " ", rest)
    if ";" in rest or not rest.lstrip().startswith(","):
        rest = re.sub(r"(?<=\d),(?=\d)", ".", rest)
    return [word for word in re.split(rf"{SEPARATOR}+", rest) if word]


def _number(word: str) -> float | None:
    """15, 0.5, 1/60, 1/60s or 16.7ms as a float, in seconds where there is a unit; None for anything else."""
    parts = re.fullmatch(rf"([^/]+?)(?:/([^/]+?))?{UNIT}?\.?", word, re.IGNORECASE | re.ASCII)
    try:
        value = float(parts[1]) / float(parts[2] or 1) * UNITS[(parts[3] or "").lower()]
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return value if value == 0 or 1e-9 < abs(value) < 1e9 else None  # beyond that nothing is a time, nan neither
