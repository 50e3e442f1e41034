"""Photographs for several test files: written with EXIF of any kind, or loaded once."""

import struct
from functools import cache
from typing import NamedTuple

import cv2
import numpy as np

from hdr_helpers.load import in_8_bits, load_bracket


def exif_block(order="<", seconds=None, iso=None, f_number=None):
    """A TIFF header, a pointer, and an Exif directory with ExposureTime, FNumber and ISO, where given.

    seconds, f_number : (numerator, denominator); iso : integer
    """
    mark = {"<": b"II", ">": b"MM"}[order]
    given = [(0x829A, seconds), (0x829D, f_number), (0x8827, iso)]
    given = [(tag, value) for tag, value in given if value is not None]
    end = 26 + 2 + 12 * len(given) + 4
    directory, fractions = struct.pack(order + "H", len(given)), b""
    for tag, value in given:
        if isinstance(value, tuple):
            directory += struct.pack(order + "HHII", tag, 5, 1, end + len(fractions))
            fractions += struct.pack(order + "II", *value)
        else:
            directory += struct.pack(order + "HHIHH", tag, 3, 1, value, 0)
    first = struct.pack(order + "HHHIII", 1, 0x8769, 4, 1, 26, 0)
    return mark + struct.pack(order + "HI", 42, 8) + first + directory + bytes(4) + fractions


def write_with_exif(path, image, exif):
    """Write an RGB image with a raw EXIF block."""
    kinds, blocks = [cv2.IMAGE_METADATA_EXIF], [np.frombuffer(exif, np.uint8)]
    _, data = cv2.imencodeWithMetadata(path.suffix, np.ascontiguousarray(image[..., ::-1]), kinds, blocks)
    path.write_bytes(data.tobytes())


class Known(NamedTuple):
    """What is asked of a bracket again and again: its notes, and what the photographs are judged by."""

    names: tuple[str, ...]
    times: np.ndarray
    notes: tuple[str, ...]
    histograms: np.ndarray
    valid: tuple[np.ndarray, ...] | None


def histograms(images):
    return np.array([np.bincount(in_8_bits(image)[..., 1].ravel(), minlength=256) for image in images])


@cache
def known(folder):
    """A bracket on disk is read once, whatever the number of tests."""
    bracket = load_bracket(folder)
    return Known(bracket.names, bracket.times, bracket.notes, histograms(bracket.images), bracket.valid)
