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
    centre values half a sigma_range apart and interpolated to each pixel's own value. Blurs that wide lose
    nothing when they are made on a smaller picture.
    """
    height, width = values.shape
    shrink = max(1.0, sigma_space / 4)
    small = (max(1, round(width / shrink)), max(1, round(height / shrink)))

    def blur(picture):
        picture = cv2.resize(picture, small, interpolation=cv2.INTER_AREA)
        return cv2.GaussianBlur(picture, (0, 0), sigma_space / shrink)

    low, high = float(values.min()), float(values.max())
    if high - low < 1e-6 * sigma_range:
        return values.copy()
    centres = np.linspace(low, high, max(2, int(np.ceil((high - low) / (0.5 * sigma_range))) + 1), dtype=np.float32)
    step = centres[1] - centres[0]
    result = np.zeros_like(values)
    for centre in centres:
        offset = values - centre
        near = cv2.exp(offset**2 * np.float32(-0.5 / sigma_range**2))
        blurred = centre + blur(near * offset) / np.maximum(blur(near), np.float32(1e-12))
        share = np.maximum(1 - np.abs(offset) / step, 0)
        result += share * cv2.resize(blurred, (width, height), interpolation=cv2.INTER_LINEAR)
    return result
