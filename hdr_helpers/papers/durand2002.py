"""Fast bilateral filtering for the display of high-dynamic-range images.

F. Durand and J. Dorsey, SIGGRAPH 2002. Log luminance is split into a base layer, smoothed by a bilateral
filter that stops at edges, and the detail that is left. Only the base is compressed, so the contrast
between window and wall shrinks and the grain of the wood does not. OpenCV once had this operator
(createTonemapDurand); the packages of today no longer do.
"""

import cv2
import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)  # Rec. 709


def tonemap_durand(radiance, contrast=30.0, detail=1.0, saturation=0.8, gamma=2.2) -> np.ndarray:
    """Tone-map by compressing the bilateral base layer.

    radiance : (H, W, 3) float32, linear RGB, finite, not negative
    contrast : ratio of brightest to darkest that is left of the base; less lifts the dark parts
    detail : factor on the detail layer, in log; 1 keeps it as it was
    saturation : 0 is grey, 1 keeps colour ratios, which look too strong once luminance is compressed
    gamma : display gamma; above 1 brightens
    Returns (H, W, 3) float32, not clipped.
    """
    light = np.maximum(radiance @ LUMINANCE, np.float32(1e-6))
    log_light = np.log10(light)
    base = fast_bilateral(log_light, sigma_space=0.02 * max(light.shape))
    darkest, brightest = np.percentile(base, [0.5, 99.8])
    factor = np.log10(contrast) / max(brightest - darkest, np.log10(contrast))
    compressed = 10 ** (factor * (base - brightest) + detail * (log_light - base))
    return ((radiance / light[..., None]) ** saturation * compressed[..., None]) ** (1 / gamma)


def fast_bilateral(values, sigma_space: float, sigma_range: float = 0.4) -> np.ndarray:
    """Edge-preserving blur in the time of a few Gaussian ones (section 5 of the paper).

    values : (H, W) float32
    sigma_space : pixels; the paper takes 2% of the picture's width
    sigma_range : in the units of values; 0.4 in log10 is the paper's

    For a fixed centre value the bilateral filter is a ratio of two Gaussian blurs. It is computed for
    centre values half a sigma_range apart, on a smaller picture, and interpolated to each pixel's own.
    """
    small_sigma = min(sigma_space, 4.0)
    height, width = values.shape
    small_size = (max(1, round(width * small_sigma / sigma_space)), max(1, round(height * small_sigma / sigma_space)))
    small = cv2.resize(values, small_size, interpolation=cv2.INTER_NEAREST)
    low, high = float(values.min()), float(values.max())
    centres = np.linspace(low, high, max(2, int(np.ceil((high - low) / (0.5 * sigma_range))) + 1))
    step = centres[1] - centres[0]
    result = np.zeros_like(values)
    for centre in centres:
        near = np.exp(-0.5 * ((small - centre) / sigma_range) ** 2).astype(np.float32)
        blurred = cv2.GaussianBlur(near * small, (0, 0), small_sigma)
        blurred /= np.maximum(cv2.GaussianBlur(near, (0, 0), small_sigma), np.float32(1e-10))
        share = np.clip(1 - np.abs(values - np.float32(centre)) / max(step, 1e-12), 0, 1).astype(np.float32)
        result += share * cv2.resize(blurred, (width, height), interpolation=cv2.INTER_LINEAR)
    return result
