"""How much each pixel value is believed, by the least squares of gsolve and by the mean of merge_debevec.

All shapes are 0 up to black and from clipped on. Which is best depends on what errs: the hat gives the benefit of the
doubt to the middle, the others follow an idea of the noise. A row of gsolve is multiplied by its weight, which is
best as 1 / standard deviation; a mean such as equation 6 is best with 1 / variance. Debevec and Malik, who do not
know the noise, use one hat for both.
"""

import numpy as np

from hdr_helpers._response import LEVELS
from hdr_helpers._response.clipping import CLIPPED, black_level

NOISE = 4  # up to here a pixel value is more noise and rounding than light, whatever the black level


def hat_weights(black: int = 0, clipped: int = LEVELS) -> np.ndarray:
    """A hat that trusts the middle (Debevec and Malik 1997, equation 4).

    black : the camera's black level; values up to it get weight 0, and the hat rises from there
    clipped : values from here on get weight 0
    Returns (256,) float64. The defaults give the paper's hat: 0 at 0 and at 255, 127 in the middle.
    """
    z = np.arange(LEVELS)
    return _between(np.minimum(z - black, LEVELS - 1 - z), black, clipped)


def gaussian_weights(black: int = 0, clipped: int = LEVELS) -> np.ndarray:
    """A bell that falls to 2% at both ends: exp(-4 (z - m)^2 / m^2), m the middle (Robertson, Borman, Stevenson 1999).

    black, clipped : as for hat_weights
    Returns (256,) float64, 1 in the middle.
    """
    middle = (LEVELS - 1) / 2
    return _between(np.exp(-4 * ((np.arange(LEVELS) - middle) / middle) ** 2), black, clipped)


def uniform_weights(black: int = 0, clipped: int = LEVELS) -> np.ndarray:
    """All values alike between the cut-offs, 1 there: nobody's proposal, but what "drop what is clipped" comes to.

    black, clipped : as for hat_weights. Returns (256,) float64.
    """
    return _between(np.ones(LEVELS), black, clipped)


def noise_weights(g, black: int = 0, clipped: int = LEVELS) -> np.ndarray:
    """1 / g'(z), highest 1: by how much less one pixel value more or less matters (Mitsunaga and Nayar 1999).

    If all pixel values err alike, as rounding and JPEG let them, an error of one is g'(z) in ln E, so this is 1 /
    standard deviation. Shot noise, which depends on the camera, is left out.
    g : (256,) float, log inverse response; black, clipped : as for hat_weights
    Returns (256,) float64.
    """
    slope = np.gradient(np.asarray(g, dtype=np.float64))
    usable = uniform_weights(black, clipped) > 0
    # Where a curve stands still a pixel value says nothing, not everything.
    weights = np.divide(1, slope, out=np.zeros(LEVELS), where=usable & (slope > 1e-6))
    return weights / weights.max() if weights.any() else weights


def fitted_weights(images, valid=None, shape=hat_weights) -> np.ndarray:
    """Weights over the pixel values that this camera can be trusted with: above black, below CLIPPED.

    images : P arrays (H, W, 3) uint8 or uint16, shortest exposure first
    valid : P arrays (H, W) bool, the pixels that count, or None for all
    shape : hat_weights, or another function of (black, clipped)
    """
    return shape(max(black_level(images, valid), NOISE), CLIPPED)


def checked_weights(w) -> np.ndarray:
    """w as (256,) float64. Raises ValueError unless it holds 256 weights, none negative and not all 0."""
    w = several_weights(w)
    if w.shape != (LEVELS,):
        raise ValueError(f"w must hold {LEVELS} weights, none negative and not all 0; got shape {w.shape}.")
    return w


def several_weights(w) -> np.ndarray:
    """w as (..., 256) float64, for several channels or photographs. Raises ValueError as checked_weights does."""
    w = np.asarray(w, dtype=np.float64)
    if w.shape[-1:] != (LEVELS,) or not np.all(np.isfinite(w)) or w.min() < 0 or not w.max() > 0:
        raise ValueError(f"w must hold {LEVELS} weights, none negative and not all 0; got shape {w.shape}.")
    return w


def _between(weights, black, clipped) -> np.ndarray:
    weights = np.clip(weights, 0, None).astype(np.float64)
    weights[: black + 1] = 0
    weights[clipped:] = 0
    return weights
