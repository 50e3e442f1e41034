"""How a hand moves a picture: a shift and a small turn about the middle."""

from dataclasses import dataclass

import cv2
import numpy as np

from hdr_helpers.papers.ward2003 import overlap


@dataclass(frozen=True)
class Motion:
    """A rigid motion of the picture plane: first turned about the middle of the picture, then shifted.

    dx, dy : pixels to the right and down
    degrees : counter-clockwise, as one looks at the picture

    Points are (N, 2) float64, (x, y) in pixels from the middle of the picture.
    """

    dx: float = 0.0
    dy: float = 0.0
    degrees: float = 0.0

    @property
    def turn(self) -> np.ndarray:
        """(2, 2), what the turn does to a column (x, y); y points down."""
        c, s = np.cos(np.radians(self.degrees)), np.sin(np.radians(self.degrees))
        return np.array([[c, s], [-s, c]])

    def __call__(self, points) -> np.ndarray:
        return points @ self.turn.T + (self.dx, self.dy)

    def inverse(self) -> "Motion":
        return Motion(*-(self.turn.T @ (self.dx, self.dy)), -self.degrees)

    def after(self, first: "Motion") -> "Motion":
        """first, then this."""
        return Motion(*self(np.array([first.dx, first.dy])), self.degrees + first.degrees)

    def reach(self, shape) -> float:
        """How far the turn alone moves the corners of a picture of this shape, in pixels."""
        return float(abs(np.radians(self.degrees)) * np.hypot(*shape[:2]) / 2)


def fit_motion(points, targets, bias: float = 0.0) -> tuple[Motion, float]:
    """The motion that brings points nearest to targets in the least squares sense, and how sure its turn is.

    points, targets : (N, 2), from the middle of the picture; bias : pixels by which all may be wrong together
    Returns the Motion and the standard error of its degrees (infinite where nothing tells).
    """
    middle, target = points.mean(axis=0), targets.mean(axis=0)
    a, b = points - middle, targets - target
    motion = Motion(degrees=np.degrees(np.arctan2(np.sum(a[:, 1] * b[:, 0] - a[:, 0] * b[:, 1]), np.sum(a * b))))
    spread = np.sum(a**2)
    noise = np.sum((b - motion(a)) ** 2) / max(2 * len(a) - 3, 1) + bias**2 * len(a)
    error = np.degrees(np.sqrt(noise / spread)) if spread > 0 and len(a) > 2 else np.inf
    return Motion(*(target - motion(middle)), motion.degrees), error


def move_image(image, shift, degrees: float = 0.0) -> np.ndarray:
    """Move an image (H, W) or (H, W, C) by shift = (dx, dy) pixels right and down; what moves in is 0.

    degrees : counter-clockwise turn about the middle of the image, before the shift

    Whole pixels without a turn are moved as they are, everything else is interpolated, bicubic; a mask of bool comes
    out True only where nothing but True has a part.
    The empty border holds no measurement: 0 has no weight in the merge, and crop_common cuts it off.
    (np.roll would bring in the opposite edge instead.)
    """
    height, width = image.shape[:2]
    if not degrees and all(float(s).is_integer() for s in shift):
        dx, dy = (int(s) for s in shift)
        moved = np.zeros_like(image)
        if abs(dx) < width and abs(dy) < height:
            here, there = overlap((height, width), (dx, dy))
            moved[here] = image[there]
        return moved
    motion = Motion(*shift, degrees)
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    matrix = np.column_stack([motion.turn, motion(-middle) + middle])
    inside = cv2.warpAffine(
        np.full((height, width), 255, np.uint8), matrix, (width, height), flags=cv2.INTER_LINEAR, borderValue=0
    )
    if image.dtype == bool:
        holes = cv2.warpAffine((~image).view(np.uint8) * 255, matrix, (width, height), flags=cv2.INTER_LINEAR)
        return (inside == 255) & (holes == 0)
    moved = cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    moved[inside < 255] = 0
    return moved


def common_part(shape, shifts, rotations) -> tuple[slice, slice]:
    """The largest upright rectangle within the corners of all moved pictures: its rows and columns.

    shifts : (P, 2) pixels; rotations : (P,) degrees, small
    Raises ValueError where there is none.
    """
    height, width = shape[:2]
    half = np.array([width, height]) / 2
    corners = half * [(-1, -1), (1, -1), (-1, 1), (1, 1)]
    low, high = np.array([0.0, 0.0]), np.array([width, height], dtype=float)
    for shift, degrees in zip(shifts, rotations, strict=True):
        (x0, y0), (x1, y1), (x2, y2), (x3, y3) = Motion(*shift, degrees)(corners) + half
        low = np.maximum(low, [max(x0, x2), max(y0, y1)])
        high = np.minimum(high, [min(x1, x3), min(y2, y3)])
    (left, top), (right, bottom) = np.ceil(low - 1e-9).astype(int), np.floor(high + 1e-9).astype(int)
    if left >= right or top >= bottom:
        raise ValueError("The aligned photographs have no part in common; check that they show one scene.")
    return np.s_[top:bottom, left:right]
