"""One photograph: from the bytes of a file to an upright RGB picture and what the camera wrote into it."""

import re
import struct
from typing import NamedTuple

import cv2
import numpy as np

from hdr_helpers._reading import BracketError

MAX_PIXELS = 200_000_000  # of one photograph; a small file can unpack to a huge picture
TURNS = {  # by EXIF orientation, from a picture (H, W) as it is stored to the upright one; 1, and 0 and 9, are none
    2: np.fliplr,
    3: lambda stored: np.rot90(stored, 2),
    4: np.flipud,
    5: np.transpose,
    6: lambda stored: np.rot90(stored, -1),
    7: lambda stored: np.rot90(stored, 2).T,
    8: np.rot90,
}
TIFF_MARKS, PNG_MARK, JPEG_MARK = (b"II*\0", b"MM\0*"), b"\x89PNG", b"\xff\xd8"


class Exif(NamedTuple):
    """What EXIF says of the exposure; None where it says nothing of use (missing, zero, 0/0).

    seconds : ExposureTime; iso : PhotographicSensitivity; f_number : FNumber; orientation : 1 is upright
    """

    seconds: float | None = None
    iso: float | None = None
    f_number: float | None = None
    orientation: float | None = None


class Photograph(NamedTuple):
    """image : (H, W, 3) uint8 or uint16, RGB, upright; opaque : (H, W) bool, or None where all of it is"""

    image: np.ndarray
    opaque: np.ndarray | None
    exif: Exif


def decode(name: str, data: bytes) -> Photograph:
    """Read one photograph.

    name : for messages; data : the file's bytes. Grey, indexed and CMYK pictures become RGB.
    Raises BracketError where it can't be read, is cut short, or holds something other than 8 or 16 bits.
    """
    heading = re.sub(rb"#[^\n]*", b" ", data[:2000]) if data[:1] == b"P" else b""
    shades = re.match(rb"P[2356]\s+\d+\s+\d+\s+(\d+)\s", heading)
    if shades and shades[1] not in (b"255", b"65535"):  # OpenCV would scale others wrongly
        raise BracketError(
            f"{name} has values up to {shades[1].decode()}; save it with 8 or 16 bits, up to 255 or 65535."
        )
    if data[:4] == PNG_MARK and len(data) > 24:  # no other kind packs so much into so little
        _check_size(name, *struct.unpack_from(">II", data, 16))
    image, kinds, metadata = _decode(data, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)
    if image is None or not _has_end(data):
        raise BracketError(
            f"{name} can't be read as a picture: it is cut short, damaged or of another kind; copy it again, "
            "or save it as JPEG, PNG, TIFF, BMP or PPM of 8 or 16 bits."
        )
    if image.dtype not in (np.uint8, np.uint16):
        raise BracketError(f"{name} holds {image.dtype} values; photographs of 8 or 16 bits can be used.")
    _check_size(name, *image.shape[:2])
    block = dict(zip(map(int, kinds), metadata, strict=False)).get(cv2.IMAGE_METADATA_EXIF)
    exif = read_exif(bytes(block) if block is not None else data if data[:4] in TIFF_MARKS else b"")
    return Photograph(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), _opaque(data, exif), exif)


def _decode(data: bytes, flags: int):
    try:
        return cv2.imdecodeWithMetadata(np.frombuffer(data, np.uint8), flags)
    except cv2.error as problem:
        if problem.code == cv2.Error.StsNoMem:
            raise MemoryError from None
        return None, (), ()


def _check_size(name: str, height: int, width: int) -> None:
    if height * width > MAX_PIXELS:
        raise BracketError(
            f"{name} has {height * width / 1e6:.0f} million pixels; scale it below {MAX_PIXELS / 1e6:.0f} million."
        )


def _has_end(data: bytes) -> bool:
    """Whether a JPEG has its end mark; an interrupted copy may hold zeros there, which decode to grey."""
    at = 2
    while data[:2] == JPEG_MARK and at + 4 <= len(data) and data[at] == 0xFF:
        if data[at + 1] == 0xDA:  # here the picture begins; before it stood EXIF, perhaps with a whole thumbnail
            return b"\xff\xd9" in data[at:]
        at += 2 + struct.unpack_from(">H", data, at + 2)[0]
    return True


def _opaque(data: bytes, exif: Exif) -> np.ndarray | None:
    """Where a picture with an alpha channel isn't transparent: programs that align leave such borders."""
    if data[:4] not in TIFF_MARKS and not (data[:4] == PNG_MARK and data[25:26] in (b"\4", b"\6")):
        return None
    raw = _decode(data, cv2.IMREAD_UNCHANGED)[0]
    if raw is None or raw.ndim != 3 or raw.shape[2] != 4 or raw[..., 3].all() or not raw[..., 3].any():
        return None
    opaque = raw[..., 3] > 0
    # Only this flag keeps alpha; with it OpenCV turns a TIFF as its orientation says, and a PNG not.
    turn = TURNS.get(exif.orientation) if data[:4] == PNG_MARK else None
    return turn(opaque) if turn else opaque


def read_exif(block: bytes) -> Exif:
    """The exposure's tags from a raw EXIF block, which is a small TIFF file; empty where it is odd."""
    tiff = block.removeprefix(b"Exif\0\0")
    order = {b"II": "<", b"MM": ">"}.get(tiff[:2])

    def directory(at: int) -> dict[int, float]:
        """From tag to value, for values that are a single SHORT (3), LONG (4) or RATIONAL (5)."""
        found = {}
        (entries,) = struct.unpack_from(order + "H", tiff, at)
        for entry in range(at + 2, at + 2 + 12 * entries, 12):
            tag, kind, _, value = struct.unpack_from(order + "HHII", tiff, entry)
            if kind == 3:
                (found[tag],) = struct.unpack_from(order + "H", tiff, entry + 8)
            elif kind == 4:
                found[tag] = value
            elif kind == 5 and value + 8 <= len(tiff):
                numerator, denominator = struct.unpack_from(order + "II", tiff, value)
                found[tag] = numerator / denominator if denominator else 0.0
        return found

    try:
        main = directory(struct.unpack_from(order + "I", tiff, 4)[0])
        exposure = main | (directory(main[0x8769]) if 0x8769 in main else {})
    except (struct.error, TypeError):  # no byte order mark, or cut short
        return Exif()
    if exposure.get(0x8827) == 65535:  # the value is too large for its tag
        del exposure[0x8827]
    return Exif(*(exposure.get(tag) or None for tag in (0x829A, 0x8827, 0x829D)), main.get(0x0112))
