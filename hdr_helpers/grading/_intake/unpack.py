"""What lies in a folder or a zip, also in zips within: read in memory and within bounds, nothing is written to disk."""

import io
import os
import re
import stat
import time
import unicodedata
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

TOTAL = 200_000_000  # bytes of one submission, at most; of the zips within it too
ENTRIES = 20_000  # files and folders of one submission
DIRECTORY = 32_000_000  # bytes of a zip's list of entries, which is in memory as a whole
DEPTH = 3  # zips in each other, below the place that is collected
LONGEST = 300  # characters of a name; of a longer one the middle is left out
PASSED_OVER = {"__macosx", "__pycache__", "thumbs.db", "desktop.ini", "venv", "node_modules", "site-packages"}
ARCHIVES = (".7z", ".rar", ".tar", ".gz", ".tgz", ".bz2", ".xz")
TOO_LARGE = "is too large: a notebook may have 50 MB, and everything of one student 200 MB"
FAST = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


class Trouble(Exception):
    """Why a file or a zip can't be used: a sentence that has yet to get its subject."""


@dataclass(frozen=True)
class Entry:
    """A file or a folder, or a zip that can't be opened. parts : of its path, folders and zips and its own name"""

    parts: tuple[str, ...]
    kind: str  # "notebook", "folder" (zips and other archives too) or "other"
    modified: tuple[int, ...] = ()  # year, month, day, hour, minute, second
    read: Callable[[int], bytes] | None = None  # read(limit) raises Trouble where the file has more bytes
    trouble: str = ""  # why it can't be used

    @property
    def path(self) -> str:
        return shown("/".join(self.parts))


@dataclass(frozen=True)
class Zip:
    """A zip: a file, or an entry of another zip. places : in the zip around it, one for each zip on the way"""

    path: Path
    places: tuple[int, ...] = ()


def shown(name: str) -> str:
    """A name in quotes, on one line and not too long, for a sentence."""
    return repr(name if len(name) <= 120 else f"{name[:50]}...{name[-60:]}")


def entries_of(path: Path) -> list[Entry]:
    """Everything in a folder or a zip that is not passed over.

    Raises Trouble where path is a file and can't be opened as a zip; troubles further down are told by the entries.
    """
    return list(_in_folder(path) if path.is_dir() else _in_zip(Zip(path), (), None))


def forget() -> None:
    """Close the zips that are still open."""
    _opened.cache_clear()


def is_passed_over(name: str) -> bool:
    """Is this nothing that a person has made? What is hidden, what systems leave about, installed packages."""
    return name.startswith(".") or name.casefold() in PASSED_OVER


def _kind(name: str) -> str:
    suffix = os.path.splitext(name)[1].lower()
    return {".ipynb": "notebook", ".zip": "zip"}.get(suffix, "archive" if suffix in ARCHIVES else "other")


def _in_folder(root: Path) -> Iterator[Entry]:
    failed = []
    for folder, folders, names in os.walk(root, onerror=failed.append):
        above = Path(folder).relative_to(root).parts
        folders[:] = sorted(name for name in folders if not is_passed_over(name))
        for name in folders + sorted(name for name in names if not is_passed_over(name)):
            place, parts = Path(folder, name), tuple(map(_readable, (*above, name)))
            kind = "folder" if name in folders else _kind(name)
            # A link from one student's place into another's would hand in another's work.
            if kind != "other" and _leads_out(place, root / (*above, name)[0]):
                yield _entry(parts, kind, trouble="is a link to somewhere else and was not followed")
            elif kind in ("notebook", "zip") and not place.is_file():
                yield _entry(parts, kind, trouble="is no ordinary file")
            elif kind == "zip":
                yield from _in_zip(Zip(place), parts, Counter())
            else:
                yield _entry(parts, kind, _modified(place), lambda limit, place=place: _of_file(place, limit))
    for problem in failed:
        parts = Path(problem.filename).relative_to(root).parts
        yield _entry(parts or (root.name,), "folder", trouble=f"can't be read ({problem.strerror})")


def _entry(parts, kind, modified=(), read=None, trouble="") -> Entry:
    if kind == "archive":
        trouble = trouble or "is an archive that can't be opened here; ask for a zip"
    return Entry(parts, "folder" if kind in ("archive", "zip") else kind, modified, read, trouble)


def _leads_out(place: Path, home: Path) -> bool:
    try:
        return not place.resolve(strict=True).is_relative_to(home)
    except (OSError, RuntimeError):  # a link that ends nowhere, or in itself
        return True


def _modified(place: Path) -> tuple[int, ...]:
    try:
        return tuple(time.localtime(place.stat().st_mtime)[:6])
    except (OSError, ValueError, OverflowError):
        return ()


def _of_file(place: Path, limit: int) -> bytes:
    try:
        if place.stat().st_size > limit:
            raise Trouble(TOO_LARGE)
        return place.read_bytes()
    except OSError as problem:
        raise Trouble(f"can't be read ({problem.strerror})") from None


def _in_zip(place: Zip, parts: tuple[str, ...], spent: Counter | None) -> Iterator[Entry]:
    """What is in a zip. parts : of its path; spent : on this student's zips so far, or None for the whole class's"""
    try:
        infos = _opened(place).infolist()
        if spent is not None:
            spent["entries"] += len(infos)
            if spent["entries"] > ENTRIES:
                raise Trouble(f"was not opened, for with it there are more than {ENTRIES} files")
    except Trouble as problem:
        if not parts:
            raise
        yield Entry(parts, "folder", trouble=str(problem))
        return
    if parts:
        yield Entry(parts, "folder")
    for k, info in enumerate(infos):
        below = _parts(info)
        if not below or any(map(is_passed_over, below)):
            continue
        inside, kind = parts + below, "folder" if info.is_dir() else _kind(below[-1])
        if kind == "zip":
            yield from _zip_in_zip(Zip(place.path, (*place.places, k)), inside, info, spent)
        else:
            yield _entry(inside, kind, info.date_time, lambda limit, k=k: _of_zip(_opened(place), k, limit))


def _zip_in_zip(place: Zip, parts: tuple[str, ...], info: zipfile.ZipInfo, spent: Counter | None) -> Iterator[Entry]:
    spent = Counter() if spent is None else spent
    spent["bytes"] += info.file_size
    if sum(part.lower().endswith(".zip") for part in parts) > DEPTH:
        yield Entry(parts, "folder", trouble=f"was not opened, for it is a zip in {DEPTH} others")
    elif spent["bytes"] > TOTAL:
        yield Entry(parts, "folder", trouble=f"was not opened, for zips may have {TOTAL / 1e6:g} MB in all")
    else:
        yield from _in_zip(place, parts, spent)


@lru_cache(maxsize=DEPTH + 2)  # a zip with all that are around it; more would fill the memory
def _opened(place: Zip) -> zipfile.ZipFile:
    try:
        if place.places:
            file = io.BytesIO(_of_zip(_opened(Zip(place.path, place.places[:-1])), place.places[-1], TOTAL))
            _check_directory(file)
        else:
            file = place.path
            with open(file, "rb") as opened:
                _check_directory(opened)
        return zipfile.ZipFile(file)
    except Trouble:
        raise
    except Exception as problem:  # zipfile has no one exception for what damage can do
        raise Trouble(f"can't be opened as a zip ({problem})") from None


def _check_directory(file) -> None:
    """Raise Trouble where a zip's list of entries is too long to be read; both kinds of records at its end tell."""
    file.seek(max(0, file.seek(0, os.SEEK_END) - 70_000))
    tail = file.read()
    for mark, place, width in ((b"PK\5\6", 12, 4), (b"PK\6\6", 40, 8)):
        at = tail.rfind(mark)
        size = int.from_bytes(tail[at + place : at + place + width], "little") if at >= 0 else 0
        if size > DIRECTORY and size != 0xFFFFFFFF:  # which says: see the other record
            raise Trouble("was not opened, for its list of files is too long")


def _of_zip(archive: zipfile.ZipFile, place: int, limit: int) -> bytes:
    info = archive.infolist()[place]
    if info.flag_bits & 1:
        raise Trouble("is encrypted")
    if stat.S_ISLNK(info.external_attr >> 16):
        raise Trouble("is a link and was not followed")
    if info.file_size > limit:  # zipfile unpacks no more than what is said here
        raise Trouble(TOO_LARGE)
    # Other methods unpack all that they are given at once, so they are given little.
    step, pieces = 1 << 20 if info.compress_type in FAST else 4096, []
    try:
        with archive.open(info) as file:
            while piece := file.read(step):
                pieces.append(piece)
    except Exception as problem:  # damage shows as one of a dozen exceptions
        raise Trouble(f"can't be unpacked ({problem})") from None
    return b"".join(pieces)


def _parts(info: zipfile.ZipInfo) -> tuple[str, ...]:
    """Folders and name of an entry. Drives, roots and steps upwards are left out: they would lead nowhere anyway."""
    name = info.filename
    if not info.flag_bits & 0x800:  # the name is not marked as UTF-8, and zipfile has taken it for cp437
        name = _decoded(name)
    parts = re.split(r"[/\\]", re.sub(r"^[A-Za-z]:", "", name))
    return tuple(map(_readable, (part for part in parts if part.strip() not in ("", ".", ".."))))


def _decoded(name: str) -> str:
    """A name as it was meant, where zipfile took UTF-8 or GBK for cp437."""
    try:
        raw = name.encode("cp437")
        return raw.decode("utf-8")
    except UnicodeEncodeError:
        return name
    except UnicodeDecodeError:
        pass
    if all(c.isalpha() for c in name if c > "\x7f"):
        return name  # cp437 was right: GBK taken for it has signs and frames between its letters
    try:
        return raw.decode("gbk")
    except UnicodeDecodeError:
        return name


def _readable(name: str) -> str:
    """One form for accented letters, bytes that are no UTF-8 read as GBK or replaced, and not endlessly long."""
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:
        raw = name.encode("utf-8", "surrogateescape" if re.search("[\udc80-\udcff]", name) else "replace")
        name = raw.decode("gbk", "replace")
    name = unicodedata.normalize("NFC", name)
    return name if len(name) <= LONGEST else f"{name[: LONGEST // 2]}{name[-LONGEST // 2 :]}"
