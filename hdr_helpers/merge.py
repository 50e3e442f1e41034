"""Stage 4: merge the exposures of a bracket into one radiance map (Debevec and Malik 1997, equation 6).

The log irradiance of a pixel is the weighted mean of what each photograph says of it, ln E = sum_j w(Z_j) (g(Z_j) -
ln dt_j) / sum_j w(Z_j). The rooms of _merging/ look both sums up by pixel value, and find the photographs' noise.
"""

import os
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import cv2
import numpy as np

from hdr_helpers._merging.noise import exposure_variance, frayed_white
from hdr_helpers._merging.tables import mean_by_tables
from hdr_helpers.crf import (
    CLIPPED,
    LEVELS,
    NOISE,
    black_level,
    evidence,
    fitted_weights,
    joint_histograms,
    several_weights,
)
from hdr_helpers.load import in_8_bits

LAST_RESORT = 1e-3  # of the least weight: decides only where no photograph has any other weight
NEXT_RESORT = 1e-4  # by how much less the next photograph decides, where the nearest bound is not valid
LEAST = 1e-30  # of the largest weight: no sum of weights is 0, and no product so small that processors take long


@dataclass(frozen=True, eq=False)
class Merged:
    """A radiance map, and what to know of it.

    radiance : (H, W, 3) float32, RGB, relative, finite and positive everywhere
    too_bright, too_dark : number of pixels in which a channel was clipped, or black, in every photograph that has a
        say there: their radiance is a bound, not a measurement
    weighting : for people, what the photographs were weighted by
    """

    radiance: np.ndarray
    too_bright: int
    too_dark: int
    weighting: str


@dataclass(frozen=True)
class Clipping:
    """Shares, 0 to 1, of pixels in which at least one channel can't be used.

    too_dark, too_bright : (P,) float64, for each photograph; everywhere_dark, everywhere_bright : in every one
    """

    too_dark: np.ndarray
    too_bright: np.ndarray
    everywhere_dark: float
    everywhere_bright: float


def clipping(images, valid=None) -> Clipping:
    """How much of each photograph is too dark or too bright to be used, and how much in all of them.

    images, valid : as for merge_debevec, shortest exposure first
    Usable is what fitted_weights gives a weight. Returns shares of the pixels that are valid in every photograph.

    >>> half_white = np.uint8([[[100] * 3, [255] * 3]])
    >>> clipping([half_white, half_white]).too_bright.tolist()
    [0.5, 0.5]
    """
    inside = np.s_[:, :] if valid is None else np.logical_and.reduce(valid)
    pixels = [in_8_bits(image)[inside].reshape(-1, 3) for image in images]
    usable = np.flatnonzero(fitted_weights(images, valid))
    dark = np.array([(values < usable[0]).any(axis=1) for values in pixels])
    bright = np.array([(values > usable[-1]).any(axis=1) for values in pixels])
    shares = dark.mean(axis=1), bright.mean(axis=1)
    return Clipping(*shares, float(dark.all(axis=0).mean()), float(bright.all(axis=0).mean()))


def merge_debevec(images, times, crf, w=None, valid=None, mean: str | None = None) -> Merged:
    """Radiance map from a bracket and the camera's response: a weighted mean of what each photograph says.

    images : P arrays (H, W, 3), RGB, all uint8 or all uint16
    times : (P,) exposure times in seconds
    crf : (3, 256) float, log inverse response of each channel; for 16 bits it is interpolated
    w : weight of each pixel value, (256,), (3, 256), (P, 1, 256) or (P, 3, 256) float, none negative. None takes
        1 / variance by the noise that the bracket shows (_merging/noise.py); white that JPEG frayed counts as clipped
    valid : P arrays (H, W) bool, False where a photograph has no say; None lets all speak everywhere
    mean : of what. "log", equation 6: of ln E. Errors count as shares, but noise in the dark, whose logarithm falls
        farther than it rises, pulls down, and 0 can't be used. "linear": of E. True on average in the dark, but a short
        exposure's noise is divided by a short time: weights have to grow with its square. "log1p": of ln(1 + E T), T
        the longest time: a logarithm in the light, E in the dark. None: "log1p" with weights by noise, else "log"
    Returns a Merged. Where no weight is above 0 a pixel gets the nearest bound: what the shortest exposure says if it
    is clipped in all, what the longest says if it is black, so that the brightest part of a scene stays the brightest.
    Where no photograph is valid it is as dark as the darkest pixel. Raises ValueError where shapes or values don't fit.

    >>> ramp, crf = np.uint8([[[20] * 3, [40] * 3, [80] * 3]]), np.log(np.arange(256) + 1e-9)  # a linear camera
    >>> E = merge_debevec([ramp, 2 * ramp], [0.1, 0.2], [crf] * 3, np.ones(256)).radiance
    >>> (E / E.min())[0, :, 0].round(3).tolist()
    [1.0, 2.0, 4.0]
    """
    images, times, crf, w, valid = _checked(images, times, crf, w, valid)
    mean = mean or ("log1p" if w is None else "log")
    if mean not in MEANS:
        raise ValueError(f"mean must be one of {', '.join(MEANS)}; got {mean!r}.")
    settle, weighting = False, "the given weights"
    if w is None:
        w, settle = weights_by_noise(images, times, crf, valid, mean)
        weighting = "the noise that the photographs show" + (
            ", clipped pixels that are not quite white left out" * settle
        )
    said, finish = MEANS[mean](np.exp(_to_depth(crf, images)), times)
    weights, least = _with_last_resorts(_to_depth(w, images))
    to_tables = (0, 2, 1)  # (P, values, 3)
    radiance, too_bright, too_dark = mean_by_tables(
        images, said.transpose(to_tables), weights.transpose(to_tables), finish, valid, settle, least
    )
    if valid is not None and (nowhere := np.isnan(radiance)).any():
        np.copyto(radiance, 1 if nowhere.all() else np.nanmin(radiance, axis=(0, 1)), where=nowhere)
    return Merged(radiance, too_bright, too_dark, weighting)


def _log(X, times):
    return np.log(X) - np.log(times)[:, None, None], lambda mean: np.exp(mean, out=mean)


def _linear(X, times):
    return X / times[:, None, None], lambda mean: mean


def _log1p(X, times):
    longest = times[-1]
    return np.log1p(X * longest / times[:, None, None]), lambda mean: np.divide(
        np.expm1(mean, out=mean), np.float32(longest), out=mean
    )


# What a photograph of each time says of a pixel, from its exposure X (3, values), and the way back from the mean.
MEANS = {"log": _log, "linear": _linear, "log1p": _log1p}


def weights_by_noise(images, times, crf, valid=None, mean: str = "log1p") -> tuple[np.ndarray, bool]:
    """What merge_debevec weighs photographs by where no weights are given.

    Arguments as for merge_debevec, photographs in ascending order of their times. Returns 1 / variance of what is
    averaged, (P, 3, 256) float64; and whether white is frayed: clipped pixels hide behind other values than 255.
    """
    few, masks = evidence(images, valid)
    joints = joint_histograms(few, masks, [(k, k + 1) for k in range(len(few) - 1)])
    frayed = frayed_white(joints, np.log(times), crf)
    X, share = np.exp(crf), (times / times[-1])[:, None, None]
    # The slope of what is averaged against X: of ln X, of X / t, of ln(1 + X T / t).
    slope = {"log": 1 / X, "linear": 1 / share, "log1p": 1 / (X + share)}[mean]
    w = np.broadcast_to(
        1 / (slope**2 * exposure_variance(joints, np.log(times), crf)), (len(images), *crf.shape)
    ).copy()
    w[..., CLIPPED if frayed else LEVELS - 1 :] = 0
    black = black_level(few, valid and masks)
    if black > NOISE or mean == "log":
        w[..., : black + 1] = 0
    return w, frayed


def _with_last_resorts(w):
    """Weights, highest 1, with the nearest bounds in place of zeros; and the sum from which on a pixel was measured."""
    photographs, _, values = w.shape
    w = w / w.max()
    least = w[w > 0].min()
    # Where no photograph is usable the nearest bound decides: of the bright values the shortest exposure's, of the
    # dark ones the longest's; where that one is not valid, the next one's.
    from_shortest = np.arange(photographs)[:, None]
    nearest = np.where(np.arange(values) >= values // 2, from_shortest, photographs - 1 - from_shortest)
    resort = np.maximum(least * LAST_RESORT * NEXT_RESORT**nearest, LEAST)[:, None]
    return np.maximum(w, resort), least / 2


def _to_depth(curves, images):
    """Curves over 256 values, (..., 256), over the 65,536 between them where images have 16 bits."""
    if images[0].dtype == np.uint8:
        return curves
    z = np.linspace(0, LEVELS - 1, np.iinfo(images[0].dtype).max + 1)
    return np.apply_along_axis(lambda curve: np.interp(z, np.arange(LEVELS), curve), -1, curves)


def _checked(images, times, crf, w, valid):
    """The arguments as arrays, shortest exposure first, w as (P, 3, 256) or None; ValueError where they don't fit."""
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
    if w is not None:
        w = several_weights(w)
        if w.ndim > 3 or (*(1,) * (3 - w.ndim), *w.shape)[:2] not in product((1, len(images)), (1, 3)):
            raise ValueError(f"w must be ({LEVELS},), (3, {LEVELS}) or (P, 3, {LEVELS}); got shape {w.shape}.")
        w = np.broadcast_to(w, (len(images), 3, LEVELS))[order]
    valid = None if valid is None else [np.asarray(valid[i], dtype=bool) for i in order]
    return [images[i] for i in order], times[order], crf, w, valid


def merge_opencv(images, times, crf=None) -> np.ndarray:
    """OpenCV's MergeDebevec behind this course's conventions: any float times, crf (3, 256), radiance out.

    Returns radiance, (H, W, 3) float32, in the channel order of images. Where every photograph is clipped it may be 0
    or not finite: that is OpenCV's own answer. Without crf OpenCV takes the camera for a linear one.
    """
    images, merge = [np.ascontiguousarray(in_8_bits(image)) for image in images], cv2.createMergeDebevec()
    times = np.asarray(times, dtype=np.float32)  # with float64 it answers zeros and infinities, and says nothing
    if crf is None:
        return merge.process(images, times)
    return merge.process(images, times, np.exp(crf).T[:, None].astype(np.float32).copy())


def write_hdr(path, radiance) -> None:
    """Write a radiance map as Radiance RGBE (.hdr) or, where OpenCV was built with it, OpenEXR (.exr).

    radiance : (H, W, 3) float, RGB, finite and not negative. The file at path is complete or not there. RGBE keeps
    about 1% of the strongest channel; OpenEXR (32-bit) all of it, as np.save does where only Python is to read it.
    Raises ValueError where the radiance can't be stored, or the format is not one of these.
    """
    path, radiance = Path(path), np.asarray(radiance)
    if radiance.ndim != 3 or radiance.shape[2] != 3 or not np.all(np.isfinite(radiance)) or radiance.min() < 0:
        raise ValueError(f"{path}: a radiance map is (H, W, 3), finite and not negative; got shape {radiance.shape}.")
    suffix = path.suffix.lower()
    if suffix not in (".hdr", ".exr") or not cv2.haveImageWriter(f"radiance{suffix}"):
        raise ValueError(f"{path}: this OpenCV writes radiance maps as {' and '.join(radiance_formats())}.")
    try:
        done, data = cv2.imencode(suffix, np.ascontiguousarray(radiance[..., ::-1], dtype=np.float32))
    except cv2.error:
        done = False
    if not done:
        raise ValueError(f"{path}: OpenCV could not write this radiance map of shape {radiance.shape}.")
    write_whole(path, data.tobytes())


def radiance_formats() -> list[str]:
    """The suffixes of files that write_hdr can write with this OpenCV."""
    return [suffix for suffix in (".hdr", ".exr") if cv2.haveImageWriter(f"radiance{suffix}")]


def write_whole(path, data: bytes) -> None:
    """Write data to path so that the file is either complete or not there: first beside its place, then into it."""
    part = Path(path).with_name(Path(path).name + ".part")
    try:
        part.write_bytes(data)
        os.replace(part, path)
    except OSError:
        part.unlink(missing_ok=True)
        raise
