"""The best that any merge can do: the Cramer-Rao bound of a virtual camera whose noise is known."""

import numpy as np

from hdr_helpers.crf import LEVELS
from hdr_helpers.lab.camera import sensitivity


def best_possible(camera, radiance, times, seed: int = 0) -> np.ndarray:
    """A radiance map with the least noise that an unbiased estimate can have, (H, W, 3) float64.

    camera : Camera without JPEG; radiance : (H, W, 3) that it photographed; times : (P,) ascending, seconds
    seed : of the noise

    Each photograph in which a pixel is not clipped brings the information t^2 / V(E t) of its light, V the variance of
    shot noise, reading noise and rounding; information adds up, and no estimate has less variance than one over it
    (Cramer and Rao). The map is the truth with Gaussian noise of that variance. What is clipped in every photograph
    is known to lie above the shortest one's white only.

    >>> from hdr_helpers.lab.camera import Camera
    >>> wall = np.full((20, 30, 3), 0.01)
    >>> wall[0] = 1.0  # a lamp above it
    >>> one, two = (best_possible(Camera(jpeg_quality=None), wall, times)[1:] for times in ([0.1], [0.1, 0.8]))
    >>> bool(two.std() < one.std() / 2)  # nine times the light is a third of the noise, and more in the dark
    True
    """
    exposure = np.exp(camera.crf() - camera.crf()[:, -1:])  # 1 at white
    slope = np.gradient(exposure, axis=1)
    light = np.asarray(radiance, dtype=np.float64) * sensitivity(radiance, times[0])
    information = np.zeros(light.shape)
    for t in times:
        for c in range(3):
            x = light[..., c] * t
            electrons = x / camera.full_well + (camera.read_noise / camera.full_well) ** 2
            rounding = (1 / (2**camera.bits - 1) ** 2 + np.interp(x, exposure[c], slope[c]) ** 2) / 12
            information[..., c] += np.where(x < exposure[c, LEVELS - 2], t**2 / (electrons + rounding), 0)
    measured = information > 0
    noise = np.random.default_rng(seed).standard_normal(light.shape) / np.sqrt(np.where(measured, information, np.inf))
    return np.maximum(np.where(measured, light + noise, np.minimum(light, 1 / times[0])), 1e-12)
