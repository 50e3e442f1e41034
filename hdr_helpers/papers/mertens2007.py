"""Exposure fusion: a picture straight from the photographs, without a radiance map.

T. Mertens, J. Kautz and F. Van Reeth, Pacific Graphics 2007. Each pixel of each photograph is judged by three
qualities; the photographs are averaged with these as weights. Times and response are not needed. The weights jump
from pixel to pixel, so the average is taken in a pyramid: coarse parts are mixed by smooth weights, fine parts by
sharp ones, and no seam shows.
"""

from itertools import pairwise

import cv2
import numpy as np

MIDDLE, SPREAD = 0.5, 0.2  # well exposed is near the middle grey; the paper's section 3.1
LEAST = np.float32(1e-12)  # keeps the weights of a pixel apart from 0 where every photograph is flat


def quality_maps(image, middle=MIDDLE, spread=SPREAD) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Contrast, saturation and well-exposedness of each pixel of a photograph (section 3.1).

    image : (H, W, 3) uint8 or uint16, RGB, or float32 in 0..1
    middle, spread : a channel's best value, and how far from it is still good, both in 0..1
    Returns three arrays (H, W) float32: the size of the Laplacian of the grey picture; the standard deviation of
    the three channels; and the product of the three channels' Gaussians round the middle, 0..1.

    >>> contrast, saturation, exposedness = quality_maps(np.full((4, 4, 3), 0.5, np.float32))  # a grey wall
    >>> contrast.max().round(3).item(), saturation.max().round(3).item(), exposedness.min().round(3).item()
    (0.0, 0.0, 1.0)
    """
    image = _unit(image)
    contrast = np.abs(cv2.Laplacian(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), cv2.CV_32F))
    r, g, b = cv2.split(image)  # three planes: numpy is slow along a short last axis
    # By differences of channels, not from their mean: the rounding of a mean would decide between grey pixels.
    saturation = np.sqrt((r - g) ** 2 + (g - b) ** 2 + (b - r) ** 2) / 3
    distance = (r - middle) ** 2 + (g - middle) ** 2 + (b - middle) ** 2
    return contrast, saturation, cv2.exp(distance * np.float32(-0.5 / spread**2)).reshape(contrast.shape)


def fusion_weights(images, contrast=1.0, saturation=1.0, exposedness=1.0, valid=None) -> np.ndarray:
    """How much each photograph counts at each pixel (section 3.2): (P, H, W) float32, the P of a pixel add up to 1.

    Arguments and errors as for exposure_fusion. Where no photograph is valid all count alike.

    >>> dark, middle, white = (np.full((4, 4, 3), value, np.uint8) for value in (10, 128, 250))
    >>> fusion_weights([dark, middle, white], contrast=0, saturation=0)[:, 0, 0].argmax().item()
    1
    """
    images, valid = _checked(images, valid)
    weights = np.empty((len(images), *images[0].shape[:2]), dtype=np.float32)
    for weight, image, mask in zip(weights, images, valid, strict=True):
        weight[...] = LEAST
        # A power of 0 leaves a quality out, as x^0 = 1.
        powers = zip(quality_maps(_filled(_unit(image), mask)), (contrast, saturation, exposedness), strict=True)
        weight += np.prod([quality ** np.float32(power) for quality, power in powers], axis=0)
        if mask is not None:
            weight[~mask] = 0
    total = weights.sum(axis=0)
    weights[:, total == 0] = 1
    total[total == 0] = len(images)
    weights /= total
    return weights


def exposure_fusion(images, contrast=1.0, saturation=1.0, exposedness=1.0, valid=None) -> np.ndarray:
    """Fuse the photographs of a bracket into one picture (section 3.2).

    images : P arrays (H, W, 3), RGB, all uint8 or all uint16, aligned; in any order
    contrast, saturation, exposedness : powers of the three qualities; 0 leaves one out, more makes it decide more.
        1 for all is the paper's; OpenCV's createMergeMertens leaves exposedness out unless told otherwise
    valid : P arrays (H, W) bool, the pixels that count, or None for all; what others hold has no influence
    Returns ldr, (H, W, 3) float32 in 0..1, RGB: as bright and as strongly encoded as the photographs are.
    Raises ValueError where shapes or types don't fit.

    With valid=None this is OpenCV's result, apart from rounding and from what OpenCV leaves below 0 and above 1.

    >>> photograph = np.arange(192, dtype=np.uint8).reshape(8, 8, 3)
    >>> np.abs(exposure_fusion([photograph, photograph]) * 255 - photograph).max().round(2).item()  # nothing to choose
    0.0
    """
    images, valid = _checked(images, valid)
    weights = fusion_weights(images, contrast, saturation, exposedness, valid)
    levels = int(np.log2(min(images[0].shape[:2])))
    fused = None
    for image, mask, weight in zip(images, valid, weights, strict=True):
        details = laplacian_pyramid(_filled(_unit(image), mask), levels)
        parts = [d * w[..., None] for d, w in zip(details, gaussian_pyramid(weight, levels), strict=True)]
        fused = parts if fused is None else [a + b for a, b in zip(fused, parts, strict=True)]
    picture = fused[-1]
    for detail in fused[-2::-1]:
        picture = detail + _twice(picture, detail.shape)
    return np.clip(picture, 0, 1)


def gaussian_pyramid(image, levels) -> list[np.ndarray]:
    """An image and levels smaller ones, each blurred and half as wide as the one before.

    image : (H, W) or (H, W, C) float32; levels : how many. Returns levels + 1 arrays of float32.

    >>> [small.shape for small in gaussian_pyramid(np.zeros((9, 16), np.float32), 2)]
    [(9, 16), (5, 8), (3, 4)]
    """
    pyramid = [image]
    for _ in range(levels):
        pyramid.append(cv2.pyrDown(pyramid[-1]))
    return pyramid


def laplacian_pyramid(image, levels) -> list[np.ndarray]:
    """What each level of a Gaussian pyramid shows beyond the next coarser one; and the coarsest as it is.

    image, levels : as for gaussian_pyramid. Returns levels + 1 arrays of float32.

    >>> fine, coarse = laplacian_pyramid(np.full((8, 8), 0.5, np.float32), 1)  # an even wall has no detail
    >>> fine.max().round(3).item(), coarse.max().round(3).item()
    (0.0, 0.5)
    """
    pyramid = gaussian_pyramid(image, levels)
    details = [fine - _twice(coarse, fine.shape) for fine, coarse in pairwise(pyramid)]
    return [*details, pyramid[-1]]


def _checked(images, valid) -> tuple[list, list]:
    images = list(images)
    forms = {(np.shape(image), np.asarray(image).dtype) for image in images}
    if len(forms) != 1 or np.shape(images[0])[2:] != (3,) or images[0].dtype not in (np.uint8, np.uint16):
        told = sorted(f"{shape} {dtype}" for shape, dtype in forms) or "none"
        raise ValueError(f"Photographs must be (H, W, 3) uint8 or uint16, of one size and one type; got {told}.")
    valid = [None] * len(images) if valid is None else list(valid)
    shape = images[0].shape[:2]
    if len(valid) != len(images) or any(mask is not None and np.shape(mask) != shape for mask in valid):
        raise ValueError(f"valid must hold one mask of {shape} for each of the {len(images)} photographs.")
    return images, valid


def _unit(image) -> np.ndarray:
    """A photograph as float32 in 0..1."""
    image = np.asarray(image)
    if image.dtype.kind == "f":
        return image.astype(np.float32, copy=False)
    return image * np.float32(1 / np.iinfo(image.dtype).max)


def _twice(image, shape) -> np.ndarray:
    return cv2.pyrUp(image, dstsize=(shape[1], shape[0]))


def _filled(image, mask) -> np.ndarray:
    """A photograph whose invalid pixels continue the valid ones smoothly.

    Weights alone can't keep them out: a pyramid's coarse levels mix neighbours. Each level is averaged over valid
    pixels alone; gaps take over the next coarser level.
    """
    if mask is None or mask.all():
        return image
    if not mask.any():
        return np.full_like(image, MIDDLE)
    levels = int(np.log2(min(image.shape[:2])))
    shares = gaussian_pyramid(mask.astype(np.float32), levels)
    sums = gaussian_pyramid(np.where(mask[..., None], image, np.float32(0)), levels)
    filled = np.full_like(sums[-1], np.mean(image[mask], axis=0))
    for total, share in zip(sums[::-1], shares[::-1], strict=True):
        coarse = filled if filled.shape == total.shape else _twice(filled, total.shape)
        known = (share > 1e-3)[..., None]
        filled = np.where(known, total / np.maximum(share, 1e-3)[..., None], coarse)
    return np.where(mask[..., None], image, filled)
