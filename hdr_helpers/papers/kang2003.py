"""Local registration: a thing that moves while a bracket is shot is in the merge only once.

S. B. Kang, M. Uyttendaele, S. Winder and R. Szeliski, High Dynamic Range Video, ACM Transactions on Graphics 22(3)
(SIGGRAPH 2003). After the photographs lie on each other as a whole, dense optical flow brings what still differs to
where one of them, the reference, has it; only where a photograph then agrees with the reference does it have a say.

Do two photographs agree? Which values of the one go with a value of the other is read from the pixels of both, so
neither times nor a response are needed. It is a range: what is white in the one may be anything bright in a shorter
exposure. A pixel outside its range has moved.
"""

import cv2
import numpy as np
from scipy.optimize import isotonic_regression

from hdr_helpers.papers.grossberg_nayar2003 import intensity_mapping

WORK = 7.5e5  # pixels, about, of the small copies that are compared: a photograph's finest detail is noise
TOLERANCE = 3  # grey levels by which noise, JPEG and rounding move a pixel value
SCATTER = 2  # times the median relative deviation from the curve: a phone that lights up places by choice has more
MOST_SCATTER = 0.4  # more is no scatter: the photographs show different things
COLOUR = 1 / 8  # of the distance between channels: cameras mix them, so that only grey keeps to one curve a channel
MARGIN = 1 / 250  # of the picture's shorter side: the soft contour of what moved belongs to it
WIDE = 24  # grey levels; a reference that leaves so much open needs flow to know more
RETURN = 4.0  # pixels of the small copy: flow forth and back has to end nearer than this to where it began
MOST = 0.6  # of a photograph: where more has moved there is nothing to hold on to, and it has no say at all
UNRELATED = 20  # grey levels between what pixels say and what their order says: nothing is in its place


def register_locally(images, reference: int, valid=None) -> tuple[tuple, tuple]:
    """Photographs in which everything is where the reference has it, and where each of them may speak.

    images : P arrays (H, W, 3) uint8 or uint16, RGB, shortest exposure first, aligned as a whole
    reference : index of the photograph that says where things are
    valid : P arrays (H, W) bool, the pixels that count, or None for all

    Returns P images and P masks (H, W) bool, False where a photograph has no say. Where a photograph agrees with the
    reference it stays as it is, to the last bit; where flow is confirmed it is warped; elsewhere it is masked. The
    reference is neither changed nor masked.
    Raises ValueError where shapes or the reference don't fit.

    >>> short = np.arange(20, 110, dtype=np.uint8).repeat(3).reshape(1, 90, 3).repeat(60, axis=0)
    >>> long = 2 * short
    >>> short[20:40, 20:40] = 100  # a ball flies by, and the reference does not know it
    >>> images, masks = register_locally([short, long], reference=1)
    >>> bool(masks[0][30, 30]), bool(masks[0][10, 70]), bool(masks[1].all())
    (False, True, True)
    """
    images = list(images)
    forms = {(image.shape, image.dtype) for image in images}
    if len(forms) != 1 or images[0].shape[2:] != (3,) or images[0].dtype not in (np.uint8, np.uint16):
        raise ValueError("Photographs must be (H, W, 3) uint8 or uint16, of one size and one type.")
    if not 0 <= reference < len(images):
        raise ValueError(f"reference must be 0 to {len(images) - 1}; got {reference}.")
    valid = [np.ones(images[0].shape[:2], dtype=bool)] * len(images) if valid is None else list(valid)
    if [np.shape(mask) for mask in valid] != [image.shape[:2] for image in images]:
        raise ValueError(f"valid must hold one mask of {images[0].shape[:2]} for each photograph.")

    shrink = max(1, int(np.sqrt(valid[0].size / WORK)))
    small, whole = [_small(image, shrink) for image in images], [_small(mask, shrink) for mask in valid]
    masks = list(valid)
    for side in (range(reference - 1, -1, -1), range(reference + 1, len(images))):
        # What the nearest photograph that agrees says of each pixel, as a range of values of the present one.
        low, high, told, near = small[reference], small[reference], whole[reference], reference
        for k in side:
            lowest, highest, curves, scatter = _expected(small[near], small[k], whole[near] & whole[k])
            low, high = (cv2.LUT(bound, table) for bound, table in ((low, lowest), (high, highest)))
            low[~told], high[~told] = 0, 255
            agrees, flow, follows = _compare(small[k], whole[k], low, high, curves, scatter)
            values = small[k]
            if follows.any():
                values = np.where(follows[..., None], _warp(values, flow), values)
                images[k] = _warped(images[k], flow, follows, shrink)
            low, high = (np.where(agrees[..., None], values, bound) for bound in (low, high))
            told, near = told | agrees, k
            masks[k] = _enlarged(agrees, masks[k].shape) & masks[k]
    return tuple(images), tuple(masks)


def _compare(values, valid, low, high, curves, scatter) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
    """Where a photograph agrees with what is known, as it is or warped; the flow that warps it; and where that does.

    values : (H, W, 3) uint8; valid : (H, W) bool; low, high : (H, W, 3) uint8, the range it has to keep to
    curves, scatter : as _expected gives them
    """
    kernel = np.ones((3, 3), np.uint8)  # a pixel beside its place has not moved
    lowest, highest = cv2.erode(low, kernel), cv2.dilate(high, kernel)
    moved = _whole_things(_outside(values, lowest, highest, scatter) & valid)
    nowhere = np.zeros_like(valid)
    if np.count_nonzero(moved & valid) > MOST * np.count_nonzero(valid):
        return nowhere, None, nowhere
    # Where the reference tells enough it is better alone than with what was warped, however well.
    open_ = moved & (_largest(cv2.subtract(high, low)) > WIDE)
    if not cv2.erode(open_.view(np.uint8), np.ones((9, 9), np.uint8)).any() or min(valid.shape) < 16:
        return valid & ~moved, None, nowhere
    flow, returned = _flow(low, high, values, curves)
    warped = _warp(values, flow)
    follows = open_ & returned & ~_outside(warped, lowest, highest, 0) & (_warp(np.float32(valid), flow) > 0.99)
    follows = cv2.morphologyEx(follows.view(np.uint8), cv2.MORPH_OPEN, np.ones((5, 5), np.uint8)).view(bool)
    return (valid & ~moved) | follows, flow, follows


def _expected(near, far, both) -> tuple[np.ndarray, np.ndarray, tuple, float]:
    """The lowest and the highest value that each value of near may have in far: tables (1, 256, 3) uint8.

    near, far : (H, W, 3) uint8; both : (H, W) bool, the pixels that count
    And for each channel the values of far at which near is black and white; and the share of its value by which a
    pixel may miss its range.
    """
    low, high, z = np.zeros((1, 256, 3), np.uint8), np.full((1, 256, 3), 255, np.uint8), np.arange(256)
    scatter = 0.0
    for c in range(3 if both.any() else 0):
        joint = np.bincount(near[..., c][both].astype(np.intp) * 256 + far[..., c][both], minlength=65536)
        joint = joint.reshape(256, 256)
        there, back = _median_curve(joint), _median_curve(joint.T)
        # Expected is what near leads to, and whatever leads to near: where near is white, all that is bright.
        low[0, :, c] = np.minimum(there, np.searchsorted(back, z - TOLERANCE))
        high[0, :, c] = np.ceil(np.maximum(there, np.searchsorted(back, z + TOLERANCE, "right") - 1))
        scatter = max(scatter, min(SCATTER * _deviation(joint, there), MOST_SCATTER))
    low, high = np.maximum.accumulate(low, axis=1), np.maximum.accumulate(high, axis=1)
    return low, high, (high[0, 0], low[0, 255]), scatter


def _deviation(joint, curve) -> float:
    """Median relative distance of a joint histogram's pixels from a curve, where neither is black or white."""
    inner, there = np.s_[16:240], curve[16:240, None]
    distance = np.abs(np.arange(16, 240) - there) / np.maximum(there, 16)
    counts, order = joint[inner, inner].ravel(), np.argsort(distance, axis=None)
    below = np.cumsum(counts[order])
    return float(distance.ravel()[order][np.searchsorted(below, below[-1] / 2)]) if below[-1] else 0.0


def _median_curve(joint) -> np.ndarray:
    """Median column of each row of a joint histogram, never falling: (256,) float. What moves does not bend it.

    Where hardly anything is in its place pixels don't correspond, and their order alone has to do.
    """
    count = joint.sum(axis=1)
    met = np.flatnonzero(count)
    median = np.argmax(joint.cumsum(axis=1) >= count[:, None] / 2, axis=1)
    curve = np.interp(np.arange(256), met, isotonic_regression(median[met], weights=count[met]).x)
    by_order = intensity_mapping(count, joint.sum(axis=0))
    inner = np.where((curve > 4) & (curve < 250), count, 0)[5:250]  # black and white go with much
    apart = np.average(np.abs(curve - by_order)[5:250], weights=inner) if inner.any() else 0
    return by_order if apart > UNRELATED else curve


def _outside(values, lowest, highest, scatter) -> np.ndarray:
    """(H, W) bool: a channel is farther outside its range than noise, scatter and mixed colours explain."""
    beyond = _largest(cv2.max(cv2.subtract(lowest, values), cv2.subtract(values, highest)))
    brightest = _largest(values)
    colour = cv2.subtract(brightest, cv2.bitwise_not(_largest(cv2.bitwise_not(values))))
    return beyond > np.maximum(TOLERANCE + COLOUR * colour, scatter * brightest)


def _largest(values) -> np.ndarray:
    """The largest of three channels, (H, W); many times faster than numpy's along a short last axis."""
    r, g, b = cv2.split(values)
    return cv2.max(cv2.max(r, g), b)


def _whole_things(mask) -> np.ndarray:
    """A mask (H, W) bool without specks, its gaps closed, and with the contours of what it shows."""
    mask = mask.view(np.uint8)
    solid, thin = (cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((n, n), np.uint8)) for n in (3, 2))
    radius = max(2, round(MARGIN * min(mask.shape)))
    disc, wide = (cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * n + 1, 2 * n + 1)) for n in (radius, 3 * radius))
    # What is too thin to count by itself counts beside what is not.
    mask = cv2.bitwise_or(solid, cv2.bitwise_and(thin, cv2.dilate(solid, wide)))
    return cv2.erode(cv2.dilate(mask, disc, iterations=2), disc).view(bool)


def _flow(low, high, values, curves) -> tuple[np.ndarray, np.ndarray]:
    """Optical flow (H, W, 2) float32 from what is known to a photograph, and where it finds its way back."""
    # What one of the two can't show the other must not show either, or flow would follow the difference.
    pair = [np.clip(p, *curves) for p in (cv2.addWeighted(low, 0.5, high, 0.5, 0), values)]
    pair = [cv2.cvtColor(p, cv2.COLOR_RGB2GRAY) for p in pair]
    dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    there, back = dis.calc(*pair, None), dis.calc(*pair[::-1], None)
    return there, np.linalg.norm(there + _warp(back, there), axis=2) < RETURN


def _warp(image, flow) -> np.ndarray:
    """An image (H, W) or (H, W, C) looked up where flow (H, W, 2) points from each pixel."""
    x, y = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in flow.shape[1::-1]))
    return cv2.remap(image, x + flow[..., 0], y + flow[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def _warped(image, flow, follows, shrink) -> np.ndarray:
    """A photograph with what follows the flow of its small copy warped, all else as it was."""
    if shrink > 1:
        flow = cv2.resize(flow, image.shape[1::-1], interpolation=cv2.INTER_LINEAR) * shrink
    return np.where(_enlarged(follows, image.shape[:2])[..., None], _warp(image, flow), image)


def _small(pixels, shrink) -> np.ndarray:
    """A photograph in 8 bits, or a mask, shrink times smaller; of a mask what is True throughout."""
    if pixels.dtype == bool:
        return _small(pixels.view(np.uint8) * np.uint8(255), shrink) == 255
    if shrink > 1:
        size = [-(-n // shrink) for n in pixels.shape[1::-1]]
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    return pixels if pixels.dtype == np.uint8 else (pixels >> 8).astype(np.uint8)


def _enlarged(mask, shape) -> np.ndarray:
    if mask.shape == shape:
        return mask
    return cv2.resize(mask.view(np.uint8), shape[::-1], interpolation=cv2.INTER_NEAREST).view(bool)
