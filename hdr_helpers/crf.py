"""Stage 3: recover the camera response function.

After P. Debevec and J. Malik, Recovering High Dynamic Range Radiance Maps from Photographs, SIGGRAPH
1997. A pixel value Z of pixel i in photograph j obeys g(Z_ij) = ln E_i + ln dt_j (equation 2), where g is
the log inverse response. Section 2.1 finds g and all ln E_i by linear least squares, equation 3.

Each ln E_i stands only in the rows of its own pixel. For a given g its best value is therefore a
weighted mean, and putting that mean back leaves a problem in the 256 values of g alone: 256 equations
however many pixels there are. That is how gsolve works; the matrix of the paper's appendix is never built.
"""

import cv2
import numpy as np
import scipy.linalg

from hdr_helpers.load import Bracket, in_8_bits

LEVELS = 256
MIDDLE = 128  # g[MIDDLE] = 0 fixes the gauge: equation 3 leaves g free up to a constant
NOISE = 4  # up to here a pixel value is more noise and rounding than light, whatever the black level
RINGING = 20  # grey levels by which JPEG pulls a clipped pixel below white where white ends
CLIPPED = 250  # from here on a pixel value may be a clipped one, pulled down by noise or JPEG
CHUNK = 1 << 16  # pixels worked on at a time
FLOOR = 1e-4  # least weight of a smoothness row, so that values that no weight reaches stay defined


def hat_weights(black: int = 0, clipped: int = LEVELS) -> np.ndarray:
    """Weight of each pixel value, a hat that trusts the middle (equation 4).

    black : the camera's black level; values up to it get weight 0, and the hat rises from there
    clipped : values from here on get weight 0
    Returns (256,) float64. The defaults give the paper's hat: 0 at 0 and at 255, 127 in the middle.
    """
    z = np.arange(LEVELS)
    w = np.clip(np.minimum(z - black, LEVELS - 1 - z), 0, None).astype(np.float64)
    w[clipped:] = 0
    return w


def fitted_weights(images, valid=None) -> np.ndarray:
    """The hat over the pixel values that this camera can be trusted with: above black, below CLIPPED.

    images : P arrays (H, W, 3) uint8 or uint16, shortest exposure first
    valid : P arrays (H, W) bool, the pixels that count, or None for all
    """
    return hat_weights(max(black_level(images, valid), NOISE), CLIPPED)


def checked_weights(w) -> np.ndarray:
    """w as (256,) float64. Raises ValueError unless it holds 256 weights, none negative and not all 0."""
    w = np.asarray(w, dtype=np.float64)
    if w.shape != (LEVELS,) or w.min() < 0 or not w.max() > 0:
        raise ValueError(f"w must hold {LEVELS} weights, none negative and not all 0; got shape {w.shape}.")
    return w


def black_level(images, valid=None) -> int:
    """The pixel value that stands for no light: 0 in most files, about 17 in some scans.

    images : P arrays (H, W, 3) uint8 or uint16 (in 8 bits), aligned, shortest exposure first
    valid : P arrays (H, W) bool, the pixels that count, or None for all
    It is the largest dark value that the next longer exposure does not brighten. Up to there a pixel says
    nothing of the scene, yet each of the short exposures would say it with conviction.
    """
    if len(images) < 2:
        return 0
    shortest, longer = (in_8_bits(image[::2, ::2]) for image in images[:2])
    pairs = shortest.astype(np.intp) * LEVELS + longer
    if valid is not None:
        pairs = pairs[(valid[0] & valid[1])[::2, ::2]]
    joint = np.bincount(pairs.ravel(), minlength=LEVELS**2).reshape(LEVELS, LEVELS)
    count = joint.sum(axis=1)
    median = np.argmax(np.cumsum(joint, axis=1) >= count[:, None] / 2, axis=1)
    dark = np.arange(LEVELS) < LEVELS // 4
    still = dark & (count > 1e-3 * count.sum()) & (median <= np.arange(LEVELS))
    return int(np.flatnonzero(still).max(initial=0))


def whole_white(image, valid=None) -> np.ndarray:
    """A photograph, (H, W, 3) uint8 or uint16, in which what is almost white and touches white is white.

    A clipped area in a JPEG is not all 255: here and there it reads 245, which would pass for a measurement.
    In a long exposure such a pixel says of the sun that it is hundreds of times too dim: it must not vote.
    valid : (H, W) bool, the pixels that can be touched, or None for all
    """
    white = np.iinfo(image.dtype).max
    level = white // (LEVELS - 1)
    light = image if valid is None else image * valid[..., None]
    touches_white = cv2.dilate(light, np.ones((3, 3), np.uint8)) >= CLIPPED * level
    return np.where(touches_white & (image >= (CLIPPED - RINGING) * level), image.dtype.type(white), image)


def gsolve(Z, B, lam: float, w) -> tuple[np.ndarray, np.ndarray]:
    """Log inverse response of one channel by least squares (equation 3 with the weights of equation 4).

    Z : (N, P) integers 0..255, values of N pixels in P photographs
    B : (P,) float, log exposure times, ln seconds
    lam : smoothness, lambda in the paper; larger is smoother
    w : (256,) float, weight of each pixel value

    Returns g, (256,) float64 with g[128] = 0, the log exposure of each pixel value; and log_E, (N,)
    float64, the log irradiance of each pixel, NaN where all its values have weight 0.
    Raises ValueError where shapes or values don't fit.
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
    return _solve_reduced(Z, B, lam, w)


def _solve_reduced(Z, B, lam, w):
    """Normal equations of g after every log irradiance has been eliminated, and their solution."""
    edges, pull = _ties(Z, B, w**2)
    if not edges.any():
        raise ValueError(
            "No pixel has two different usable values, so nothing ties one pixel value to another; "
            "take photographs whose exposures overlap: one to three stops apart."
        )

    # Smoothness, equation 4: lam w(z) (g(z-1) - 2 g(z) + g(z+1)) for z = 1 .. 254, every one of them.
    smooth = lam * np.maximum(w, FLOOR * w.max())[1:-1, None] * np.diff(np.eye(LEVELS), n=2, axis=0)
    normal = np.diag(edges.sum(axis=1)) - edges + smooth.T @ smooth
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

    log_E = np.empty(len(Z))
    for few in _chunks(Z):
        weight = (w**2)[Z[few]]
        total = weight.sum(axis=1)
        said = (weight * (g[Z[few]] - B)).sum(axis=1)
        log_E[few] = np.divide(said, total, out=np.full_like(said, np.nan), where=total > 0)
    return g, log_E


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


def sample_pixels(images, n: int, seed: int = 0, valid=None) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of n pixels spread over the picture and over its brightness.

    images : P arrays (H, W, 3) uint8
    valid : (H, W) bool, the pixels that may be taken; None takes any
    Returns two (n,) integer arrays. Pixels are taken as points, never as averages: the response is not
    linear, so the mean of some values is not the value of their mean. They are drawn evenly from the
    pixels sorted by brightness, so that every pixel value is met; seeded, so that a run can be repeated.
    Raises ValueError where there are fewer than n pixels.
    """
    valid = np.ones(images[0].shape[:2], dtype=bool) if valid is None else valid
    count = np.count_nonzero(valid)
    if n > count:
        raise ValueError(f"{n} pixels were asked for; the photographs have {count}.")
    # A grid of some ten times as many pixels is choice enough, and large photographs stay quick to sort.
    stride = max(1, int(np.sqrt(count / (10 * n))))
    # No single photograph tells the brightnesses of a high-range scene apart: their sum does.
    brightness = np.sum([image[::stride, ::stride].sum(axis=2, dtype=np.int64) for image in images], axis=0)
    rng = np.random.default_rng(seed)
    order = np.lexsort((rng.random(brightness.size), brightness.ravel()))  # equal ones in random order
    order = order[valid[::stride, ::stride].ravel()[order]]
    bins = np.linspace(0, len(order), n + 1).astype(int)
    picked = order[rng.integers(bins[:-1], bins[1:])]
    rows, cols = np.unravel_index(picked, brightness.shape)
    return rows * stride, cols * stride


def recover_crf(bracket: Bracket, lam: float = 20.0, n: int = 20_000, seed: int = 0) -> np.ndarray:
    """The camera's log inverse response for red, green and blue.

    bracket : Bracket with P >= 2 photographs; of 16-bit ones the upper 8 bits speak, and only pixels that
        are valid in all of them
    lam : smoothness as for a sample of 100 pixels; it is scaled with the sample, so that more pixels give
        a surer curve and not a rougher one
    n : how many pixels speak, at most
    Returns crf, (3, 256) float64 with crf[:, 128] = 0; nowhere falling.
    """
    masks = bracket.valid or [None] * len(bracket)
    images = [whole_white(in_8_bits(image), mask) for image, mask in zip(bracket.images, masks, strict=True)]
    valid = np.ones(images[0].shape[:2], bool) if bracket.valid is None else np.logical_and.reduce(bracket.valid)
    rows, cols = sample_pixels(images, min(n, np.count_nonzero(valid)), seed, valid)
    Z = np.stack([image[rows, cols] for image in images], axis=1)  # (N, P, 3)
    w = fitted_weights(images, bracket.valid)
    curves = [gsolve(Z[..., c], bracket.log_times, lam * np.sqrt(len(Z) / 100), w)[0] for c in range(3)]
    # Noise can leave a dip where few pixels speak; a response never falls (section 2.1).
    curves = np.maximum.accumulate(curves, axis=1)
    return curves - curves[:, MIDDLE : MIDDLE + 1]


def crf_opencv(bracket: Bracket, method: str = "debevec") -> np.ndarray:
    """What OpenCV recovers, in this course's form: (3, 256) float64, natural logarithms, crf[:, 128] = 0.

    method : "debevec" (CalibrateDebevec) or "robertson" (CalibrateRobertson), with OpenCV's defaults
    """
    create = {"debevec": cv2.createCalibrateDebevec, "robertson": cv2.createCalibrateRobertson}[method]
    # OpenCV wants float32 times: with float64 Robertson's answers another curve, and says nothing.
    images = [in_8_bits(image) for image in bracket.images]
    response = create().process(images, bracket.times.astype(np.float32))
    curves = np.log(np.maximum(response[:, 0].T.astype(np.float64), 1e-12))
    return curves - curves[:, MIDDLE : MIDDLE + 1]
