"""A virtual camera: scene radiance in, a bracket of photographs out, with the truth kept.

Light passes a lens, a sensor and a response, as in Debevec and Malik 1997, figure 1. Random numbers are
tied to a seed and to the number of the frame, not to the order of calls, so a frame can be shot again.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from hdr_helpers.align import Motion, move_image
from hdr_helpers.crf import LEVELS, MIDDLE
from hdr_helpers.lab.exif import exif_block
from hdr_helpers.load import Bracket, Truth
from hdr_helpers.tonemap import luminance


@dataclass(frozen=True)
class Camera:
    """A digital camera with a known response.

    full_well : electrons that saturate a pixel
    read_noise : electrons, standard deviation
    non_uniformity : relative standard deviation of the pixels' sensitivities
    bits : of the converter behind the sensor
    jpeg_quality : 0..100, or None for photographs without compression
    response : for each channel (gamma, mu, mix) of a curve between a power and a logarithm
    seed : of the noise

    >>> wall = np.full((8, 12, 3), 0.5)
    >>> bracket = Camera(jpeg_quality=None).shoot(wall, times=[0.01, 0.02])
    >>> bracket.images[0].shape, bracket.truth.radiance.dtype.name
    ((8, 12, 3), 'float32')
    >>> bool(bracket.images[1].mean() > bracket.images[0].mean())  # twice the time
    True
    """

    full_well: float = 22_000.0
    read_noise: float = 3.5
    non_uniformity: float = 0.004
    bits: int = 12
    jpeg_quality: int | None = 95
    response: tuple = ((2.05, 55.0, 0.5), (2.25, 80.0, 0.5), (2.45, 115.0, 0.45))
    seed: int = 1997

    def respond(self, exposure, channel: int) -> np.ndarray:
        """Pixel value 0..1 for sensor exposure 0..1 (1 saturates): toe, power and logarithm, shoulder.

        exposure : float, any shape; channel : 0 red, 1 green, 2 blue. Returns float64 of the same shape.
        """
        gamma, mu, mix = self.response[channel]
        x = np.clip(exposure, 0, 1)
        toe = x / (x + 0.0012) * 1.0012
        y = toe * ((1 - mix) * x ** (1 / gamma) + mix * np.log1p(mu * x) / np.log1p(mu))
        return np.clip((1 - np.exp(-1.3 * y)) / (1 - np.exp(-1.3)), 0, 1)

    def crf(self) -> np.ndarray:
        """The true crf, (3, 256) float64: log exposure that gives exactly each pixel value, crf[:, 128] = 0.

        Value 0 stands for all exposures that round to it; a quarter of a level is taken for it.
        """
        x = np.concatenate([[0], np.geomspace(1e-9, 1, 400_001)])
        values = np.arange(LEVELS) / (LEVELS - 1)
        values[0] = 0.25 / (LEVELS - 1)
        g = np.log([np.interp(values, self.respond(x, c), x) for c in range(3)])
        # Rounded beyond what matters: processors differ in the last digits of a logarithm.
        return np.round(g - g[:, MIDDLE : MIDDLE + 1], 12) + 0.0

    def photograph(self, exposure, frame: int) -> np.ndarray:
        """One photograph, (H, W, 3) uint8 RGB.

        exposure : (H, W, 3) float, light on the sensor; 1 saturates
        frame : number of the frame; the same number gives the same noise
        """
        sensor = np.random.default_rng((self.seed, 0))
        uneven = 1 + self.non_uniformity * sensor.standard_normal(exposure.shape)
        rng = np.random.default_rng((self.seed, 1, frame))
        # Beyond some full wells every count clips: spare the generator huge rates.
        electrons = np.minimum(exposure, 8) * uneven * self.full_well
        electrons = rng.poisson(electrons) + self.read_noise * rng.standard_normal(exposure.shape)
        top = 2**self.bits - 1
        codes = np.rint(np.clip(electrons / self.full_well, 0, 1) * top).astype(np.intp)
        developed = [np.rint(self.respond(np.arange(top + 1) / top, c) * (LEVELS - 1)) for c in range(3)]
        image = np.stack([developed[c][codes[..., c]] for c in range(3)], axis=-1).astype(np.uint8)
        if self.jpeg_quality is None:
            return image
        return cv2.imdecode(encode_jpeg(image, self.jpeg_quality), cv2.IMREAD_COLOR)[..., ::-1].copy()

    def shoot(self, radiance, times, shifts=None, rotations=None, moment: int | None = None) -> Bracket:
        """A bracket of a scene, with its truth.

        radiance : (H, W, 3) float, what the lens gives: relative linear RGB; or P of them, one for each moment,
            of a scene in which something moves
        times : (P,) ascending, seconds
        shifts : (P, 2) pixels (dx, dy) by which the hand moved each frame's picture right and down, or None
        rotations : (P,) degrees by which it was turned counter-clockwise about its middle, before the shift, or None
        moment : index of the photograph in whose moment the truth is; None takes the middle one

        The border that moving would leave empty is cut from all frames and from the truth, which is not moved by the
        hand. Motions other than by whole pixels are interpolated, in the logarithm of the radiance.
        Returns a Bracket of uint8 with its Truth. Raises BracketError where the times are not ascending.
        """
        count = len(times)
        moments = [radiance] * count if np.ndim(radiance) == 3 else radiance
        shifts = np.zeros((count, 2), dtype=int) if shifts is None else np.asarray(shifts)
        turned = rotations is not None
        rotations = np.asarray(rotations, dtype=np.float64) if turned else np.zeros(count)
        reference = moments[count // 2 if moment is None else moment]
        margin = self.margin(reference.shape, shifts, rotations)
        inside = np.s_[margin : reference.shape[0] - margin, margin : reference.shape[1] - margin]
        gain = sensitivity(reference, times[0])
        images = [
            self.photograph(gain * t * _moved(moment, shift, degrees)[inside], frame)
            for frame, (moment, t, shift, degrees) in enumerate(zip(moments, times, shifts, rotations, strict=True))
        ]
        moved = None
        if len(set(map(id, moments))) > 1:
            moved = np.logical_or.reduce([_differs(moment, reference)[inside] for moment in moments])
        truth = Truth(
            radiance=np.asarray(reference[inside], dtype=np.float32),
            crf=self.crf(),
            shifts=shifts,
            rotations=rotations if turned else None,
            moved=moved,
        )
        names = tuple(f"frame_{frame:02d}" for frame in range(count))
        return Bracket(tuple(images), np.array(times), names, source="the virtual camera", truth=truth)

    @staticmethod
    def margin(shape, shifts, rotations) -> int:
        """Pixels that shoot cuts from every side of a scene of this shape; shifts, rotations : as for shoot."""
        reach = [np.abs(s).max() + Motion(degrees=d).reach(shape) for s, d in zip(shifts, rotations, strict=True)]
        return int(np.ceil(max(reach)))


@dataclass(frozen=True)
class StandardCamera(Camera):
    """A camera whose channels follow sRGB, Rec. 709 and a plain power of 1 / 1.8: linear or steep in the dark.

    >>> round(float(StandardCamera().respond(0.18, channel=0)), 2)  # a grey card in sRGB
    0.46
    """

    def respond(self, exposure, channel: int) -> np.ndarray:
        x = np.clip(exposure, 0, 1)
        if channel == 0:
            return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
        if channel == 1:
            return np.where(x <= 0.018, 4.5 * x, 1.099 * x**0.45 - 0.099)
        return x ** (1 / 1.8)


@dataclass(frozen=True)
class FilmCamera(Camera):
    """A camera with the S of film: powers of 1/2, 1/2.2 and 1/2.4, then half a smooth step; flat towards white.

    >>> round(float(FilmCamera().respond(0.25, channel=0)), 6)  # the root, 0.5, is where the S turns
    0.5
    """

    def respond(self, exposure, channel: int) -> np.ndarray:
        y = np.clip(exposure, 0, 1) ** (1 / (2.0, 2.2, 2.4)[channel])
        return (y + 3 * y**2 - 2 * y**3) / 2


FAMILIES = {"between a power and a logarithm": Camera, "video standards": StandardCamera, "film": FilmCamera}


def _differs(radiance, reference) -> np.ndarray:
    """(H, W) bool: where two moments of a scene differ by more than 1% in a channel."""
    return np.any(np.abs(radiance - reference) > 0.01 * reference, axis=2)


def _moved(radiance, shift, degrees) -> np.ndarray:
    if not degrees and np.all(np.equal(np.mod(shift, 1), 0)):
        return move_image(radiance, shift)
    return np.exp(move_image(np.log(radiance), shift, degrees))


def sensitivity(radiance, shortest: float) -> float:
    """Exposure per radiance and second at which the shortest photograph just holds the lights.

    The 99.9th percentile of luminance reaches 0.9 of saturation there.

    radiance : (H, W, 3) float, RGB; shortest : exposure time in seconds

    >>> round(sensitivity(np.full((4, 4, 3), 0.5), shortest=0.01) * 0.5 * 0.01, 3)
    0.9
    """
    return 0.9 / (float(np.percentile(luminance(radiance), 99.9)) * shortest)


def encode_jpeg(image, quality: int, seconds: tuple[int, int] | None = None) -> np.ndarray:
    """JPEG bytes, (n,) uint8, of an RGB picture, colour at full resolution (4:4:4).

    image : (H, W, 3) uint8; quality : 0..100
    seconds : exposure time as numerator and denominator, written as EXIF; None writes no EXIF

    >>> wall = np.full((8, 16, 3), 120, np.uint8)
    >>> bool(np.all(cv2.imdecode(encode_jpeg(wall, 95), cv2.IMREAD_COLOR) == wall))  # a plain colour is not harmed
    True
    """
    bgr = np.ascontiguousarray(image[..., ::-1])
    options = (cv2.IMWRITE_JPEG_QUALITY, quality,
               cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)  # fmt: skip
    if seconds is None:
        return cv2.imencode(".jpg", bgr, options)[1]
    exif = np.frombuffer(exif_block(seconds=seconds), np.uint8)
    return cv2.imencodeWithMetadata(".jpg", bgr, [cv2.IMAGE_METADATA_EXIF], [exif], options)[1]
