"""Photographs for several test files: written with EXIF of any kind, or loaded once."""

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np

from hdr_helpers.load import in_8_bits, load_bracket


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
