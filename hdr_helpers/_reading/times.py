"""Exposure times of a bracket: which source to believe, and what its numbers mean.

Sources, in order of trust: a text file that names the photographs, a text file that lists one number for
each, times spelled in the file names, EXIF. (Someone wrote a text file for this very set; names and EXIF are
cameras' roundings.) The photographs have the last word: where they contradict a source, one that they bear
out takes its place. They also tell seconds from 1/seconds, because a longer exposure is brighter.
"""

import contextlib
from typing import NamedTuple

import numpy as np

from hdr_helpers._reading import BracketError
from hdr_helpers._reading.evidence import doubts, measure
from hdr_helpers._reading.lists import EV, OPEN, SECONDS, Listed, text_values
from hdr_helpers._reading.names import name_values, whole_number_names
from hdr_helpers._reading.pictures import Exif

ROUNDING = 0.05  # cameras print rounded times; two sources that differ by more are both reported
MIN_AGREEMENT = 0.5  # of the order of times with the order of brightness: 1 is the same, -1 reversed
TIE = 0.5  # pixel values; where means are closer than that, noise decides which photograph is brighter
EV_STEP, EV_REACH = 0.25, 24  # EV lists have no finer steps, and no camera reaches further


class Times(NamedTuple):
    """seconds : (P,) float64; places : where each is written; source : for people; notes : sentences;
    doubted : whether the photographs contradict some of them"""

    seconds: np.ndarray
    places: tuple[str, ...]
    source: str
    notes: list[str]
    doubted: bool = False


class _Candidate(NamedTuple):
    times: Times
    doubts: list[str]


def find_times(path, names, texts, exif: list[Exif], histograms) -> Times:
    """Exposure times in the order of names.

    path : of the bracket, for messages; names : P file names
    texts : dict from the name of a text file to its bytes
    exif : what EXIF says of each photograph
    histograms : (P, 256) counts of each pixel value, of each photograph
    Raises BracketError where no source gives a time for every photograph, or none that can be true.
    """
    camera = _Camera(names, exif)
    sources, misfits = _sources(texts, names, camera)
    candidates = []
    for source, listed in sources:
        try:
            candidates.append(_judge(source, listed, camera, names, histograms))
        except BracketError as misfit:
            misfits.append(misfit)
    if not candidates and (listed := whole_number_names(names)):
        with contextlib.suppress(BracketError):  # then they count the photographs
            candidate = _judge("the file names", listed, camera, names, histograms)
            candidates += [] if candidate.doubts else [candidate]
    if not candidates:
        raise misfits[0] if misfits else _nothing(path, names, texts, camera)

    first = int(np.argmin([len(c.doubts) for c in candidates]))  # of those with the fewest
    chosen = candidates.pop(first)
    notes = [*chosen.times.notes, *chosen.doubts, *(f"Not used: {misfit}" for misfit in misfits)]
    for trusted in candidates[:first]:
        notes.append(f"Not used: {trusted.times.source}. {' '.join(trusted.doubts)}")
    for other in candidates:
        notes += _differences(names, chosen.times, other.times)
    return chosen.times._replace(notes=notes, doubted=bool(chosen.doubts))


def _sources(texts, names, camera) -> tuple[list[tuple[str, Listed]], list[BracketError]]:
    """All that is written, the most trusted first, and what was written but does not fit the photographs."""
    lists, misfits = [], []
    for file, data in texts.items():
        try:
            listed = text_values(file, data, names)
        except BracketError as misfit:  # of no weight where another source knows all times
            misfits.append(misfit)
            continue
        if listed:
            lists.append((f"the text file {file}", listed))
    lists.sort(key=lambda entry: not entry[1].named)
    others = [("the file names", name_values(names)), ("EXIF", camera.listed)]
    return lists + [(source, listed) for source, listed in others if listed], misfits


def _nothing(path, names, texts, camera) -> BracketError:
    if 0 < len(camera.missing) < len(names):
        return BracketError(
            f"EXIF has no exposure time for {camera.missing[0]} ({len(camera.missing)} of {len(names)} photographs); "
            "take it out of the folder, or list the times of all in a text file there."
        )
    some = ", ".join([*texts][:3]) + (f" and {len(texts) - 3} more" if len(texts) > 3 else "")
    looked = f" No line for each of the {len(names)} photographs stands in {some}." if texts else ""
    return BracketError(
        f"No exposure times were found for the photographs in {path}.{looked} Put them in a text file "
        f"there, one line for each photograph, as in: {names[0]} 1/60"
    )


class _Camera:
    """What EXIF says: times, and the gain by which ISO and aperture change the exposure.

    listed : the times, as a source, where all photographs have one, else None
    missing : names of the photographs that have none
    gains : (P,) float64, ISO / N^2 relative to its smallest, or None where neither changes
    note : the sentence that says so
    """

    def __init__(self, names, exif):
        seconds = tuple(e.seconds for e in exif)
        self.missing = [name for name, time in zip(names, seconds, strict=True) if not time]
        self.listed = None if self.missing else Listed(seconds, tuple(f"EXIF of {n}" for n in names), SECONDS)
        gains, changes = np.ones(len(names)), []
        for what, values in (("ISO", [e.iso for e in exif]), ("the aperture", [e.f_number for e in exif])):
            if all(values) and max(values) > min(values) * (1 + ROUNDING):
                gains *= np.array(values) if what == "ISO" else np.array(values) ** -2.0
                mark = "" if what == "ISO" else "f/"
                changes.append(f"{what} changes from {mark}{min(values):g} to {mark}{max(values):g}")
        self.gains = gains / gains.min() if changes else None
        self.note = (
            f"EXIF says that {' and '.join(changes)}; each time is multiplied by ISO / N^2, "
            "relative to the least sensitive photograph, and stands for the exposure."
        )

    def is_exposure(self, values) -> bool:
        """Whether values are t ISO / N^2 of the photographs already, and not shutter times."""
        if not self.listed:
            return False
        shutter = np.array(self.listed.values)
        return _same(values, shutter * self.gains) and not _same(values, shutter)


def _judge(source, listed, camera, names, histograms) -> _Candidate:
    """Turn what is written into seconds of exposure, and ask the photographs what they think of it.

    Raises BracketError where it can't be true.
    """
    brightness = histograms @ np.arange(256) / np.maximum(histograms.sum(axis=1), 1)
    values, notes = _exposures(source, listed, camera, names, brightness)
    order = np.argsort(values, kind="stable")
    named, histograms = [names[i] for i in order], histograms[order]
    for i in np.flatnonzero(np.diff(values[order]) == 0):
        ratio = np.exp(measure(histograms[i : i + 2], (1.0, 2.0)).typical[0])
        looks = "they look alike" if 0.9 < ratio < 1.1 else "they are not equally bright"
        raise BracketError(
            f"{named[i]} and {named[i + 1]} have the same exposure time, {values[order[i]]:.4g} s, by {source}"
            f"{f', and {looks}' if np.isfinite(ratio) else ''}; keep one of them, or correct its time."
        )
    if _agreement(values, brightness) < MIN_AGREEMENT:
        raise BracketError(
            f"By {source} the photographs do not get brighter as the exposure gets longer; check which time "
            "belongs to which photograph, and that ISO and aperture were fixed."
        )
    times = Times(values, listed.places, source, notes)
    return _Candidate(times, doubts(measure(histograms, values[order]), values[order], named, source))


def _exposures(source, listed, camera, names, brightness) -> tuple[np.ndarray, list[str]]:
    """Seconds, with ISO and aperture in them where those change, from what is written; and notes on what it was."""
    values, notes = np.array(listed.values, dtype=np.float64), []
    plausible = listed.kind == OPEN and _may_be_stops(values)
    as_stops = listed.kind == EV or (plausible and _agreement(values, brightness) >= MIN_AGREEMENT)
    if not as_stops and plausible and values.min() < 0:
        given = ", ".join(f"{name} {value:g}" for name, value in zip(names, values, strict=True))
        raise BracketError(
            f"The EV steps of {source} do not fit the brightness of the photographs: {given}; write each step "
            f"beside the name of its photograph, as in: {names[0]} {values[0]:g}"
        )
    if not as_stops and values.min() <= 0:
        i = int(np.argmin(values))
        raise BracketError(f"{names[i]}: {values[i]:g} s by {source}; a time must be positive, as in: {names[i]} 1/60")
    if as_stops:
        i = int(np.argmax(np.abs(values)))
        if abs(values[i]) > EV_REACH:
            raise BracketError(
                f"{names[i]}: EV {values[i]:g} by {source}; EV steps lie between -{EV_REACH} and {EV_REACH}."
            )
        values = np.exp2(values)
        notes.append(f"The numbers of {source} are EV steps; times are relative, 2 to the EV.")

    gains = np.ones(len(values))
    inverse = 1 / values if listed.kind == OPEN and not as_stops else values
    if camera.gains is not None and not camera.is_exposure(values) and not camera.is_exposure(inverse):
        gains = camera.gains
        notes.append(camera.note)
    if listed.kind == OPEN and not as_stops and _agreement(values * gains, brightness) <= -MIN_AGREEMENT:
        values = 1 / values
        notes.append(f"The numbers of {source} are 1/seconds: the larger the number, the darker the photograph.")
    return values * gains, notes


def _agreement(values, brightness) -> float:
    """1 where the larger value is the brighter photograph for every pair, -1 where for none; ties do not count."""
    i, j = np.triu_indices(len(values), 1)
    brighter = brightness[j] - brightness[i]
    told = np.abs(brighter) >= TIE
    return float(np.sign((values[j] - values[i]) * brighter)[told].mean()) if told.any() else 1.0


def _may_be_stops(values) -> bool:
    """Whether numbers, some of them not positive, are EV steps and not times with a slip of the pen."""
    steps = np.diff(np.sort(values))
    return values.min() <= 0 and np.abs(values).max() <= EV_REACH and steps.min() >= EV_STEP


def _same(a, b) -> bool:
    """Whether two lists of positive numbers agree but for one factor and for rounding."""
    return bool(np.ptp(np.log(a) - np.log(b)) < 2 * ROUNDING)


def _differences(names, chosen: Times, other: Times) -> list[str]:
    """Where another source gives other times, a sentence with both."""
    ratio = other.seconds / chosen.seconds
    factor = np.median(ratio)
    notes = [
        f"{names[i]}: {chosen.seconds[i]:.4g} s by {chosen.source}, {other.seconds[i]:.4g} s by {other.source}."
        for i in np.flatnonzero(np.abs(ratio / factor - 1) > ROUNDING)
    ]
    if len(notes) < len(names) / 2 and abs(factor - 1) > 2 * ROUNDING:
        notes.append(
            f"The times are relative: those of {other.source} are {factor:.3g} times those of {chosen.source}."
        )
    return notes
