"""Scenes for the virtual camera: radiance that is known exactly, path-traced or made up at random."""

from functools import cache

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from hdr_helpers.lab.data import DATA

MARGIN = 24  # pixels that the path-traced scenes have to spare on every side, for a hand that shakes
STORED_SCALE = 4  # float16 ends at 65504; the scenes do not
CHAPEL_SCALE, CLOISTER_SCALE = 8, 4  # of the radiance in data/scenes


def lens(radiance, sigma: float = 0.6) -> np.ndarray:
    """What a lens makes of scene radiance (H, W, 3): a little blur (sigma in pixels). Float64.

    >>> lamp = np.zeros((9, 9, 3))
    >>> lamp[4, 4] = 100
    >>> seen = lens(lamp)
    >>> round(seen.sum().item(), 6), bool(seen[4, 4, 0] < 100)  # its light is spread, and all there
    (300.0, True)
    """
    return gaussian_filter(np.asarray(radiance, dtype=np.float64), (sigma, sigma, 0), mode="nearest")


def chapel_scene() -> np.ndarray:
    """The chapel behind the lens, (560, 816, 3) float32, relative radiance, RGB; nothing moves.

    Rounded to what a truth file holds, so that the stored truth is exactly what the sensor saw.

    >>> chapel_scene().shape
    (560, 816, 3)
    """
    with np.load(DATA / "scenes" / "chapel.npz") as stored:
        return _storable(lens(stored["radiance"].astype(np.float64) * CHAPEL_SCALE))


@cache
def cloister_scene() -> tuple[np.ndarray, ...]:
    """The cloister behind the lens at five moments, each (560, 816, 3) float32: two monks walk, a lantern swings.

    Rounded like the chapel. Before the first step and after the last there is always somebody in the picture; where
    nobody ever is, all five are the same to the last bit.

    >>> first, *_, last = cloister_scene()
    >>> bool(0 < np.mean(first != last) < 0.5)  # something moves, most does not
    True
    """
    with np.load(DATA / "scenes" / "cloister.npz") as stored:
        plate, values = stored["plate"], stored["values"]
        changed = np.unpackbits(stored["changed"]).view(bool).reshape(-1, *plate.shape[:2])
    frames = np.repeat(plate[None], len(changed), axis=0)
    frames[changed] = values
    return tuple(_storable(lens(frame.astype(np.float64) * CLOISTER_SCALE)) for frame in frames)


def _storable(radiance) -> np.ndarray:
    return (radiance / STORED_SCALE).astype(np.float16).astype(np.float32) * STORED_SCALE


def random_scene(seed: int, shape=(512, 768), stops: float = 18.5) -> np.ndarray:
    """A scene that nobody has seen: texture, light that falls off, patches in light and shade, lamps, colours.

    shape : rows and columns
    stops : from the 0.1th to the 99.9th percentile of its values
    Returns (H, W, 3) float32, relative radiance, RGB; the same seed gives the same scene.

    >>> scene = random_scene(7, shape=(60, 80), stops=12)
    >>> low, high = np.percentile(scene, [0.1, 99.9])
    >>> round(float(np.log2(high / low)))
    12
    """
    (height, width), rng = shape, np.random.default_rng((seed, 815))
    y, x = np.mgrid[:height, :width].astype(np.float32)
    phase = rng.uniform(0, 2 * np.pi, 2)
    # All in stops; numbers are what makes such a picture look like a scene with windows and corners.
    scene = 1.6 * _texture(shape, rng, 0.56)
    scene += 2.5 * np.cos(3.1 * x / width + phase[0]) * np.cos(2.3 * y / height + phase[1])
    for k in range(28):
        middle, size = rng.uniform(0, 1, 2) * (width, height), rng.uniform(0.02, 0.14, 2) * width
        patch, step, angle = np.zeros(shape, np.uint8), rng.uniform(-3.5, 4.5), rng.uniform(0, 90)
        if k % 2:
            cv2.ellipse(patch, np.int_(middle).tolist(), (np.int_(size / 2) + 2).tolist(), angle, 0, 360, 1, -1)
        else:
            cv2.rectangle(patch, np.int_(middle - size / 2).tolist(), np.int_(middle + size / 2).tolist(), 1, -1)
        scene += np.float32(step) * patch
    for _ in range(9):
        middle, radius = rng.uniform(0, 1, 2) * (width, height), rng.uniform(0.004, 0.012) * width
        distance = ((x - middle[0]) ** 2 + (y - middle[1]) ** 2) / radius**2
        scene = np.logaddexp2(scene, (9 - 1.5 * distance).astype(np.float32))
    colours = np.stack([_texture(shape, rng, 0.47) for _ in range(3)], axis=-1)
    scene = scene[..., None] + 1.1 * (colours - colours.mean(axis=-1, keepdims=True))
    low, high = np.percentile(scene, [0.1, 99.9])
    return np.exp2(np.minimum((scene - high) * (stops / (high - low)), 2)).astype(np.float32)


def _texture(shape, rng, roughness) -> np.ndarray:
    """Noise of all sizes, (H, W) float32; roughness is by how much each half as large counts."""
    longest, texture, power = max(shape), np.zeros(shape, np.float32), 0.0
    for octave in range(1, int(np.log2(longest)) + 1):
        grid = rng.standard_normal([-(-n * 2**octave // longest) + 2 for n in shape], dtype=np.float32)
        texture += roughness**octave * cv2.resize(grid, shape[::-1], interpolation=cv2.INTER_CUBIC)
        power += roughness ** (2 * octave)
    return texture / np.float32(np.sqrt(power))
