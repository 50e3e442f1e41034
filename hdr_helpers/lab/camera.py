"""A virtual camera: scene radiance in, a bracket of photographs out, with the truth kept.

Light passes a lens, a sensor and a response, as in Debevec and Malik 1997, figure 1. Random numbers are
tied to a seed and to the number of the frame, not to the order of calls, so a frame can be shot again.

    python -m hdr_helpers.lab.camera [FOLDER]

makes the course's own bracket, data/chapel, from data/scenes/chapel.npz; the same bytes every time.
"""

import argparse
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from hdr_helpers.align import shift_image
from hdr_helpers.crf import LEVELS, MIDDLE
from hdr_helpers.lab.data import DATA, save_truth
from hdr_helpers.load import Bracket, Truth
from hdr_helpers.merge import write_whole
from hdr_helpers.tonemap import luminance

CHAPEL_TIMES = (1 / 400, 1 / 160, 1 / 60, 1 / 25, 1 / 10, 1 / 4, 0.6, 1.6, 4.0)  # seconds
CHAPEL_NAMES = ("1/400", "1/160", "1/60", "1/25", "1/10", "1/4", "0.6", "1.6", "4")
STORED_SCALE = 4  # float16 ends at 65504; the scene does not


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
    """

    full_well: float = 22_000.0
    read_noise: float = 3.5
    non_uniformity: float = 0.004
    bits: int = 12
    jpeg_quality: int | None = 95
    response: tuple = ((2.05, 55.0, 0.5), (2.25, 80.0, 0.5), (2.45, 115.0, 0.45))
    seed: int = 1997

    def respond(self, exposure, channel: int) -> np.ndarray:
        """Pixel value 0..1 for sensor exposure 0..1 (1 saturates): toe, power and logarithm, shoulder."""
        gamma, mu, mix = self.response[channel]
        x = np.clip(exposure, 0, 1)
        toe = x / (x + 0.0012) * 1.0012
        y = toe * ((1 - mix) * x ** (1 / gamma) + mix * np.log1p(mu * x) / np.log1p(mu))
        return np.clip((1 - np.exp(-1.3 * y)) / (1 - np.exp(-1.3)), 0, 1)

    def crf(self) -> np.ndarray:
        """The true crf, (3, 256): log exposure that gives exactly each pixel value, crf[:, 128] = 0.

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

    def shoot(self, radiance, times, shifts=None) -> Bracket:
        """A bracket of a scene, with its truth.

        radiance : (H, W, 3) float, what the lens gives: relative linear RGB
        times : (P,) ascending, seconds
        shifts : (P, 2) whole pixels (dx, dy) by which the hand moved each frame's picture right and down,
            or None. The border that a shift would leave empty is cut from all frames and from the truth.
        """
        moves = np.zeros((len(times), 2), dtype=int) if shifts is None else np.asarray(shifts)
        margin = int(np.abs(moves).max())
        inside = np.s_[margin : radiance.shape[0] - margin, margin : radiance.shape[1] - margin]
        gain = sensitivity(radiance, times[0])
        images = [
            self.photograph(gain * t * shift_image(radiance, move)[inside], frame)
            for frame, (t, move) in enumerate(zip(times, moves, strict=True))
        ]
        truth = Truth(np.asarray(radiance[inside], dtype=np.float32), self.crf(), moves)
        names = tuple(f"frame_{frame:02d}" for frame in range(len(times)))
        return Bracket(tuple(images), np.array(times), names, source="the virtual camera", truth=truth)


def sensitivity(radiance, shortest: float) -> float:
    """Exposure per radiance and second at which the shortest photograph just holds the lights.

    The 99.9th percentile of luminance reaches 0.9 of saturation there.
    """
    return 0.9 / (float(np.percentile(luminance(radiance), 99.9)) * shortest)


def lens(radiance, sigma: float = 0.6) -> np.ndarray:
    """What a lens makes of scene radiance (H, W, 3): a little blur (sigma in pixels). Float64."""
    return gaussian_filter(np.asarray(radiance, dtype=np.float64), (sigma, sigma, 0), mode="nearest")


def encode_jpeg(image, quality: int) -> np.ndarray:
    """JPEG bytes, (n,) uint8, of an RGB picture, colour at full resolution (4:4:4)."""
    options = (cv2.IMWRITE_JPEG_QUALITY, quality,
               cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)  # fmt: skip
    return cv2.imencode(".jpg", np.ascontiguousarray(image[..., ::-1]), options)[1]


def scene(name: str) -> np.ndarray:
    """A path-traced scene of data/scenes behind the lens, (H, W, 3) float32, relative radiance, RGB.

    Rounded to what a truth file holds, so that the stored truth is exactly what the sensor saw.
    """
    with np.load(DATA / "scenes" / f"{name}.npz") as stored:
        behind_lens = lens(stored["radiance"].astype(np.float64) * 8)
    return (behind_lens / STORED_SCALE).astype(np.float16).astype(np.float32) * STORED_SCALE


def make_chapel(folder) -> None:
    """Shoot the chapel from a tripod and write photographs, shutter.txt and truth.npz into a folder."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    camera = Camera(jpeg_quality=None)  # compressed once, when it is written
    radiance = scene("chapel")[24:-24, 24:-24]  # the scene has a margin for hand-held brackets
    bracket = camera.shoot(radiance, CHAPEL_TIMES)
    listed = ["# photograph  exposure time in seconds"]
    for i, (image, spelled) in enumerate(zip(bracket.images, CHAPEL_NAMES, strict=True)):
        name = f"chapel_{i + 1}.jpg"
        write_whole(folder / name, encode_jpeg(image, Camera.jpeg_quality).tobytes())
        listed.append(f"{name} {spelled}")
    write_whole(folder / "shutter.txt", ("\n".join(listed) + "\n").encode())
    save_truth(folder, bracket.truth, STORED_SCALE)


@cache
def handheld_chapel() -> Bracket:
    """The chapel shot from the hand: each frame has moved by up to 20 pixels; with the truth."""
    shifts = np.random.default_rng(4).integers(-20, 21, (len(CHAPEL_TIMES), 2))
    return Camera().shoot(scene("chapel"), CHAPEL_TIMES, shifts)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Make the course's chapel bracket with the virtual camera.")
    parser.add_argument("folder", nargs="?", default=DATA / "chapel", help="where to (default: data/chapel)")
    make_chapel(parser.parse_args().folder)
