"""How well a tone-mapped picture shows the scene it was made from. There is no true picture, so each number is a hint.

Pictures are judged as they are shown, in 8 bits: detail of less than a grey level is lost. Radiance maps may have any
scale. Noise of a radiance map counts as detail of the scene; where the truth is known, judge against the truth.
"""

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from scipy.stats import beta, norm

from hdr_helpers.tonemap import luminance, to_8bit

REGION = 5.0  # per cent of the pixels: the darkest and the brightest part of a scene
WINDOW = 0.005  # of the picture's longer side: standard deviation of the window in which detail is compared
SMALLEST_WINDOW = 1.5  # pixels
VISIBLE = 1.0  # grey levels; detail of this standard deviation counts as kept by 0.7
PLAIN = 0.1  # natural logarithm; scene contrast above this has no more say, or a few edges would decide

SCALES = (
    0.0448,
    0.2856,
    0.3001,
    0.2363,
    0.1333,
)  # TMQI: the say of each scale, finest first; those of multi-scale SSIM
NARROWEST = 161  # pixels: halved four times, the window of 11 still fits


class ClippedShare(NamedTuple):
    """Shares of a picture's pixels, 0 to 1: black is 0 in every channel, white 255 in at least one."""

    black: float
    white: float


class DetailKept(NamedTuple):
    """How much of the scene's detail a picture shows, 0 to 1: dark, where the scene is darkest; bright, brightest."""

    dark: float
    bright: float


class Tmqi(NamedTuple):
    """Tone-mapped image quality index: quality, made of structural fidelity and statistical naturalness. All 0 to 1."""

    quality: float
    fidelity: float
    naturalness: float


@dataclass(frozen=True)
class Judgement:
    """Everything this file can say of a picture: what is clipped, how much detail is left, and its tmqi."""

    clipped: ClippedShare
    detail: DetailKept
    tmqi: Tmqi


def judge(ldr, radiance) -> Judgement:
    """Judge a picture ldr (H, W, 3) in 0..1 by the radiance map (H, W, 3) that it was made from.

    Raises ValueError where the two differ in size, are narrower than TMQI needs (161 pixels), or have no light.
    """
    return Judgement(clipped_share(ldr), detail_kept(ldr, radiance), tmqi(ldr, radiance))


def clipped_share(ldr) -> ClippedShare:
    """Shares of pixels that are black, and that are white in at least one channel, once the picture has 8 bits.

    ldr : (H, W, 3) float in 0..1. A channel at 0 beside others is a strong colour, so black needs all three; a channel
    at 255 is cut, and its detail and the hue are gone. Pure red counts as white, therefore.

    >>> tuple(clipped_share([[[0, 0, 0], [1, 0, 0], [0.5, 0.5, 0.5], [0, 0, 0.5]]]))
    (0.25, 0.25)
    """
    pixels = to_8bit(ldr).reshape(-1, 3)
    return ClippedShare(float((pixels == 0).all(axis=1).mean()), float((pixels == 255).any(axis=1).mean()))


def extreme_regions(radiance, share: float = REGION) -> tuple[np.ndarray, np.ndarray]:
    """Two (H, W) bool: the darkest and the brightest part of a scene, share per cent of its pixels each.

    Luminance is smoothed first, in logarithms: a region is a place in the scene, not the dark grains of a bright wall.
    radiance : (H, W, 3) float, RGB. Raises ValueError where it has no light.

    >>> darkest, brightest = extreme_regions(np.arange(1, 21).repeat(60).reshape(20, 20, 3), share=10)
    >>> bool(darkest[0].all()), bool(brightest[0].any())
    (True, False)
    """
    smooth = _smooth(_log_light(radiance))
    low, high = np.percentile(smooth, [share, 100 - share])
    return smooth <= low, smooth >= high


def detail_kept(ldr, radiance, share: float = REGION) -> DetailKept:
    """How much of the scene's local detail a picture shows in the darkest and the brightest share per cent.

    ldr : (H, W, 3) float in 0..1; radiance : (H, W, 3) float, RGB; light that is no number or not above 0 counts as
        the darkest
    In a small window round each pixel the log luminance of the scene is compared with the picture's grey levels:
    covariance / (scene's deviation * picture's deviation), a correlation in which half a grey level more or less is
    not taken for detail. A reversed contrast counts as lost. The mean is weighted by the scene's contrast, as a plain
    wall has nothing to lose. Only pixels of the region are looked at: its border is no detail.

    1 says that every structure is there, however faint as long as it is visible; a picture that exaggerates detail
    gets no less, nor does one with halos wider than the window. A region without contrast has lost nothing: 1.
    Raises ValueError where the two differ in size, or have no light.

    >>> scene = np.random.default_rng(0).uniform(0.1, 0.9, (40, 40, 3))
    >>> detail_kept(np.zeros_like(scene), scene), detail_kept(scene, scene).bright > 0.9
    (DetailKept(dark=0.0, bright=0.0), True)
    """
    log_light, grey = _log_light(radiance), _grey(ldr)
    _check_alike(grey, log_light)
    return DetailKept(*(_kept(log_light, grey, region) for region in extreme_regions(radiance, share)))


def _kept(log_light, grey, region) -> float:
    inside = region.astype(np.float64)
    share = np.maximum(_smooth(inside), 1e-9)

    def mean(values):
        return _smooth(values * inside) / share

    # Round the region's own middle, so that variances are not differences of large numbers.
    scene, picture = log_light - log_light[region].mean(), grey - grey[region].mean()
    covariance = mean(scene * picture) - mean(scene) * mean(picture)
    of_scene, of_picture = (np.sqrt(np.maximum(mean(a * a) - mean(a) ** 2, 0)) for a in (scene, picture))
    say = np.where(region & (of_scene > 1e-4), np.minimum(of_scene, PLAIN), 0)
    if not say.any():
        return 1.0
    kept = np.maximum(covariance, 0) / (np.maximum(of_scene, 1e-4) * np.sqrt(of_picture**2 + VISIBLE**2))
    return float(np.average(np.minimum(kept, 1), weights=say))


def tmqi(ldr, radiance) -> Tmqi:
    """H. Yeganeh and Z. Wang, Objective quality assessment of tone-mapped images, IEEE TIP 22(2), 2013.

    ldr : (H, W, 3) float in 0..1; radiance : (H, W, 3) float, RGB, linear; any scale, negative values count as 0
    Quality is 0.8012 fidelity^0.3046 + 0.1988 naturalness^0.7088.
    Raises ValueError where the two differ in size or a side is below 161 pixels.
    The constants are those of the authors' own program, version 1.0. They were fitted to opinions on a few scenes:
    differences below 0.01 mean little. Naturalness asks for the brightness and contrast of an average photograph; a
    night scene shown as night scores low.

    >>> scene = np.random.default_rng(0).uniform(0.1, 1, (161, 161, 3))
    >>> tmqi(scene, scene).quality > tmqi(scene / 10, scene).quality
    True
    """
    fidelity, naturalness = structural_fidelity(ldr, radiance), statistical_naturalness(ldr)
    return Tmqi(0.8012 * fidelity**0.3046 + (1 - 0.8012) * naturalness**0.7088, fidelity, naturalness)


def structural_fidelity(ldr, radiance) -> float:
    """Share of the scene's visible structure that the picture shows, over five scales: 0 to 1.

    Arguments and errors as for tmqi. The radiance map's luminance is scaled linearly to 0..2^32 - 1, as the authors do:
    that makes nearly all of its structure visible, and leaves out scale and offset. A scale on which the picture shows
    the opposite of the scene counts as 0.

    >>> scene = np.random.default_rng(0).uniform(0.1, 1, (161, 161, 3))
    >>> structural_fidelity(scene, scene) > 0.9, structural_fidelity(1 - scene, scene) < 0.1
    (True, True)
    """
    scene, picture = _light(radiance), _grey(ldr)
    _check_alike(picture, scene)
    if min(scene.shape) < NARROWEST:
        raise ValueError(f"TMQI needs {NARROWEST} pixels each way; got {scene.shape[1]} x {scene.shape[0]}.")
    if np.ptp(scene) > 0:
        scene = (scene - scene.min()) * ((2.0**32 - 1) / np.ptp(scene))
    fidelity = 1.0
    for k, say in enumerate(SCALES):
        fidelity *= max(float(np.mean(local_fidelity(picture, scene, 16 / 2**k))), 0) ** say
        scene, picture = _halved(scene), _halved(picture)
    return min(fidelity, 1.0)


def local_fidelity(picture, scene, frequency: float) -> np.ndarray:
    """Structural fidelity of each window of 11 x 11 pixels on one scale.

    picture, scene : (H, W) float64; frequency : cycles a degree at which this scale is seen
    Returns (H - 10, W - 10) float64.
    """
    deviations, means = [], []
    for values in (scene, picture):
        mean = _window(values)
        variance = _window(values**2) - mean**2
        # Below this a difference of squares is rounding; a flat and bright patch must not seem full of structure.
        deviations.append(np.sqrt(np.where(variance > 1e-12 * mean**2, variance, 0)))
        means.append(mean)
    covariance = _window(scene * picture) - means[0] * means[1]
    product = deviations[0] * deviations[1]
    covariance = np.clip(covariance, -product, product)
    # Mannos and Sakrison's sensitivity to contrast; its inverse is the deviation seen half of the time.
    sensitivity = 100 * 2.6 * (0.0192 + 0.114 * frequency) * np.exp(-((0.114 * frequency) ** 1.1))
    threshold = 128 / (1.4 * sensitivity)
    a, b = (norm.cdf(deviation, threshold, threshold / 3) for deviation in deviations)
    return (2 * a * b + 0.01) / (a**2 + b**2 + 0.01) * (covariance + 10) / (product + 10)


def statistical_naturalness(ldr) -> float:
    """How usual a picture's brightness and contrast are among photographs: 0 to 1.

    ldr : (H, W, 3) float in 0..1. Mean grey level against a normal distribution, mean deviation in blocks of 11 x 11
    pixels against a beta distribution. Blocks that don't fit in whole are left out, where the authors fill up with
    black. Raises ValueError for a picture smaller than a block.

    >>> round(statistical_naturalness(np.full((22, 22, 3), 0.5)), 6)  # no contrast at all
    0.0
    """
    grey = _grey(ldr)
    rows, cols = (n // 11 for n in grey.shape)
    if not rows * cols:
        raise ValueError(f"Naturalness needs 11 pixels each way; got {grey.shape[1]} x {grey.shape[0]}.")
    blocks = grey[: 11 * rows, : 11 * cols].reshape(rows, 11, cols, 11)
    contrast = blocks.std(axis=(1, 3), ddof=1).mean() / 64.29
    usual = beta.pdf(contrast, 4.4, 10.1) / beta.pdf(3.4 / 12.5, 4.4, 10.1)  # 3.4 / 12.5 is where it is highest
    return float(usual * np.exp(-0.5 * ((grey.mean() - 115.94) / 27.99) ** 2))


def _check_alike(picture, scene) -> None:
    if picture.shape != scene.shape:
        raise ValueError(f"Picture and radiance map must have one size; got {picture.shape} and {scene.shape}.")


def _grey(ldr) -> np.ndarray:
    """(H, W) float64: luminance of a picture's 8-bit values, 0 to 255."""
    return luminance(to_8bit(ldr)).astype(np.float64)


def _light(radiance) -> np.ndarray:
    """(H, W) float64: luminance, with NaN and negative values as 0 and infinite ones as the brightest finite value."""
    light = luminance(radiance).astype(np.float64)
    brightest = np.max(light, where=np.isfinite(light), initial=0)
    return np.clip(np.nan_to_num(light, nan=0), 0, brightest)


def _log_light(radiance) -> np.ndarray:
    light = _light(radiance)
    if not light.any():
        raise ValueError("This radiance map has no light in it: no value is above 0.")
    return np.log(np.maximum(light, light[light > 0].min()))


def _smooth(values) -> np.ndarray:
    return cv2.GaussianBlur(values, (0, 0), max(SMALLEST_WINDOW, WINDOW * max(values.shape)))


def _window(values) -> np.ndarray:
    """Mean over windows of 11 x 11 pixels with Gaussian weights, where they fit in whole."""
    return cv2.GaussianBlur(values, (11, 11), 1.5)[5:-5, 5:-5]


def _halved(values) -> np.ndarray:
    values = np.pad(values, [(0, n % 2) for n in values.shape], mode="edge")
    return (values[::2, ::2] + values[1::2, ::2] + values[::2, 1::2] + values[1::2, 1::2]) / 4
