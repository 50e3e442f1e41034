"""The files of a bracket, from a folder or a zip. Nothing is ever unpacked to disk."""

import io
import lzma
import os
import re
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path, PurePosixPath

from hdr_helpers._reading import IMAGE_SUFFIXES, BracketError

MAX_BYTES = 4 * 2**30  # what a zip may hold, all files together, packed or unpacked
DAMAGE = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError, RuntimeError, ValueError)  # in a zip
MAX_DEPTH = 3  # folders inside folders: unpacking a zip often leaves one or two


def bracket_files(path: Path) -> dict[str, Callable[[], bytes]]:
    """From each file name in the bracket's folder to a function that reads the file.

    path : folder or zip; where it holds no photographs itself, the one folder inside that does is taken, with the
        text files on the way to it
    Raises BracketError where there is no such place, more than one, or a zip that can't be unpacked.
    """
    if os.path.isdir(path):  # unlike Path.is_dir it has an answer for a name that is too long
        files = _folder_files(path)
    elif os.path.isfile(path) and zipfile.is_zipfile(path):
        files = _zip_files(path)
    else:
        state = "is neither a folder nor a zip" if os.path.exists(path) else "does not exist"
        if path.suffix.lower() == ".zip" and os.path.isfile(path):
            state = "is cut short, or no zip"
        raise BracketError(f"{path} {state}; give the folder or zip that holds the photographs.")
    home = _home(files, path)
    # The list may lie above a folder of photographs; the nearest counts.
    texts = [f for f in files if f.parent in home.parents and not is_photograph(f.name)]
    inside = sorted(texts, key=lambda f: len(f.parts)) + [f for f in files if f.parent == home]
    return {f.name: files[f] for f in inside}


def natural(name: str) -> list:
    """Sort key under which img2 comes before img10, and img_0.6 before img_15."""
    parts = re.split(r"([0-9]+(?:\.[0-9]+)?)", name)  # every second one is a number
    return [float(part) if i % 2 else part.lower() for i, part in enumerate(parts)]


def is_photograph(name: str) -> bool:
    """Whether a file is a photograph, by its suffix."""
    return name.lower().endswith(IMAGE_SUFFIXES)


def _home(files: Iterable[PurePosixPath], path: Path) -> PurePosixPath:
    """The folder with the photographs: the outermost that holds at least two."""
    count = Counter(f.parent for f in files if is_photograph(f.name))
    full = [folder for folder, photographs in count.items() if photographs > 1]
    homes = [folder for folder in full if len(folder.parts) == min(len(f.parts) for f in full)]
    if len(homes) > 1:
        several = " and ".join(sorted(map(str, homes))[:2])
        raise BracketError(
            f"{path} holds photographs in {len(homes)} folders, {several}{' among them' * (len(homes) > 2)}; "
            "give the one folder that is the bracket."
        )
    return homes[0] if homes else PurePosixPath(".")


def _hidden(file: PurePosixPath) -> bool:
    """What systems add on their own: .DS_Store, ._copies, __MACOSX."""
    return any(part.startswith((".", "__MACOSX")) for part in file.parts)


def _folder_files(path: Path) -> dict[PurePosixPath, Callable[[], bytes]]:
    found = {}
    for depth in range(MAX_DEPTH):
        level = path.glob("/".join(["*"] * (depth + 1)))
        files = {PurePosixPath(p.relative_to(path).as_posix()): p for p in level if p.is_file()}
        found |= {name: _reader(p) for name, p in files.items() if not _hidden(name)}
        if max(Counter(f.parent for f in found if is_photograph(f.name)).values(), default=0) > 1:
            break  # do not wander through the rest of someone's disk
    return found


def _reader(path: Path) -> Callable[[], bytes]:
    def read():
        try:
            return path.read_bytes()
        except OSError as problem:
            raise BracketError(
                f"{path.name} can't be read ({problem.strerror}); check that it may be opened."
            ) from None

    return read


def _zip_files(path: Path) -> dict[PurePosixPath, Callable[[], bytes]]:
    size = path.stat().st_size
    if size <= MAX_BYTES:
        try:
            archive = zipfile.ZipFile(io.BytesIO(path.read_bytes()))
        except DAMAGE as problem:
            raise BracketError(f"{path} is damaged ({problem}); fetch it again, or make the zip again.") from None
        members = {_member_path(m): m for m in archive.infolist() if not m.is_dir()}
        members = {name: m for name, m in members.items() if not _hidden(name)}
        size = sum(m.file_size for m in members.values())
    if size > MAX_BYTES:
        raise BracketError(
            f"{path} unpacks to {size / 2**30:.1f} GB; up to {MAX_BYTES / 2**30:.0f} GB are read. "
            "Put only the bracket into it, or scale the photographs down."
        )
    return {name: lambda m=m: _unpack(archive, m, path) for name, m in members.items()}


def _member_path(member: zipfile.ZipInfo) -> PurePosixPath:
    """A member's path without what would lead out of a folder; Chinese Windows packs names as GBK."""
    name = member.filename
    if not member.flag_bits & 0x800:  # not marked as UTF-8, so zipfile took it for code page 437
        raw = name.encode("cp437", errors="replace")
        for encoding in ("utf-8", "gb18030"):
            try:
                name = raw.decode(encoding)
                break
            except UnicodeDecodeError:
                continue
    parts = PurePosixPath(name.replace("\\", "/")).parts
    return PurePosixPath(*(part for part in parts if part not in ("/", "..")))


def _unpack(archive: zipfile.ZipFile, member: zipfile.ZipInfo, path: Path) -> bytes:
    try:
        if member.flag_bits & 1:
            raise RuntimeError("it has a password")
        with archive.open(member) as file:
            return file.read(member.file_size)  # read() alone would unpack whatever is there
    except DAMAGE as problem:
        raise BracketError(
            f"{member.filename} can't be unpacked from {path} ({problem}); make the zip again, without a password."
        ) from None
