"""Stage 1: read a bracket, the photographs of one scene at several exposure times.

How exposure times are found and decided is in _times.py.
"""

import io
import itertools
import re
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import cv2
import numpy as np

from hdr_helpers._times import (
    IMAGE_SUFFIXES,
    TEXT_SUFFIXES,
    BracketError,
    exif_exposure_time,
    find_times,
)

MAX_BYTES = 4 * 2**30  # what a zip may unpack to, all files together


@dataclass(frozen=True)
class Truth:
    """What a virtual camera knows about its own photographs.

    radiance : (H, W, 3) float32, relative linear radiance behind the lens, RGB
    crf : (3, 256) float64, log inverse response of each channel, crf[:, 128] = 0
    shifts : (P, 2) int, (dx, dy) pixels by which the hand moved each picture right and down, or None
    """

    radiance: np.ndarray
    crf: np.ndarray
    shifts: np.ndarray | None = None


@dataclass(frozen=True)
class Bracket:
    """Photographs of one scene, shortest exposure first.

    images : tuple of P arrays (H, W, 3) uint8, RGB
    times : (P,) float64, exposure times in seconds, strictly ascending
    names : tuple of P file names
    source : where the times came from, for people
    notes : sentences for people: what was decided or looked odd while loading
    truth : Truth where the camera was a virtual one, else None

    Raises BracketError where these do not fit each other.
    """

    images: tuple[np.ndarray, ...]
    times: np.ndarray
    names: tuple[str, ...]
    source: str = "given"
    notes: tuple[str, ...] = ()
    truth: Truth | None = None

    def __post_init__(self):
        times = np.asarray(self.times, dtype=np.float64)
        if not len(self.images) == len(times) == len(self.names):
            raise BracketError(
                f"{len(self.images)} images, {len(times)} times and {len(self.names)} names were given; "
                "there must be one of each for every exposure."
            )
        if len(times) < 2:
            raise BracketError("A bracket needs at least two photographs with different exposure times.")
        for name, image in zip(self.names, self.images, strict=True):
            if image.shape != self.images[0].shape:
                raise BracketError(
                    f"{name} is {_size(image)} pixels, {self.names[0]} is {_size(self.images[0])}; "
                    "all photographs of a bracket must have the same size."
                )
        if not np.all(np.isfinite(times)) or times[0] <= 0 or np.any(np.diff(times) <= 0):
            raise BracketError(f"Exposure times must be positive and strictly ascending; got {times.tolist()} seconds.")
        object.__setattr__(self, "times", times)

    def __len__(self):
        return len(self.images)

    @property
    def log_times(self) -> np.ndarray:
        """(P,) float64, natural logarithm of the times: B in the paper, ln seconds."""
        return np.log(self.times)


def load_bracket(path) -> Bracket:
    """Read every photograph of a folder or zip, with its exposure time.

    path : folder or .zip that holds the photographs (JPEG, PNG, TIFF, BMP or PPM) and, if the times
        are neither in the file names nor in EXIF, one text file that lists them

    Returns a Bracket in ascending time. 16-bit files are reduced to 8 bits.
    Raises BracketError where the photographs or the times can't be used.
    """
    path = Path(path)
    files = _zip_files(path) if zipfile.is_zipfile(path) else _folder_files(path)
    names = sorted((n for n in files if n.lower().endswith(IMAGE_SUFFIXES)), key=_natural)
    if len(names) < 2:
        raise BracketError(
            f"{path} holds {len(names)} photographs; a bracket needs at least two of "
            f"{', '.join(IMAGE_SUFFIXES)} in one folder. HEIC and raw files have to be exported as JPEG first."
        )
    images, exif = zip(*(_decode(name, files[name]()) for name in names), strict=True)
    texts = {n: files[n]() for n in sorted(files) if n.lower().endswith(TEXT_SUFFIXES)}
    brightness = np.array([image[::4, ::4].mean() for image in images])
    times, source, notes = find_times(path, names, texts, exif, brightness)

    order = np.argsort(times, kind="stable")
    for a, b in itertools.pairwise(order):
        if times[a] == times[b]:
            raise BracketError(
                f"{names[a]} and {names[b]} have the same exposure time, {times[a]:g} s, by {source}; "
                "keep one of them, or correct its time."
            )
    return Bracket(tuple(images[i] for i in order), times[order], tuple(names[i] for i in order), source, tuple(notes))


# ---------------------------------------------------------------------------------------- files


def _folder_files(path: Path) -> dict[str, Callable[[], bytes]]:
    if not path.is_dir():
        state = "is neither a folder nor a zip" if path.exists() else "does not exist"
        raise BracketError(f"{path} {state}; give the folder or zip that holds the photographs.")
    return {p.name: p.read_bytes for p in path.iterdir() if p.is_file() and not p.name.startswith(".")}


def _zip_files(path: Path) -> dict[str, Callable[[], bytes]]:
    """The files of the one folder inside the zip that holds the most photographs, read in memory."""
    archive = zipfile.ZipFile(io.BytesIO(path.read_bytes()))
    members = [m for m in archive.infolist() if not m.is_dir() and "__MACOSX" not in m.filename]
    total = sum(m.file_size for m in members)
    if total > MAX_BYTES:
        raise BracketError(f"{path} unpacks to {total / 2**30:.1f} GB; up to {MAX_BYTES / 2**30:.0f} GB are read.")
    photographs = [PurePosixPath(m.filename).parent for m in members
                   if m.filename.lower().endswith(IMAGE_SUFFIXES)]  # fmt: skip
    home = max(photographs, key=photographs.count, default=PurePosixPath("."))
    return {
        p.name: lambda m=m: _unpack(archive, m, path)
        for m in members
        if (p := PurePosixPath(m.filename)).parent == home and not p.name.startswith(".")
    }


def _unpack(archive: zipfile.ZipFile, member: zipfile.ZipInfo, path: Path) -> bytes:
    try:
        return archive.read(member)
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, NotImplementedError) as problem:
        raise BracketError(
            f"{member.filename} can't be unpacked from {path} ({problem}); make the zip again, without a password."
        ) from None


def _decode(name: str, data: bytes) -> tuple[np.ndarray, float | None]:
    """One photograph as RGB uint8, upright, and its EXIF exposure time in seconds where it has one."""
    try:
        image, kinds, metadata = cv2.imdecodeWithMetadata(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        image = None
    if image is None:
        raise BracketError(
            f"{name} can't be read as a picture; JPEG, PNG, TIFF, BMP and PPM files of 8 or 16 bits can."
        )
    exif = {int(k): bytes(m) for k, m in zip(kinds, metadata, strict=False)}.get(cv2.IMAGE_METADATA_EXIF)
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB), exif_exposure_time(exif) if exif else None


def _size(image: np.ndarray) -> str:
    return f"{image.shape[1]} x {image.shape[0]}"


def _natural(name: str) -> list:
    """Sort key under which img2 comes before img10."""
    return [int(part) if part.isdigit() else part.lower() for part in re.split(r"(\d+)", name)]
