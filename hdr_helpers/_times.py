"""Exposure times of a bracket: from text files, file names and EXIF, in seconds or as 1/seconds or EV.

Where the times come from, in order of trust: a text file beside the photographs (someone wrote it for
this set), times spelled in the file names, the EXIF tag ExposureTime. Whether a list holds seconds or
1/seconds can't be told from the list; the photographs tell, because a longer exposure is brighter.
"""

import contextlib
import json
import re
import struct
from pathlib import PurePosixPath

import numpy as np

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".ppm")
TEXT_SUFFIXES = (".txt", ".csv", ".json")
SEPARATOR = r"[\s,;:=\"']"  # what may stand between a name and its time
ROUNDING = 0.05  # cameras print rounded times; two sources that differ by more are both reported


class BracketError(ValueError):
    """A bracket can't be used. The message names the file or value and what would be accepted."""


def find_times(path, names, texts, exif, brightness) -> tuple[np.ndarray, str, list[str]]:
    """Exposure times in the order of names, where they came from, and notes on what was decided.

    path : of the bracket, for messages; names : P file names
    texts : dict from the name of a text file to its bytes
    exif : P exposure times in seconds, None for a photograph without one
    brightness : (P,) float, mean pixel value of each photograph
    Raises BracketError where no source gives a time for every photograph, or none that can be true.
    """
    lists, misfits = [], []
    for name, data in texts.items():
        try:
            entry = _text_values(name, data, names)
        except BracketError as misfit:  # of no weight where another source knows all times
            misfits.append(misfit)
            continue
        if entry:
            written_as_fractions = re.search(rb"\b\d+/\d+\b", data)
            lists.append((f"the text file {name}", *entry, not written_as_fractions))
    lists.sort(key=lambda entry: not entry[1])  # a list that names the photographs is the surest
    found = [(source, values, may_invert) for source, _, values, may_invert in lists]
    found += [("the file names", _name_values(names), True), ("EXIF", exif if all(exif) else None, False)]
    found = [entry for entry in found if entry[1] is not None]
    if not found and not misfits:
        listed = f" {', '.join(texts)} held no line for each of the {len(names)} photographs." if texts else ""
        raise BracketError(
            f"No exposure times were found for the photographs in {path}.{listed} Put them in a text file "
            "there, one line for each photograph, as in: img_1.jpg 1/60"
        )

    agreed, notes = [], []
    for source, values, may_invert in found:
        try:
            times, decided = _as_seconds(source, np.array(values, dtype=np.float64), brightness, may_invert)
        except BracketError as misfit:
            misfits.append(misfit)
            continue
        notes += decided if not agreed else []
        agreed.append((source, times))
    if not agreed:
        raise misfits[0]
    source, times = agreed[0]
    notes += [str(misfit) for misfit in misfits]
    for other, theirs in agreed[1:]:
        ratio = theirs / times
        ratio /= np.median(ratio)  # a factor common to all does no harm: radiance is relative
        for i in np.flatnonzero(np.abs(ratio - 1) > ROUNDING):
            notes.append(f"{names[i]}: {times[i]:.4g} s by {source}, {theirs[i]:.4g} s by {other}.")
    return times, source, notes


def _as_seconds(source, values, brightness, may_invert) -> tuple[np.ndarray, list[str]]:
    """Turn seconds, 1/seconds or EV stops into seconds: the photographs must get brighter with time.

    may_invert : False where the values are known to be seconds: EXIF's, and fractions such as 1/60
    """
    notes = []
    if np.any(values <= 0):
        values = np.exp2(values)
        notes.append(f"{source[:1].upper()}{source[1:]} holds EV stops; times are relative, 2 to the EV.")
    i, j = np.triu_indices(len(values), 1)
    agreement = np.mean(np.sign(values[j] - values[i]) * np.sign(brightness[j] - brightness[i]))
    if abs(agreement) < 0.5 or (agreement < 0 and not may_invert):
        raise BracketError(
            f"By {source} the photographs do not get brighter as the exposure gets longer; check which time "
            "belongs to which photograph, and that ISO and aperture were fixed."
        )
    if agreement < 0:
        values = 1 / values
        notes.append(
            f"{source[:1].upper()}{source[1:]} reads as 1/seconds: the photographs get darker as its numbers grow."
        )
    return values, notes


def _text_values(name: str, data: bytes, names: list[str]) -> tuple[bool, list[float]] | None:
    """Whether a text file names the photographs, and its number for each; None where it lists no times."""
    text = _decoded(data)
    rows = _json_rows(text) if name.lower().endswith(".json") else _line_rows(text)
    stems = {PurePosixPath(n).stem.lower() for n in names}
    named, bare = {}, []
    for row in rows:
        label, numbers = _split_row(row, stems)
        if label:
            named[label] = numbers[0] if numbers else None
        else:
            bare.append(numbers)
    # Lists often name .ppm files where .png ones lie: the stem decides.
    if any(value is not None for value in named.values()):
        missing = [n for n in names if named.get(PurePosixPath(n).stem.lower()) is None]
        if missing:
            raise BracketError(
                f"{name} gives no exposure time for {missing[0]}; every photograph needs a line, "
                f"as in: {missing[0]} 1/60"
            )
        return True, [named[PurePosixPath(n).stem.lower()] for n in names]
    if named or None in bare:  # words that are neither names nor numbers: this is no list of times
        return None
    flat = [v for row in bare for v in row]
    values = next((row for row in [flat, *bare] if len(row) == len(names)), None)
    return values and (False, values)


def _decoded(data: bytes) -> str:
    """Text as editors save it: UTF-8, UTF-16 (PowerShell), GB18030 (Chinese Windows), or at least its digits."""
    encodings = ("utf-16",) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ("utf-8-sig", "gb18030")
    for encoding in encodings:
        with contextlib.suppress(UnicodeDecodeError):
            return data.decode(encoding)
    return data.decode("latin-1")


def _split_row(row: str, stems: set[str]) -> tuple[str | None, list[float] | None]:
    """The stem of the photograph that a row names, and the row's numbers; None for each where there is none."""
    end = re.search(rf"({'|'.join(map(re.escape, IMAGE_SUFFIXES))})(?=$|{SEPARATOR})", row, re.IGNORECASE)
    if not end:
        numbers = [_number(word) for word in re.split(rf"{SEPARATOR}+", row.strip())]
        return None, None if None in numbers else numbers
    # A name may hold blanks, and a time may stand before it: the longest ending that is a photograph's.
    before = row[: end.end()]
    starts = [0, *(m.end() for m in re.finditer(rf"{SEPARATOR}+", before))]
    candidates = [(PurePosixPath(before[start:].replace("\\", "/")).stem.lower(), start) for start in starts]
    label, start = next((c for c in candidates if c[0] in stems), candidates[-1])
    words = re.split(rf"{SEPARATOR}+", row[end.end() :] + " " + before[:start])
    return label, [v for v in map(_number, words) if v is not None]


def _line_rows(text: str) -> list[str]:
    """Lines that may hold times: no comments, no settings, no headers of words alone."""
    lines = (line.split("#")[0].strip() for line in text.splitlines())
    names = re.compile("|".join(map(re.escape, IMAGE_SUFFIXES)), re.IGNORECASE)
    return [line for line in lines if re.search(r"\d", line) and ("=" not in line or names.search(line))]


def _json_rows(text: str) -> list[str]:
    """A JSON object from names to times, a list of objects, or a list of numbers, as lines of text."""
    try:
        content = json.loads(text)
    except json.JSONDecodeError:
        return []
    if isinstance(content, dict):
        return [f"{name} {value}" for name, value in content.items()]
    if not isinstance(content, list):
        return []
    return [" ".join(map(str, row.values())) if isinstance(row, dict) else str(row) for row in content]


def _name_values(names: list[str]) -> list[float] | None:
    """Times spelled in file names: img_0.033.jpg and img_15.jpg in seconds, exp_1_60.jpg as 1/60."""
    stems = [PurePosixPath(n).stem for n in names]
    fractions = [re.search(r"(?:^|\D)(1)_(\d+)$|(\d+)_(1)$", s) for s in stems]
    if all(fractions):
        pairs = [(int(m[1] or m[3]), int(m[2] or m[4])) for m in fractions]
        # set_1_1, set_1_2, set_1_3 count the frames, and 20240105_1 is a date: no times.
        counted = sorted(bottom for _, bottom in pairs)
        counter = counted == list(range(counted[0], counted[0] + len(counted)))
        return None if counter or max(top for top, _ in pairs) > 60 else [top / bottom for top, bottom in pairs]
    decimals = [re.search(r"(\d+(?:\.\d+)?)s?$", s) for s in stems]
    # Frame counters are whole numbers too; only a decimal point somewhere says that these are times.
    return [float(m[1]) for m in decimals] if all(decimals) and any("." in m[1] for m in decimals) else None


def exif_exposure_time(exif: bytes) -> float | None:
    """ExposureTime (tag 0x829A) in seconds from a raw EXIF block; None where it isn't there or is odd."""
    tiff = exif.removeprefix(b"Exif\0\0")
    order = {b"II": "<", b"MM": ">"}.get(tiff[:2])

    def find(tag: int, directory: int) -> int | None:
        (count,) = struct.unpack_from(order + "H", tiff, directory)
        for entry in range(directory + 2, directory + 2 + 12 * count, 12):
            found, _, _, value = struct.unpack_from(order + "HHII", tiff, entry)
            if found == tag:
                return value
        return None

    try:
        (first,) = struct.unpack_from(order + "I", tiff, 4)
        numerator, denominator = struct.unpack_from(order + "II", tiff, find(0x829A, find(0x8769, first)))
    except (struct.error, TypeError):  # cut short, or one of the tags is missing
        return None
    return numerator / denominator if numerator and denominator else None


def _number(word: str) -> float | None:
    """15, 0.5, 1/60 or 1/60s as a float; None for anything else."""
    top, _, bottom = re.sub(r"(?<=\d)(s|sec)$", "", word, flags=re.IGNORECASE).partition("/")
    try:
        value = float(top) / float(bottom or 1)
    except (ValueError, ZeroDivisionError):
        return None
    return value if np.isfinite(value) else None
