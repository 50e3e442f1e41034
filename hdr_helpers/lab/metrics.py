"""How far a result is from the truth. Light is counted in stops: log2, so that 1 is a factor of two."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from hdr_helpers.align import Motion
from hdr_helpers.crf import CLIPPED, NOISE
from hdr_helpers.load import in_8_bits


@dataclass(frozen=True)
class RadianceError:
    """Error of a radiance map in stops, after one scale for each channel has been removed.

    stops : (H, W, 3) float32, signed error, positive where the map is too bright; NaN where it has no
        usable value
    median, p95 : of the absolute error
    """

    stops: np.ndarray
    median: float
    p95: float


def radiance_error(radiance, truth, where=None) -> RadianceError:
    """Compare a radiance map with the truth.

    radiance, truth : (H, W, 3) float, RGB
    where : (H, W) bool, pixels that count; None counts all

    Radiance is relative, and the gauge g[128] = 0 leaves each channel a scale of its own, so the median
    error of each channel is taken off first.
    """
    radiance, truth = np.asarray(radiance, dtype=np.float32), np.asarray(truth, dtype=np.float32)
    with np.errstate(all="ignore"):
        stops = np.log2(radiance) - np.log2(truth)
    stops[~np.isfinite(stops)] = np.nan
    counted = stops if where is None else stops[where]
    offset = np.nanmedian(counted.reshape(-1, 3), axis=0)
    size = np.abs(counted - offset)
    return RadianceError(stops - offset, float(np.nanmedian(size)), float(np.nanpercentile(size, 95)))


def crf_rmse(crf, truth, low: int = 5, high: int = 250) -> np.ndarray:
    """(3,) float64: root mean square error of log inverse responses in stops, over low <= z <= high.

    crf, truth : (3, 256) natural logarithms. The gauge is removed: each error's mean is taken off.
    """
    error = (np.asarray(crf, dtype=np.float64) - truth)[:, low : high + 1] / np.log(2)
    return np.sqrt(np.mean((error - error.mean(axis=1, keepdims=True)) ** 2, axis=1))


def psnr_mu(radiance, truth, mu: float = 5000.0) -> float:
    """PSNR in dB after mu-law compression, as in the NTIRE 2021 HDR challenge.

    radiance, truth : (H, W, 3) float. One scale a channel is removed; the truth's 99th percentile is 1.
    """
    radiance, truth = _same_scale(radiance, truth)
    white = np.percentile(truth, 99)

    def compress(light):
        return np.log1p(mu * np.tanh(light / white)) / np.log1p(mu)

    return float(-10 * np.log10(np.mean((compress(radiance) - compress(truth)) ** 2)))


def psnr_l(radiance, truth) -> float:
    """PSNR in dB of the light itself, as in the NTIRE 2021 HDR challenge: the brightest pixels decide it.

    radiance, truth : (H, W, 3) float. One scale a channel is removed; the truth's largest value is 1.
    """
    radiance, truth = _same_scale(radiance, truth)
    return float(-10 * np.log10(np.mean(((radiance - truth) / truth.max()) ** 2)))


def _same_scale(radiance, truth):
    """Both as float64, the first with the median ratio of each channel removed; what is not finite counts as 0."""
    truth = np.asarray(truth, dtype=np.float64)
    radiance = np.nan_to_num(np.asarray(radiance, dtype=np.float64), nan=0, posinf=0)
    usable = radiance > 0
    scale = [np.median((truth / np.where(usable, radiance, 1))[..., c][usable[..., c]]) for c in range(3)]
    return radiance * scale, truth


def held_out(bracket, k: int, merge) -> tuple[np.ndarray, np.ndarray]:
    """Predict one photograph of a bracket from the others: a check that needs no truth.

    merge : from a Bracket to (radiance, crf); it gets the bracket without photograph k
    Returns the prediction, (H, W, 3) float64 pixel values with fractions, 0..255; and by how much the photograph is
    brighter, (H, W, 3) float64, NaN where it or the prediction is black, clipped or not valid.
    """
    others = [i for i in range(len(bracket)) if i != k]
    valid = None if bracket.valid is None else tuple(bracket.valid[i] for i in others)
    rest = replace(
        bracket,
        images=tuple(bracket.images[i] for i in others),
        times=bracket.times[others],
        names=tuple(bracket.names[i] for i in others),
        places=(),
        valid=valid,
    )
    radiance, crf = merge(rest)
    log_exposure = np.log(radiance * bracket.times[k])
    values = np.arange(crf.shape[1])
    predicted = np.stack([np.interp(log_exposure[..., c], g, values) for c, g in enumerate(crf)], axis=-1)
    seen = in_8_bits(bracket.images[k])
    usable = (seen > NOISE) & (seen < CLIPPED) & (predicted > NOISE) & (predicted < CLIPPED)
    if bracket.valid is not None:
        usable &= bracket.valid[k][..., None]
    return predicted, np.where(usable, seen - predicted, np.nan)


def one_photo_errors(bracket) -> list[tuple[RadianceError, RadianceError]]:
    """For each photograph the RadianceError of two guesses: by a gamma of 2.2, and by the camera's true curve."""
    crf, truth = bracket.truth.crf, bracket.truth.radiance
    errors = []
    for image in bracket.images:
        by_gamma = np.maximum(image / np.float32(255), 1 / 512) ** 2.2  # value 0 is not zero light
        by_curve = np.exp(np.stack([g[image[..., c]] for c, g in enumerate(crf)], axis=-1))
        errors.append((radiance_error(by_gamma, truth), radiance_error(by_curve, truth)))
    return errors


def misplacement(bracket, alignment) -> np.ndarray:
    """(P,) float64: how far each photograph of a virtual camera lies from where it belongs, in pixels.

    bracket : with the truth of its shifts; alignment : what align_mtb found for its images
    The larger of dx and dy, at the 90th percentile of the pixels that are neither black nor white in the photograph:
    what it does not show can't be in the wrong place.
    """
    truth, count = bracket.truth, len(bracket)
    turns = np.zeros(count) if truth.rotations is None else truth.rotations
    hand = [Motion(*shift, degrees) for shift, degrees in zip(truth.shifts, turns, strict=True)]
    errors = []
    for k, image in enumerate(bracket.images):
        gray = in_8_bits(image)[::8, ::8].mean(axis=2)
        rows, cols = np.nonzero((gray > 8) & (gray < 247))
        points = np.stack([cols, rows], axis=1) * 8.0 - (np.array(image.shape[1::-1]) - 1) / 2
        points = points if len(points) else np.zeros((1, 2))
        belongs = hand[alignment.reference].after(hand[k].inverse())(points)
        lies = Motion(*alignment.shifts[k], alignment.rotations[k])(points)
        errors.append(np.percentile(np.abs(lies - belongs).max(axis=1), 90))
    return np.array(errors)


@dataclass(frozen=True)
class MovingError:
    """Mean absolute error of a radiance map in stops: where the scene moved, and well away from there."""

    moving: float
    still: float


def moving_error(radiance, truth) -> MovingError:
    """Compare a radiance map with a truth that knows what moved.

    radiance : (H, W, 3) float; truth : Truth with radiance and moved
    One scale for each channel is removed, the median over what stood still: ghosts must not hide in it.
    """
    near = cv2.dilate(truth.moved.view(np.uint8), np.ones((9, 9), np.uint8)) > 0
    with np.errstate(all="ignore"):
        stops = np.log2(radiance) - np.log2(truth.radiance)
    error = np.abs(stops - np.nanmedian(stops[~near], axis=0))
    return MovingError(float(np.nanmean(error[truth.moved])), float(np.nanmean(error[~near])))
