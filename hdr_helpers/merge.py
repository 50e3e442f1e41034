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
from hdr_helpers.load import in_8_bits

LAST_RESORT = 1e-5  # of the largest weight: decides only where no photograph has any other weight
NEXT_RESORT = 1e-4  # by how much less the next photograph decides, where the nearest bound is not valid
LEAST = 1e-35  # of the largest weight: no sum of weights is 0, however many photographs
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


def clipping(images, valid=None) -> Clipping:
    """How much of each photograph is too dark or too bright to be used, and how much in all of them.

    images : P arrays (H, W, 3) uint8 or uint16, shortest exposure first
    valid : P arrays (H, W) bool, the pixels that count, or None for all
    Usable is what fitted_weights gives a weight. Shares are of the pixels that are valid in every photograph.
    """
    inside = np.s_[:, :] if valid is None else np.logical_and.reduce(valid)
    pixels = [in_8_bits(image)[inside].reshape(-1, 3) for image in images]
    usable = np.flatnonzero(fitted_weights(images, valid))
    dark = np.array([(values < usable[0]).any(axis=1) for values in pixels])
    bright = np.array([(values > usable[-1]).any(axis=1) for values in pixels])
    shares = dark.mean(axis=1), bright.mean(axis=1)
    return Clipping(*shares, float(dark.all(axis=0).mean()), float(bright.all(axis=0).mean()))


def merge_debevec(images, times, crf, w=None, valid=None) -> np.ndarray:
    """Radiance map from a bracket and the camera's response (equation 6, one channel at a time).

    images : P arrays (H, W, 3), RGB, all uint8 or all uint16
    times : (P,) exposure times in seconds
    crf : (3, 256) float, log inverse response of each channel; for 16 bits it is interpolated
    w : (256,) float, weight of each pixel value; None takes fitted_weights(images)
    valid : P arrays (H, W) bool, False where a photograph has no say; None lets all speak everywhere

    Returns radiance, (H, W, 3) float32, RGB, relative, finite and positive everywhere. A pixel that is
    clipped in every photograph gets what the shortest exposure says, one that is black in every photograph
    what the longest says: the nearest bound, so that the brightest part of a scene stays the brightest. Where
    no photograph is valid it is as dark as the darkest pixel.
    Raises ValueError where shapes or values don't fit.
    """
    images, times, crf = list(images), np.asarray(times, dtype=np.float64), np.asarray(crf, dtype=np.float64)
    if len(images) != len(times) or not len(images):
        raise ValueError(f"One exposure time for each photograph is needed; got {len(times)} for {len(images)}.")
    for image in images:
        alike = image.dtype == images[0].dtype and image.shape == images[0].shape
        if image.dtype not in (np.uint8, np.uint16) or not alike or image.shape[2:] != (3,):
            raise ValueError(f"Images must be uint8 or uint16 of one size (H, W, 3); got {image.dtype} {image.shape}.")
    if not (np.all(np.isfinite(times)) and np.all(times > 0)):
        raise ValueError(f"Exposure times must be positive seconds; got {times.tolist()}.")
    if crf.shape != (3, LEVELS) or not np.all(np.isfinite(crf)):
        raise ValueError(f"crf must be (3, {LEVELS}) and finite; got {crf.shape}.")
    if valid is not None and [np.shape(mask) for mask in valid] != [image.shape[:2] for image in images]:
        raise ValueError(f"valid must hold one mask of {images[0].shape[:2]} for each photograph.")
    order = np.argsort(times)
    images, times = [images[i] for i in order], times[order]
    valid = None if valid is None else [np.asarray(valid[i], dtype=bool) for i in order]
    w = fitted_weights(images, valid) if w is None else checked_weights(w)
    # In the shortest exposure even a doubtful value is better than none: nothing sees more.
    masks = valid or [None] * len(images)
    settled = [images[0], *map(whole_white, images[1:], masks[1:])]
    values = np.iinfo(images[0].dtype).max + 1
    radiance = _merge_by_tables(settled, *_tables(times, crf, w, values), masks)
    if valid is not None and not (somewhere := np.logical_or.reduce(valid)).all():
        radiance[~somewhere] = radiance[somewhere].min(axis=0) if somewhere.any() else 1
    return radiance


def _tables(times, crf, w, values: int) -> tuple[np.ndarray, np.ndarray]:
    """w(z) (g(z) - ln dt) and w(z) for every photograph, each (P, 1, values, 3) float32 as cv2.LUT wants it.

    times : ascending
    """
    z = np.linspace(0, LEVELS - 1, values)  # 256 values, or 65,536 between them
    crf, w = np.array([np.interp(z, np.arange(LEVELS), g) for g in crf]), np.interp(z, np.arange(LEVELS), w)
    # Where no photograph is usable the nearest bound decides: of the bright values the shortest exposure's, of the
    # dark ones the longest's; where that one is not valid, the next one's.
    from_shortest = np.arange(len(times))[:, None]
    from_longest = len(times) - 1 - from_shortest
    nearest = np.where(np.arange(values) >= values // 2, from_shortest, from_longest)
    weights = np.maximum(w / w.max(), np.maximum(LAST_RESORT * NEXT_RESORT**nearest, LEAST))
    weighted = weights[..., None] * (crf.T - np.log(times)[:, None, None])
    weights = np.repeat(weights[..., None], 3, axis=2)
    return tuple(np.ascontiguousarray(t[:, None], dtype=np.float32) for t in (weighted, weights))


def _merge_by_tables(images, weighted, weights, masks) -> np.ndarray:
    """Look up and add, some rows at a time; equation 6 and the exponential at the end. NaN where none is valid."""
    radiance = np.empty(images[0].shape, dtype=np.float32)
    for top in range(0, len(radiance), TILE_ROWS):
        rows = np.s_[top : top + TILE_ROWS]
        numerator = np.zeros_like(radiance[rows])
        denominator = np.zeros_like(radiance[rows])
        for j, image in enumerate(images):
            mask = None if masks[j] is None else masks[j][rows].view(np.uint8)
            cv2.accumulate(cv2.LUT(image[rows], weighted[j]), numerator, mask)
            cv2.accumulate(cv2.LUT(image[rows], weights[j]), denominator, mask)
        cv2.exp(cv2.divide(numerator, denominator), radiance[rows])
    return radiance


def merge_opencv(images, times, crf=None) -> np.ndarray:
    """OpenCV's MergeDebevec behind this course's conventions: any float times, crf (3, 256), radiance out.

    Returns radiance, (H, W, 3) float32, in the channel order of images. Where every photograph is clipped
    the result may be 0 or not finite: that is OpenCV's own answer. Without crf OpenCV takes the camera for a
    linear one.
    """
    images, merge = [np.ascontiguousarray(in_8_bits(image)) for image in images], cv2.createMergeDebevec()
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
