"""Stage 5: tone-map a radiance map to a picture that a screen can show.

One call for every operator: tonemap(radiance, "reinhard", gamma=2.2). A new operator is a function that
takes a radiance map scaled by expose_for_screen and keyword parameters, and a line in OPERATORS.
"""

import inspect
from pathlib import Path

import cv2
import numpy as np

from hdr_helpers.merge import write_whole
from hdr_helpers.papers.durand2002 import LEAST, LUMINANCE, in_colour, tonemap_durand, where_lit
from hdr_helpers.papers.reinhard2002 import tonemap_reinhard_global

DARKEST, BRIGHTEST = 0.1, 99.9  # percentiles of luminance between which a scene's range is measured
POWER = 0.4185  # OpenCV's Mantiuk scales contrast ^ POWER
CONTRAST = 30  # what Mantiuk leaves of a scene's range unless told otherwise; Durand's default, too
GLARE = 0.05  # of white: a darkest grey up to this is taken off

# The least and the greatest value of every parameter. A new parameter that is not here must only be finite.
RANGES = {
    "gamma": (0.1, 10),
    "stops": (-30, 30),
    "saturation": (0, 2),
    "intensity": (-8, 8),
    "light_adapt": (0, 1),
    "color_adapt": (0, 1),
    "bias": (0.5, 1),
    "scale": (0.05, 1),
    "contrast": (1, 1e6),
    "detail": (0, 5),
    "key": (0.01, 10),
    "white": (0.01, np.inf),
}


def luminance(radiance) -> np.ndarray:
    """(H, W) float32, relative luminance of an RGB radiance map (H, W, 3): the weights of Rec. 709.

    >>> luminance([[[3, 3, 3]]]).round(3).tolist()
    [[3.0]]
    """
    return np.asarray(radiance, dtype=np.float32) @ LUMINANCE


def dynamic_range_stops(radiance) -> float:
    """log2 of the ratio between the 99.9th and the 0.1th percentile of luminance.

    Percentiles, because a single noisy pixel would decide the ratio of maximum and minimum. Pixels without
    light, which OpenCV's merge leaves where it knows nothing, do not count, nor do those that are no number.
    radiance : (H, W, 3) float, RGB. Raises ValueError where no pixel has light.
    >>> round(dynamic_range_stops(np.repeat([1.0, 1024.0], 3000).reshape(20, 100, 3)), 1)  # 2^10
    10.0
    """
    light = luminance(radiance)
    light = light[np.isfinite(light) & (light > 0)]
    if not light.size:
        raise ValueError("This radiance map has no light in it: no value is finite and above 0.")
    low, high = np.percentile(light, [DARKEST, BRIGHTEST])
    return float(np.log2(high / low))


def tonemap(radiance, operator: str = "durand", **parameters) -> np.ndarray:
    """Tone-map a radiance map.

    radiance : (H, W, 3) numbers, RGB, relative; left unharmed. NaN and negative values count as black,
        infinite ones as the brightest finite value.
    operator : a name in OPERATORS; parameters are that operator's own, in the RANGES of this file
    Returns ldr, (H, W, 3) float32 in 0..1, RGB, gamma included. The same call gives the same picture.
    Raises ValueError for an unknown operator or parameter, a value out of range, or a map that is none.

    >>> grey = np.ones((1, 3, 3)) * [[[0.25], [0.5], [1]]]
    >>> tonemap(grey, "gamma", gamma=1, stops=1)[0, :, 0].round(2).tolist()  # a stop more: the middle is white
    [0.5, 1.0, 1.0]
    """
    check_parameters(operator, parameters)
    scaled = expose_for_screen(radiance)
    if not scaled.any():
        return scaled
    ldr = OPERATORS[operator](scaled, **parameters)
    return np.minimum(np.fmax(ldr, 0), 1).astype(np.float32, copy=False)  # fmax makes 0 of NaN


def check_parameters(operator: str, parameters: dict) -> None:
    """Raise ValueError for an unknown operator, a parameter that it does not have, or a value out of range.

    operator : a name in OPERATORS; parameters : dictionary from name to value

    >>> check_parameters("gamma", {"gama": 2.2})
    Traceback (most recent call last):
    ValueError: gamma has no parameter 'gama'; it has gamma, stops.
    """
    if operator not in OPERATORS:
        raise ValueError(f"Unknown operator {operator!r}; there are {', '.join(sorted(OPERATORS))}.")
    known = dict(list(inspect.signature(OPERATORS[operator]).parameters.items())[1:])
    for name, value in parameters.items():
        if name not in known:
            raise ValueError(f"{operator} has no parameter {name!r}; it has {', '.join(known)}.")
        if value is None and known[name].default is None:
            continue
        least, most = RANGES.get(name, (-np.finfo(float).max, np.finfo(float).max))
        if not isinstance(value, (int, float, np.number)) or not least <= value <= most:  # NaN is not, either
            raise ValueError(f"{name} of {operator} must be a number from {least:g} to {most:g}; got {value!r}.")


def expose_for_screen(radiance) -> np.ndarray:
    """A copy of a radiance map, finite, never negative, its 99.9th percentile of luminance at 1. (H, W, 3) float32.

    What is brighter is cut there. OpenCV's operators scale linearly to the maximum first, so that one
    absurdly bright pixel would darken all others.
    Raises ValueError for what is no radiance map.

    >>> expose_for_screen(np.ones((1, 2, 3)) * [[[4], [8]]])[0, :, 0].round(2).tolist()
    [0.5, 1.0]
    """
    radiance = np.asarray(radiance)
    if radiance.ndim != 3 or radiance.shape[2] != 3 or not radiance.size or radiance.dtype.kind not in "fiu":
        raise ValueError(
            f"A radiance map must be (H, W, 3) numbers, at least one pixel; got {radiance.shape} {radiance.dtype}."
        )
    # Twice the precision only for what may not fit: 1e39 is too large for float32.
    safe = radiance.astype(np.result_type(radiance.dtype, np.float32))
    brightest = safe.max()
    if not np.isfinite(brightest):
        brightest = np.max(safe, where=np.isfinite(safe), initial=0)
        np.nan_to_num(safe, copy=False, nan=0, posinf=max(brightest, 0), neginf=0)
    if brightest <= 0:
        return np.zeros(safe.shape, np.float32)
    np.maximum(safe, 0, out=safe)
    white = np.percentile(safe @ LUMINANCE, BRIGHTEST)
    with np.errstate(over="ignore"):  # an absurd pixel may become infinite before it is cut
        safe /= white if white > 0 else brightest
    return np.minimum(safe, 1, out=safe).astype(np.float32, copy=False)


def tonemap_gamma(radiance, gamma: float = 2.2, stops: float = 0.0) -> np.ndarray:
    """Gamma alone, the baseline: clip and encode.

    radiance : as from expose_for_screen; returns (H, W, 3) float32 in 0..1
    gamma : 0.1..10; 1 leaves the light linear, more brightens the mid-tones
    stops : -30..30; exposure compensation, +1 is twice as bright, and twice as bright a pixel is clipped
    >>> tonemap_gamma(np.float32([0.25, 1]), gamma=2).tolist()  # the root
    [0.5, 1.0]
    """
    return np.clip(radiance * np.float32(2.0**stops), 0, 1) ** np.float32(1 / gamma)


def tonemap_reinhard(radiance, gamma=2.2, intensity=1.0, light_adapt=0.5, color_adapt=0.0) -> np.ndarray:
    """Reinhard and Devlin 2005, a model of how photoreceptors adapt, by OpenCV. One curve for all pixels.

    radiance : as from expose_for_screen; returns (H, W, 3) float32
    gamma : 0.1..10; above 1 brightens
    intensity : -8..8; more is brighter
    light_adapt : 0..1; 0 adapts to the whole picture, 1 to each pixel alone (flatter)
    color_adapt : 0..1; 0 adapts all channels alike, 1 each on its own (removes a colour cast, and colours)
    >>> wall = np.float32([[[0.02] * 3, [1] * 3]])
    >>> bool(tonemap_reinhard(wall, intensity=2)[0, 0, 0] > tonemap_reinhard(wall)[0, 0, 0])
    True
    """
    # A new object for every picture: OpenCV's changes its own state, the second call differs.
    return through_opencv(cv2.createTonemapReinhard(gamma, intensity, light_adapt, color_adapt), radiance)


def tonemap_drago(radiance, gamma=2.2, saturation=0.8, bias=0.85) -> np.ndarray:
    """Drago, Myszkowski, Annen and Chiba 2003, a logarithm whose base follows the pixel, by OpenCV.

    radiance : as from expose_for_screen; returns (H, W, 3) float32
    gamma : 0.1..10; above 1 brightens
    saturation : 0..2; 0 is grey, 1 keeps colour ratios, which look too strong once luminance is compressed
    bias : 0.5..1; less lifts the dark parts. 0.8 to 0.9 are usual; below, the very brightest darken again

    OpenCV sees luminance alone: its own saturation is a power that turns bright colours white.
    >>> red = np.float32([[[0.2, 0.1, 0.1], [1, 0.5, 0.5]]])
    >>> np.ptp(tonemap_drago(red, saturation=0), axis=2).round(3).tolist()  # its channels are equal
    [[0.0, 0.0]]
    """
    light = np.maximum(luminance(radiance), LEAST)
    shown = through_opencv(cv2.createTonemapDrago(1.0, 1.0, bias), cv2.merge([light] * 3))[..., 1]
    return in_colour(radiance, light, shown, saturation, gamma)


def tonemap_mantiuk(radiance, gamma=2.2, scale=None, saturation=0.8) -> np.ndarray:
    """Mantiuk, Myszkowski and Seidel 2006, contrasts compressed in a pyramid, by OpenCV.

    radiance : as from expose_for_screen; returns (H, W, 3) float32
    gamma : 0.1..10; above 1 brightens
    scale : 0.05..1; factor on local contrast as it is perceived: less is flatter, and lifts the dark parts.
        None takes what leaves a contrast of 30 between the scene's darkest and brightest
    saturation : 0..2; 0 is grey, 1 keeps colour ratios, which look too strong once luminance is compressed

    As OpenCV scales the contrasts of all levels alike, the whole is a power of luminance: a global operator.
    >>> scene = np.geomspace(1e-4, 1, 32, dtype=np.float32).repeat(12).reshape(1, 128, 3)
    >>> bool(np.ptp(tonemap_mantiuk(scene, scale=0.1)) < np.ptp(tonemap_mantiuk(scene, scale=0.9)))
    True
    """
    light = np.maximum(luminance(radiance), LEAST)
    if scale is None:
        low, high = np.percentile(where_lit(light, light), [DARKEST, BRIGHTEST])
        scale = (np.log(CONTRAST) / max(np.log(high / low), np.log(CONTRAST))) ** POWER
    # OpenCV cuts at 1/10000 of the brightest. The square root brings a range twice as wide in there.
    root = cv2.merge([np.sqrt(light)] * 3)
    shown = through_opencv(cv2.createTonemapMantiuk(1.0, scale * 2**POWER, 1.0), root)[..., 1]
    black = min(np.percentile(where_lit(shown, light), DARKEST), GLARE)
    return in_colour(radiance, light, np.maximum(shown - black, 0) / (1 - black), saturation, gamma)


def through_opencv(operator, radiance) -> np.ndarray:
    """What an operator of OpenCV makes of a radiance map, kept from two of its traps.

    It stretches the map to 0..1 first, which moves every value where the least is not 0. And a pixel that is
    then black in all channels becomes NaN (0 / 0), which spoils the whole picture if it is the first one. So
    no pixel is black, and one row and one column more, cut off again, hold a 0 in a single channel. They also
    let Mantiuk's pyramid stand on a single pixel.
    operator : as cv2.createTonemap... gives it; radiance : (H, W, 3) float32. Returns (H, W, 3) float32.
    >>> through_opencv(cv2.createTonemap(1.0), np.float32([[[0.5] * 3, [1] * 3]]))[0, :, 0].round(2).tolist()
    [0.5, 1.0]
    """
    safe = cv2.copyMakeBorder(radiance, 0, 1, 0, 1, cv2.BORDER_REPLICATE)
    np.maximum(safe, LEAST, out=safe)
    safe[-1, np.argmin(luminance(safe[-1])), 2] = 0
    return operator.process(safe)[:-1, :-1]


OPERATORS = {
    "gamma": tonemap_gamma,
    "reinhard": tonemap_reinhard,
    "reinhard_global": tonemap_reinhard_global,
    "drago": tonemap_drago,
    "mantiuk": tonemap_mantiuk,
    "durand": tonemap_durand,
}


def to_8bit(ldr) -> np.ndarray:
    """(H, W, 3) uint8 from a picture ldr, (H, W, 3) float in 0..1. Clipped first: 1.02 * 255 as uint8 would be 4.

    >>> to_8bit([0.0, 0.2, 1.02]).tolist()
    [0, 51, 255]
    """
    return np.rint(np.clip(ldr, 0, 1) * 255).astype(np.uint8)


def write_picture(path, ldr) -> None:
    """Write a tone-mapped picture ldr, (H, W, 3) float in 0..1, RGB, as .png or .jpg: 24 bits a pixel.

    The file at path is complete or not there. Raises ValueError for another file name.

    >>> write_picture("window.tiff", np.ones((2, 3, 3)))
    Traceback (most recent call last):
    ValueError: window.tiff: pictures are written as .png or .jpg.
    """
    path = Path(path)
    if path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise ValueError(f"{path}: pictures are written as .png or .jpg.")
    done, data = cv2.imencode(path.suffix.lower(), np.ascontiguousarray(to_8bit(ldr)[..., ::-1]))
    if not done:
        raise ValueError(f"{path}: OpenCV could not write this picture of shape {ldr.shape}.")
    write_whole(path, data.tobytes())
