"""Exposure times spelled in file names: in seconds, as fractions, in EV. Counters and dates are none."""

import re
from pathlib import PurePosixPath

import numpy as np

from hdr_helpers._reading.lists import EV, OPEN, SECONDS, Listed


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
    signed = [re.search(r"(?:^|[_ ])([+-]?\d{1,3}\.\d{1,9})$", s) for s in stems]
    if all(signed) and any(m[1][0] in "+-" for m in signed):  # a_-0.5, a_0.0, a_+1.0
        return Listed(tuple(float(m[1]) for m in signed), places, EV)
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
