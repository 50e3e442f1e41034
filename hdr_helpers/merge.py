"""Stage 4: merge the exposures of a bracket into one radiance map.

After Debevec and Malik 1997, equation 6: the log irradiance of a pixel is the weighted mean of what each
photograph says of it, ln E = sum_j w(Z_j) (g(Z_j) - ln dt_j) / sum_j w(Z_j).

Both sums depend on a photograph only through its pixel value, so each is a table of 256 entries a
channel, and merging is looking up and adding.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from hdr_helpers.crf import LEVELS, checked_weights, fitted_weights, whole_white

LAST_RESORT = 1e-5  # of the largest weight: decides only where no photograph has any other weight
LEAST = 1e-9  # of the largest weight: no sum of weights is 0, whatever the values
TILE_ROWS = 64  # rows merged at a time: the working arrays stay in the processor's cache


@dataclass(frozen=True)
class Clipping:
    """Shares, 0 to 1, of pixels in which at least one channel can't be used.

    too_dark, too_bright : (P,) float64, for each photograph
    everywhere_dark, everywhere_bright : share of pixels that are too dark, or too bright, in every one
    """

    too_dark: np.ndarray
    too_bright: np.ndarray
    everywhere_dark: float
    everywhere_bright: float


def clipping(images) -> Clipping:
    """How much of each photograph is too dark or too bright to be used, and how much in all of them.

    images : P arrays (H, W, 3) uint8, shortest exposure first. Usable is what fitted_weights gives a weight.
    """
    usable = np.flatnonzero(fitted_weights(images))
    dark = np.array([(image < usable[0]).any(axis=2) for image in images])
    bright = np.array([(image > usable[-1]).any(axis=2) for image in images])
    shares = dark.mean(axis=(1, 2)), bright.mean(axis=(1, 2))
    return Clipping(*shares, float(dark.all(axis=0).mean()), float(bright.all(axis=0).mean()))


def merge_debevec(images, times, crf, w=None) -> np.ndarray:
    """Radiance map from a bracket and the camera's response (equation 6, one channel at a time).

    images : P arrays (H, W, 3) uint8, RGB
    times : (P,) exposure times in seconds
    crf : (3, 256) float, log inverse response of each channel
    w : (256,) float, weight of each pixel value; None takes fitted_weights(images)

    Returns radiance, (H, W, 3) float32, RGB, relative, finite and positive everywhere. A pixel that is
    clipped in every photograph gets what the shortest exposure says, one that is black in every photograph
    what the longest says: the nearest bound, so that the brightest part of a scene stays the brightest.
    Raises ValueError where shapes or values don't fit.
    """
    images, times, crf = list(images), np.asarray(times, dtype=np.float64), np.asarray(crf, dtype=np.float64)
    if len(images) != len(times) or not len(images):
        raise ValueError(f"One exposure time for each photograph is needed; got {len(times)} for {len(images)}.")
    for image in images:
        if image.dtype != np.uint8 or image.shape != images[0].shape or image.shape[2:] != (3,):
            raise ValueError(f"Images must be uint8 of one size (H, W, 3); got {image.dtype} {image.shape}.")
    if not (np.all(np.isfinite(times)) and np.all(times > 0)):
        raise ValueError(f"Exposure times must be positive seconds; got {times.tolist()}.")
    if crf.shape != (3, LEVELS) or not np.all(np.isfinite(crf)):
        raise ValueError(f"crf must be (3, {LEVELS}) and finite; got {crf.shape}.")
    shortest_first = [images[i] for i in np.argsort(times)]
    w = fitted_weights(shortest_first) if w is None else checked_weights(w)
    # In the shortest exposure even a doubtful value is better than none: nothing sees more.
    settled = [image if t == times.min() else whole_white(image) for image, t in zip(images, times, strict=True)]
    return _merge_by_tables(settled, *_tables(times, crf, w))


def _tables(times, crf, w) -> tuple[np.ndarray, np.ndarray]:
    """w(z) (g(z) - ln dt) and w(z) for every photograph, each (P, 1, 256, 3) float32 as cv2.LUT wants it."""
    weights = np.maximum(np.tile(w, (len(times), 1)), LEAST * w.max())
    # Where no photograph is usable the nearest bound decides: of the bright values the shortest exposure's,
    # of the dark ones the longest's.
    bright, dark = np.s_[np.argmin(times), LEVELS // 2 :], np.s_[np.argmax(times), : LEVELS // 2]
    for side in (bright, dark):
        weights[side] = np.maximum(weights[side], LAST_RESORT * w.max())
    weighted = weights[..., None] * (crf.T - np.log(times)[:, None, None])
    weights = np.repeat(weights[..., None], 3, axis=2)
    return tuple(np.ascontiguousarray(t[:, None], dtype=np.float32) for t in (weighted, weights))


def _merge_by_tables(images, weighted, weights) -> np.ndarray:
    """Look up and add, some rows at a time; equation 6 and the exponential at the end."""
    radiance = np.empty(images[0].shape, dtype=np.float32)
    for top in range(0, len(radiance), TILE_ROWS):
        rows = np.s_[top : top + TILE_ROWS]
        numerator = cv2.LUT(images[0][rows], weighted[0])
        denominator = cv2.LUT(images[0][rows], weights[0])
        for image, table, weight in zip(images[1:], weighted[1:], weights[1:], strict=True):
            cv2.accumulate(cv2.LUT(image[rows], table), numerator)
            cv2.accumulate(cv2.LUT(image[rows], weight), denominator)
        cv2.exp(cv2.divide(numerator, denominator), radiance[rows])
    return radiance


def merge_opencv(images, times, crf=None) -> np.ndarray:
    """OpenCV's MergeDebevec behind this course's conventions: any float times, crf (3, 256), radiance out.

    Returns radiance, (H, W, 3) float32, in the channel order of images. Where every photograph is clipped
    the result may be 0 or not finite: that is OpenCV's own answer. Without crf OpenCV takes the camera for a
    linear one.
    """
    images, merge = [np.ascontiguousarray(image) for image in images], cv2.createMergeDebevec()
    times = np.asarray(times, dtype=np.float32)  # with float64 it answers zeros and infinities, and says nothing
    if crf is None:
        return merge.process(images, times)
    return merge.process(images, times, np.exp(crf).T[:, None].astype(np.float32).copy())


def write_hdr(path, radiance) -> None:
    """Write a radiance map as Radiance RGBE (.hdr), which other HDR programs read.

    radiance : (H, W, 3) float, RGB. The file is complete or not there. RGBE keeps about 1% of the strongest
    channel; keep radiance itself (np.save) where more is wanted.
    """
    path = Path(path)
    done, data = cv2.imencode(".hdr", np.ascontiguousarray(radiance[..., ::-1], dtype=np.float32))
    if not done:
        raise ValueError(f"{path}: OpenCV could not write this radiance map of shape {radiance.shape}.")
    write_whole(path, data.tobytes())


def write_whole(path, data: bytes) -> None:
    """Write a file so that it is either complete or not there: first beside its place, then into it."""
    part = Path(path).with_name(Path(path).name + ".part")
    try:
        part.write_bytes(data)
        os.replace(part, path)
    except OSError:
        part.unlink(missing_ok=True)
        raise
