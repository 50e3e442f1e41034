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
    Returns a RadianceError.

    >>> truth = np.geomspace(0.01, 100, 48).reshape(4, 4, 3)
    >>> round(radiance_error(7 * truth, truth).median, 3)  # no scale
    0.0
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

    >>> truth = np.tile(np.linspace(-5, 1, 256), (3, 1))
    >>> crf_rmse(truth + [[0], [1], [2]], truth).round(6).tolist()
    [0.0, 0.0, 0.0]
    """
    error = (np.asarray(crf, dtype=np.float64) - truth)[:, low : high + 1] / np.log(2)
    return np.sqrt(np.mean((error - error.mean(axis=1, keepdims=True)) ** 2, axis=1))


def psnr_mu(radiance, truth, mu: float = 5000.0) -> float:
    """PSNR in dB after mu-law compression, as in the NTIRE 2021 HDR challenge.

    radiance, truth : (H, W, 3) float. One scale a channel is removed; the truth's 99th percentile is 1.
    mu : how strongly light is compressed. Infinite where nothing else differs.

    >>> truth = np.repeat([0.02, 1, 1], 30).reshape(3, 10, 3)
    >>> dark, light = truth - [[[0.01]], [[0]], [[0]]], truth - [[[0]], [[0.01]], [[0]]]
    >>> psnr_mu(dark, truth) < psnr_mu(light, truth)  # the same error counts for more in the dark
    True
    """
    radiance, truth = _same_scale(radiance, truth)
    white = np.percentile(truth, 99)

    def compress(light):
        return np.log1p(mu * np.tanh(light / white)) / np.log1p(mu)

    return _decibel(compress(radiance) - compress(truth))


def psnr_l(radiance, truth) -> float:
    """PSNR in dB of the light itself, as in the NTIRE 2021 HDR challenge: the brightest pixels decide it.

    radiance, truth : (H, W, 3) float. One scale a channel is removed; the truth's largest value is 1.
    Infinite where nothing else differs.

    >>> radiance = np.ones((10, 10, 3))
    >>> radiance[0, 0] = 0.9  # one pixel of a hundred is wrong by a tenth: the mean square is 1 / 10,000
    >>> round(psnr_l(radiance, np.ones((10, 10, 3))), 3)
    40.0
    """
    radiance, truth = _same_scale(radiance, truth)
    return _decibel((radiance - truth) / truth.max())


def _decibel(error) -> float:
    """PSNR of an error whose peak is 1; infinite where there is none."""
    with np.errstate(divide="ignore"):
        return float(-10 * np.log10(np.mean(error**2)))


def _same_scale(radiance, truth):
    """Both as float64, the first with the median ratio of each channel removed; what is not finite counts as 0."""
    truth = np.asarray(truth, dtype=np.float64)
    radiance = np.nan_to_num(np.asarray(radiance, dtype=np.float64), nan=0, posinf=0)
    usable = radiance > 0
    scale = [np.median((truth / np.where(usable, radiance, 1))[..., c][usable[..., c]]) for c in range(3)]
    return radiance * scale, truth


def held_out(bracket, k: int, merge) -> tuple[np.ndarray, np.ndarray]:
    """Predict one photograph of a bracket from the others: a check that needs no truth.

    bracket : Bracket of at least three photographs; k : index of the one that is held out
    merge : from a Bracket to (radiance, crf); it gets the bracket without photograph k
    Returns the prediction, (H, W, 3) float64 pixel values with fractions, 0..255; and by how much the photograph is
    brighter, (H, W, 3) float64, NaN where it or the prediction is black, clipped or not valid.
    Raises BracketError where fewer than two photographs are left.

    >>> from hdr_helpers.load import Bracket
    >>> images = [np.full((2, 3, 3), value, np.uint8) for value in (20, 40, 80)]
    >>> bracket = Bracket(images, [0.1, 0.2, 0.4], ("a", "b", "c"))
    >>> crf = np.log(np.maximum(np.arange(256), 0.5)) * np.ones((3, 1))  # a linear camera
    >>> predicted, brighter = held_out(bracket, 2, lambda rest: (rest.images[0] / rest.times[0], crf))
    >>> predicted[0, 0].round(6).tolist()  # four times the time of the first
    [80.0, 80.0, 80.0]
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
    """For each photograph the RadianceError of two guesses: by a gamma of 2.2, and by the camera's true curve.

    bracket : Bracket with its Truth; of 16-bit photographs the upper 8 bits speak

    >>> from hdr_helpers.lab.camera import Camera
    >>> scene = np.geomspace(0.01, 1, 300).reshape(10, 10, 3)
    >>> by_gamma, by_curve = one_photo_errors(Camera(jpeg_quality=None).shoot(scene, [0.1, 0.2]))[0]
    >>> by_gamma.median > by_curve.median
    True
    """
    crf, truth = bracket.truth.crf, bracket.truth.radiance
    errors = []
    for image in bracket.images:
        image = in_8_bits(image)
        by_gamma = np.maximum(image / np.float32(255), 1 / 512) ** 2.2  # value 0 is not zero light
        by_curve = np.exp(np.stack([g[image[..., c]] for c, g in enumerate(crf)], axis=-1))
        errors.append((radiance_error(by_gamma, truth), radiance_error(by_curve, truth)))
    return errors


def misplacement(bracket, alignment) -> np.ndarray:
    """(P,) float64: how far each photograph of a virtual camera lies from where it belongs, in pixels.

    bracket : with the truth of its shifts; alignment : what align_mtb found for its images
    The larger of dx and dy, at the 90th percentile of the pixels that are neither black nor white in the photograph:
    what it does not show can't be in the wrong place.

    >>> from hdr_helpers.align import unaligned
    >>> from hdr_helpers.lab.camera import Camera
    >>> bracket = Camera(jpeg_quality=None).shoot(np.ones((40, 60, 3)), [0.1, 0.2], shifts=[(3, 1), (0, 0)])
    >>> misplacement(bracket, unaligned(bracket.images)).round(6).tolist()
    [3.0, 0.0]
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
    """Mean absolute error of a radiance map in stops: moving where the scene moved, still well away from there."""

    moving: float
    still: float


def moving_error(radiance, truth) -> MovingError:
    """Compare a radiance map with a truth that knows what moved.

    radiance : (H, W, 3) float; truth : Truth with radiance and moved
    One scale for each channel is removed, the median over what stood still: ghosts must not hide in it.
    Returns a MovingError. Raises ValueError where the truth does not know what moved.

    >>> from hdr_helpers.load import Truth
    >>> moved = np.zeros((20, 20), dtype=bool)
    >>> moved[:5, :5] = True
    >>> truth = Truth(np.ones((20, 20, 3)), crf=None, moved=moved)
    >>> error = moving_error(truth.radiance + moved[..., None], truth)
    >>> error.moving, error.still  # a ghost twice as bright
    (1.0, 0.0)
    """
    if truth.moved is None:
        raise ValueError("This truth does not know what moved: its moved is None; compare with radiance_error.")
    near = cv2.dilate(truth.moved.view(np.uint8), np.ones((9, 9), np.uint8)) > 0
    with np.errstate(all="ignore"):
        stops = np.log2(radiance) - np.log2(truth.radiance)
    error = np.abs(stops - np.nanmedian(stops[~near], axis=0))
    return MovingError(float(np.nanmean(error[truth.moved])), float(np.nanmean(error[~near])))
