"""Stage 5: tone-map a radiance map to a picture that a screen can show.

One call for every operator: tonemap(radiance, "reinhard", gamma=2.2). A new operator is a function that
takes a radiance map scaled by expose_for_screen and keyword parameters, and a line in OPERATORS.
"""

from pathlib import Path

import cv2
import numpy as np

from hdr_helpers.merge import write_whole
from hdr_helpers.papers.durand2002 import LUMINANCE, tonemap_durand

DARKEST, BRIGHTEST = 0.1, 99.9  # percentiles of luminance between which a scene's range is measured


def luminance(radiance) -> np.ndarray:
    """(H, W) float32, relative luminance of an RGB radiance map (H, W, 3)."""
    return np.asarray(radiance, dtype=np.float32) @ LUMINANCE


def dynamic_range_stops(radiance) -> float:
    """log2 of the ratio between the 99.9th and the 0.1th percentile of luminance.

    Percentiles, because a single noisy pixel would decide the ratio of maximum and minimum. Pixels without
    light, which OpenCV's merge leaves where it knows nothing, do not count.
    """
    light = luminance(radiance)
    low, high = np.percentile(light[light > 0], [DARKEST, BRIGHTEST])
    return float(np.log2(high / low))


def tonemap(radiance, operator: str = "durand", **parameters) -> np.ndarray:
    """Tone-map a radiance map.

    radiance : (H, W, 3) float, RGB, relative; left unharmed. NaN and negative values count as black,
        infinite ones as the brightest finite value.
    operator : a name in OPERATORS; parameters are that operator's own
    Returns ldr, (H, W, 3) float32 in 0..1, RGB, gamma included. The same call gives the same picture.
    Raises ValueError for an unknown operator, or one that can't work on a picture so small.
    """
    if operator not in OPERATORS:
        raise ValueError(f"Unknown operator {operator!r}; there are {', '.join(sorted(OPERATORS))}.")
    scaled = expose_for_screen(radiance)
    if scaled.min() == scaled.max():
        return scaled  # nothing to compress; some of OpenCV's operators divide by the range
    try:
        ldr = OPERATORS[operator](scaled, **parameters)
    except cv2.error as problem:
        height, width = scaled.shape[:2]
        raise ValueError(f"OpenCV's {operator} can't tone-map {width} x {height} pixels: {problem.err}") from None
    return np.clip(np.nan_to_num(ldr), 0, 1).astype(np.float32)


def expose_for_screen(radiance) -> np.ndarray:
    """A copy of a radiance map, finite, never negative, its 99.9th percentile of luminance at 1.

    What is brighter is cut there. OpenCV's operators scale linearly to the maximum first, so that one
    absurdly bright pixel would darken all others.
    """
    safe = np.array(radiance, dtype=np.float32)
    brightest = np.max(safe, where=np.isfinite(safe), initial=0)
    if brightest <= 0:
        return np.zeros_like(safe)
    np.nan_to_num(safe, copy=False, nan=0, posinf=brightest, neginf=0)
    np.maximum(safe, 0, out=safe)
    white = np.percentile(luminance(safe), BRIGHTEST)
    return np.minimum(safe / (white if white > 0 else brightest), 1)


def tonemap_gamma(radiance, gamma: float = 2.2, stops: float = 0.0) -> np.ndarray:
    """Gamma alone, the baseline: clip and encode.

    gamma : 1 leaves the light linear, more brightens the mid-tones
    stops : exposure compensation; +1 is twice as bright
    """
    return np.clip(radiance * np.float32(2.0**stops), 0, 1) ** np.float32(1 / gamma)


def tonemap_reinhard(radiance, gamma=2.2, intensity=0.0, light_adapt=0.0, color_adapt=0.0) -> np.ndarray:
    """Reinhard and Devlin 2005, a model of how photoreceptors adapt, by OpenCV.

    gamma : above 1 brightens
    intensity : -8..8; more is brighter
    light_adapt : 0..1; 0 adapts to the whole picture, 1 to each pixel alone (flatter)
    color_adapt : 0..1; 0 adapts all channels alike, 1 each on its own (removes a colour cast)
    """
    # A new object for every picture: OpenCV's changes its own state, the second call differs.
    return cv2.createTonemapReinhard(gamma, intensity, light_adapt, color_adapt).process(radiance)


def tonemap_drago(radiance, gamma=2.2, saturation=1.0, bias=0.85) -> np.ndarray:
    """Drago, Myszkowski, Annen and Chiba 2003, a logarithm whose base follows the pixel, by OpenCV.

    gamma : above 1 brightens
    saturation : 0 is grey, 1 leaves colours alone
    bias : 0.7..0.9 are usual; less lifts the dark parts
    """
    return cv2.createTonemapDrago(gamma, saturation, bias).process(radiance)


def tonemap_mantiuk(radiance, gamma=2.2, scale=0.7, saturation=1.0) -> np.ndarray:
    """Mantiuk, Myszkowski and Seidel 2006, contrasts compressed in a pyramid, by OpenCV.

    gamma : above 1 brightens
    scale : 0.6..0.9 are usual; factor on local contrast
    saturation : 0 is grey, 1 leaves colours alone
    """
    return cv2.createTonemapMantiuk(gamma, scale, saturation).process(radiance)


OPERATORS = {
    "gamma": tonemap_gamma,
    "reinhard": tonemap_reinhard,
    "drago": tonemap_drago,
    "mantiuk": tonemap_mantiuk,
    "durand": tonemap_durand,
}


def to_8bit(ldr) -> np.ndarray:
    """(H, W, 3) uint8 from a picture in 0..1. Clipped first: 1.02 * 255 as uint8 would be 4."""
    return np.rint(np.clip(ldr, 0, 1) * 255).astype(np.uint8)


def write_picture(path, ldr) -> None:
    """Write a tone-mapped picture, (H, W, 3) float in 0..1, RGB, as .png or .jpg: 24 bits a pixel.

    The file is complete or not there. Raises ValueError for another file name.
    """
    path = Path(path)
    if path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise ValueError(f"{path}: pictures are written as .png or .jpg.")
    done, data = cv2.imencode(path.suffix.lower(), np.ascontiguousarray(to_8bit(ldr)[..., ::-1]))
    if not done:
        raise ValueError(f"{path}: OpenCV could not write this picture of shape {ldr.shape}.")
    write_whole(path, data.tobytes())
