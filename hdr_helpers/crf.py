"""Stage 3: recover the camera response function.

After P. Debevec and J. Malik, Recovering High Dynamic Range Radiance Maps from Photographs, SIGGRAPH
1997. A pixel value Z of pixel i in photograph j obeys g(Z_ij) = ln E_i + ln dt_j (equation 2), where g is
the log inverse response. Section 2.1 finds g and all ln E_i by linear least squares, equation 3.

Each ln E_i stands only in the rows of its own pixel. For a given g its best value is therefore a
weighted mean, and putting that mean back leaves a problem in the 256 values of g alone: 256 equations
however many pixels there are. That is how gsolve works; the matrix of the paper's appendix is never built.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import scipy.linalg
from scipy.sparse import diags_array

from hdr_helpers._response import LEVELS, MIDDLE
from hdr_helpers._response.clipping import CLIPPED, RINGING, black_level, whole_white
from hdr_helpers._response.evidence import evidence, joint_histograms
from hdr_helpers._response.samples import sample_pixels
from hdr_helpers._response.weights import (
    NOISE,
    checked_weights,
    fitted_weights,
    gaussian_weights,
    hat_weights,
    noise_weights,
    several_weights,
    uniform_weights,
)
from hdr_helpers.load import Bracket, in_8_bits
from hdr_helpers.papers.grossberg_nayar2003 import TooLittleEvidence, response_from_transfers, standard_errors

__all__ = [
    "CLIPPED",
    "LEVELS",
    "MIDDLE",
    "NOISE",
    "RINGING",
    "Response",
    "black_level",
    "checked_weights",
    "crf_opencv",
    "evidence",
    "fitted_weights",
    "gaussian_weights",
    "gsolve",
    "hat_weights",
    "joint_histograms",
    "noise_weights",
    "recover_crf",
    "sample_pixels",
    "several_weights",
    "uniform_weights",
    "whole_white",
]

CHUNK = 1 << 16  # pixels worked on at a time
FLOOR = 1e-4  # least weight of a smoothness row, so that values that no weight reaches stay defined
SMOOTHNESS = 20.0  # lambda for 100 pixels
# Pairs of exposures by which a response is recovered, in stops: nearer ones share too much noise, farther ones values.
NEAREST, FARTHEST = 2.4, 6.6


@dataclass(frozen=True, eq=False)
class Response:
    """A camera's response as recovered.

    crf : (3, 256) float64, log inverse response of red, green and blue, crf[:, 128] = 0
    errors : (3, 256) float64, standard error of each difference crf[c, z] - crf[c, 128]; noise and rounding are in
        it, JPEG only as far as it makes photographs disagree
    method : for people, how it was found
    """

    crf: np.ndarray
    errors: np.ndarray
    method: str


def gsolve(Z, B, lam: float, w) -> tuple[np.ndarray, np.ndarray]:
    """Log inverse response of one channel by least squares (equation 3 with the weights of equation 4).

    Z : (N, P) integers 0..255, values of N pixels in P photographs
    B : (P,) float, log exposure times, ln seconds
    lam : smoothness, lambda in the paper; larger is smoother
    w : (256,) float, weight of each pixel value

    Returns g, (256,) float64 with g[128] = 0, the log exposure of each pixel value; and log_E, (N,)
    float64, the log irradiance of each pixel, NaN where all its values have weight 0.
    Raises ValueError where shapes or values don't fit.

    >>> Z = np.array([(z, 2 * z) for z in range(10, 120)])  # a linear camera: twice the time, twice the value
    >>> g, log_E = gsolve(Z, np.log([1, 2]), lam=1.0, w=hat_weights())
    >>> ((g[[32, 64, 128]] - g[64]) / np.log(2)).round(2).tolist()  # in stops
    [-1.0, 0.0, 1.0]
    """
    Z, B = np.asarray(Z), np.asarray(B, dtype=np.float64)
    if Z.ndim != 2 or not Z.size or B.shape != Z.shape[1:]:
        raise ValueError(f"Z must be (N, P) and B (P,), one log time for each column; got {Z.shape}, {B.shape}.")
    if not np.issubdtype(Z.dtype, np.integer) or Z.min() < 0 or Z.max() >= LEVELS:
        raise ValueError(f"Z must hold integers in 0..{LEVELS - 1}; got {Z.dtype} in {Z.min()}..{Z.max()}.")
    w = checked_weights(w)
    if not lam > 0:
        raise ValueError(f"lam must be positive; got {lam}.")
    if not np.all(np.isfinite(B)) or np.ptp(B) == 0:
        raise ValueError("B must be finite and hold at least two different log exposure times.")
    return _solve_reduced(Z, B, lam, w)[:2]


def _solve_reduced(Z, B, lam, w):
    """Normal equations of g after every log irradiance has been eliminated: g, log_E and the standard errors of g."""
    edges, pull = _ties(Z, B, w**2)
    if not edges.any():
        raise ValueError(
            "No pixel has two different usable values, so nothing ties one pixel value to another; "
            "take photographs whose exposures overlap: one to three stops apart."
        )

    # Smoothness, equation 4: lam w(z) (g(z-1) - 2 g(z) + g(z+1)) for z = 1 .. 254, every one of them.
    second = diags_array((1.0, -2.0, 1.0), offsets=(0, 1, 2), shape=(LEVELS - 2, LEVELS))
    smooth = diags_array(lam * np.maximum(w, FLOOR * w.max())[1:-1]) @ second
    normal = np.diag(edges.sum(axis=1)) - edges + (smooth.T @ smooth).toarray()
    normal[MIDDLE, MIDDLE] += normal.diagonal().max()  # the gauge row; its size does not change the answer

    scale = 1 / np.sqrt(normal.diagonal())
    factor = scipy.linalg.cho_factor(normal * scale[:, None] * scale)
    g = scale * scipy.linalg.cho_solve(factor, scale * pull)
    for _ in range(2):
        # The normal equations lose half the digits. Residuals formed from differences of g, not from
        # large sums, win them back.
        residual = pull - (edges * (g[:, None] - g)).sum(axis=1) - smooth.T @ (smooth @ g)
        g += scale * scipy.linalg.cho_solve(factor, scale * residual)
    g -= g[MIDDLE]

    log_E, missed, used = np.empty(len(Z)), 0.0, 0
    for few in _chunks(Z):
        weight = (w**2)[Z[few]]
        total = weight.sum(axis=1)
        said = g[Z[few]] - B
        log_E[few] = np.divide((weight * said).sum(axis=1), total, out=np.full(len(total), np.nan), where=total > 0)
        missed += np.nansum(weight * (said - log_E[few, None]) ** 2)
        used += np.count_nonzero(weight) - np.count_nonzero(total)
    # The weights say how the variances of two rows compare; what the equations miss says how large they are.
    return g, log_E, standard_errors(scale, factor, missed / max(used, 1))


def _ties(Z, B, W) -> tuple[np.ndarray, np.ndarray]:
    """What all pixels say of the 256 values of g: a graph of how strongly two of them are tied, and the pull on each.

    W : (256,), squared weights. With W_ij = W(Z_ij) and a_i = sum_j W_ij, the best ln E_i for a given g is
    sum_j W_ij (g(Z_ij) - B_j) / a_i. What is left of pixel i's data term is a sum over pairs of photographs of
    W_ij W_ik / a_i ((g(Z_ij) - g(Z_ik)) - (B_j - B_k))^2:
    edges, (256, 256), are the sums of W_ij W_ik / a_i over all pixels with these two values; pull, (256,), says how
    far the times push each value of g up, sum of W_ij (B_j - the pixel's weighted mean of B).
    """
    edges, pull = np.zeros(LEVELS * LEVELS), np.zeros(LEVELS)
    for few in _chunks(Z):
        z = np.ascontiguousarray(Z[few].T).astype(np.intp)  # a photograph a row
        weight = W[z]
        total = weight.sum(axis=0)
        per = np.divide(1, total, out=np.zeros_like(total), where=total > 0)
        mean = (weight * B[:, None]).sum(axis=0) * per
        for j in range(len(z)):
            pull += np.bincount(z[j], weight[j] * (B[j] - mean), LEVELS)
            row = z[j] * LEVELS
            for k in range(j + 1, len(z)):
                edges += np.bincount(row + z[k], per, LEVELS * LEVELS)
    # The weights of the two values are the same for all pixels that have them.
    edges = edges.reshape(LEVELS, LEVELS) * W * W[:, None]
    edges = edges + edges.T
    np.fill_diagonal(edges, 0)
    return edges, pull


def _chunks(Z):
    """Slices of a few pixels at a time: what they need stays in the processor's cache, however many there are."""
    return (slice(start, start + CHUNK) for start in range(0, len(Z), CHUNK))


def recover_crf(bracket: Bracket, lam: float = 1.0) -> Response:
    """The camera's log inverse response for red, green and blue, by the best method that the photographs allow.

    bracket : Bracket with P >= 2 photographs; of 16-bit ones the upper 8 bits speak, and only valid pixels
    lam : smoothness; 1 is right for cameras, larger is smoother. How many pixels there are changes nothing in it.

    Brightness transfer functions take the whole image's evidence and are not bent by noise
    (papers/grossberg_nayar2003.py). Where there is too little of it for them, the paper's least squares has to do.
    Of large brackets every second, third ... pixel each way speaks (_response/evidence.py).
    Returns a Response. Its curves nowhere fall.
    Raises ValueError where nothing ties one pixel value to another, or lam is not positive.

    >>> light = np.geomspace(1, 250, 4800).reshape(60, 80, 1) * np.ones(3)  # and a linear camera:
    >>> images = [np.uint8(np.minimum(light * t, 255)) for t in (1, 4, 16)]
    >>> crf = recover_crf(Bracket(images, [1, 4, 16], ("a", "b", "c"))).crf
    >>> ((crf[:, 128] - crf[:, 64]) / np.log(2)).round(1).tolist()  # twice the value is one stop
    [1.0, 1.0, 1.0]
    """
    if not lam > 0:
        raise ValueError(f"lam must be positive; got {lam}.")
    try:
        curves, errors = _by_transfers(bracket, lam)
        method = "brightness transfer functions (Grossberg and Nayar 2003)"
    except TooLittleEvidence:
        curves, errors = _by_least_squares(bracket, lam)
        method = "least squares (Debevec and Malik 1997)"
    # Noise can leave a dip where few pixels speak; a response never falls (section 2.1).
    curves = np.maximum.accumulate(curves, axis=1)
    return Response(curves - curves[:, MIDDLE : MIDDLE + 1], errors, method)


def _by_transfers(bracket, lam):
    """Curves and errors from the joint histograms of pairs of photographs, each (3, 256)."""
    stops = (bracket.log_times[:, None] - bracket.log_times) / np.log(2)
    pairs = np.argwhere((stops > NEAREST) & (stops < FARTHEST))  # longer, shorter
    if len(np.unique(pairs)) < len(bracket):  # photographs close to each other are better than none
        pairs = np.argwhere((stops > 0) & (stops < FARTHEST))
    images, masks = evidence(bracket.images, bracket.valid)
    joints, ratios = joint_histograms(images, masks, pairs), stops[tuple(pairs.T)] * np.log(2)
    black = black_level(images, bracket.valid and masks)
    black = black if black > NOISE else 0  # a value or two is rounding, not a level
    curves = [response_from_transfers(joints[:, c], ratios, len(bracket), lam, black) for c in range(3)]
    return np.stack(curves, axis=1)


def _by_least_squares(bracket, lam):
    """Curves and errors by gsolve's equations from all pixels that are valid in all photographs, each (3, 256)."""
    masks = [None] * len(bracket) if bracket.valid is None else bracket.valid
    images = [whole_white(in_8_bits(image), mask) for image, mask in zip(bracket.images, masks, strict=True)]
    everywhere = np.ones(images[0].shape[:2], bool) if bracket.valid is None else np.logical_and.reduce(bracket.valid)
    Z = np.stack([image[everywhere] for image in images], axis=1)  # (N, P, 3)
    w = fitted_weights(images, bracket.valid)
    # As smooth as 100 pixels would be with SMOOTHNESS: more give a surer curve, not a rougher one.
    lam *= SMOOTHNESS * np.sqrt(len(Z) / 100)
    curves = [_solve_reduced(Z[..., c], bracket.log_times, lam, w) for c in range(3)]
    return np.array([[g for g, _, _ in curves], [errors for _, _, errors in curves]])


def crf_opencv(bracket: Bracket, method: str = "debevec") -> np.ndarray:
    """What OpenCV recovers, in this course's form: (3, 256) float64, natural logarithms, crf[:, 128] = 0.

    bracket : Bracket; of 16-bit photographs the upper 8 bits speak
    method : "debevec" (CalibrateDebevec) or "robertson" (CalibrateRobertson), with OpenCV's defaults. Robertson's
        is NaN at values that no photograph holds, and gives white the mean exposure of all clipped pixels
    Raises ValueError for another method.

    >>> ramp = np.arange(1, 121, dtype=np.uint8).repeat(90).reshape(120, 30, 3)
    >>> crf_opencv(Bracket((ramp, 2 * ramp), [0.1, 0.2], ("a", "b")))[:, 128].tolist()
    [0.0, 0.0, 0.0]
    """
    methods = {"debevec": cv2.createCalibrateDebevec, "robertson": cv2.createCalibrateRobertson}
    if method not in methods:
        raise ValueError(f"method must be one of {', '.join(methods)}; got {method!r}.")
    # OpenCV wants float32 times: with float64 Robertson's answers another curve, and says nothing.
    images = [in_8_bits(image) for image in bracket.images]
    response = methods[method]().process(images, bracket.times.astype(np.float32))
    curves = np.log(np.maximum(response[:, 0].T.astype(np.float64), 1e-12))
    return curves - curves[:, MIDDLE : MIDDLE + 1]
