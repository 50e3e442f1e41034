"""The course's own brackets, shot by the virtual camera.

    python -m hdr_helpers.lab.brackets [FOLDER]

makes data/chapel and data/handheld from data/scenes; the same bytes every time on one kind of processor.
"""

import argparse
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np

from hdr_helpers.lab.camera import Camera, encode_jpeg
from hdr_helpers.lab.data import DATA, save_truth
from hdr_helpers.lab.scenes import MARGIN, STORED_SCALE, chapel_scene, cloister_scene
from hdr_helpers.load import Bracket
from hdr_helpers.merge import write_whole

CHAPEL_TIMES = (1 / 400, 1 / 160, 1 / 60, 1 / 25, 1 / 10, 1 / 4, 0.6, 1.6, 4.0)  # seconds
CHAPEL_NAMES = ("1/400", "1/160", "1/60", "1/25", "1/10", "1/4", "0.6", "1.6", "4")

HANDHELD_TIMES = tuple(Fraction(1, n) for n in (3200, 1000, 320, 100, 30))  # seconds
HANDHELD_SHIFTS = ((-8.2, -3.1), (4.4, 5.9), (0.0, 0.0), (-5.6, 2.4), (7.3, -4.2))  # pixels
HANDHELD_ROTATIONS = (-0.22, 0.12, 0.0, -0.10, 0.18)  # degrees
HANDHELD_NAMES = tuple(f"IMG_04{n}.jpg" for n in range(12, 17))


def make_chapel(folder) -> None:
    """Shoot the chapel from a tripod and write photographs, shutter.txt and truth.npz into a folder.

    folder : where to; made if it is not there. Nine JPEG files of (512, 768, 3), times as in CHAPEL_TIMES.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    camera = Camera(jpeg_quality=None)  # compressed once, when it is written
    radiance = chapel_scene()[MARGIN:-MARGIN, MARGIN:-MARGIN]
    bracket = camera.shoot(radiance, CHAPEL_TIMES)
    listed = ["# photograph  exposure time in seconds"]
    for i, (image, spelled) in enumerate(zip(bracket.images, CHAPEL_NAMES, strict=True)):
        name = f"chapel_{i + 1}.jpg"
        write_whole(folder / name, encode_jpeg(image, Camera.jpeg_quality).tobytes())
        listed.append(f"{name} {spelled}")
    write_whole(folder / "shutter.txt", ("\n".join(listed) + "\n").encode())
    save_truth(folder, bracket.truth, STORED_SCALE)


def make_handheld(folder) -> None:
    """Shoot the cloister from the hand while the monks walk; photographs with EXIF and truth.npz into a folder.

    folder : where to; made if it is not there. Five JPEG files of (512, 768, 3), times as in HANDHELD_TIMES.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    bracket = shoot_handheld(Camera(jpeg_quality=None))
    for name, image, seconds in zip(HANDHELD_NAMES, bracket.images, HANDHELD_TIMES, strict=True):
        data = encode_jpeg(image, Camera.jpeg_quality, seconds.as_integer_ratio())
        write_whole(folder / name, data.tobytes())
    save_truth(folder, bracket.truth, STORED_SCALE)


def shoot_handheld(camera: Camera) -> Bracket:
    """The bracket of data/handheld, by any camera: (512, 768, 3) each.

    camera : Camera
    Its truth is the moment of the shortest exposure, the only one in which the sunlit floor is not white.
    """
    moments, times = cloister_scene(), [float(t) for t in HANDHELD_TIMES]
    margin = MARGIN - camera.margin(moments[0].shape, HANDHELD_SHIFTS, HANDHELD_ROTATIONS)
    inside = np.s_[margin:-margin, margin:-margin]
    return camera.shoot([m[inside] for m in moments], times, HANDHELD_SHIFTS, HANDHELD_ROTATIONS, moment=0)


@cache
def handheld_chapel() -> Bracket:
    """The chapel shot from the hand: each frame has moved by up to 20 pixels; with the truth."""
    shifts = np.random.default_rng(4).integers(-20, 21, (len(CHAPEL_TIMES), 2))
    return Camera().shoot(chapel_scene(), CHAPEL_TIMES, shifts)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Make the course's own brackets with the virtual camera.")
    parser.add_argument("folder", nargs="?", default=DATA, type=Path, help="where to (default: data)")
    place = parser.parse_args().folder
    make_chapel(place / "chapel")
    make_handheld(place / "handheld")
