"""What a merge costs and how far it is from the truth and from the best possible, beside OpenCV, in the same run.

python tests/benchmarks/merge.py [speed | truth]
"""

import subprocess
import sys

import cv2
import numpy as np
from measure import enlarged, in_turns, needed

from hdr_helpers import fitted_weights, hat_weights, merge_debevec, recover_crf
from hdr_helpers.crf import crf_opencv
from hdr_helpers.lab.bound import best_possible
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.metrics import psnr_l, psnr_mu
from hdr_helpers.lab.scenes import chapel_scene, random_scene
from hdr_helpers.merge import merge_opencv

TIMES = {16: 2.0 ** np.arange(-10, 6), 4: np.array([1 / 30, 1 / 4, 2.5, 15])}
SHAPE = (2832, 4256)
NOISE = {"noise": {"jpeg_quality": None},
         "low light": {"jpeg_quality": None, "full_well": 2000.0, "read_noise": 10.0},
         "JPEG 95": {"jpeg_quality": 95}, "JPEG 85": {"jpeg_quality": 85}}  # fmt: skip


def large(jpeg):
    """A bracket of 12 megapixels x 16, its curve, OpenCV's form of both."""
    camera = Camera(jpeg_quality=jpeg)
    bracket = enlarged(camera.shoot(random_scene(1), TIMES[16]), SHAPE)
    crf = camera.crf()
    return bracket, crf, np.exp(crf).T[:, None].astype(np.float32).copy()


def works(jpeg):
    bracket, crf, response = large(jpeg)
    images, times, seconds = bracket.images, bracket.times.astype(np.float32), bracket.times
    edges = np.arange(SHAPE[1])[None] > 3 * np.arange(len(images))[:, None]
    valid = [np.ascontiguousarray(np.broadcast_to(edge, SHAPE)) for edge in edges]
    hat = fitted_weights(images)
    return {
        "opencv": lambda: cv2.createMergeDebevec().process(list(images), times, response),
        "by noise": lambda: merge_debevec(images, seconds, crf),
        "given weights": lambda: merge_debevec(images, seconds, crf, hat),
        "by noise, with masks": lambda: merge_debevec(images, seconds, crf, valid=valid),
    }


def speed() -> None:
    print("12 MP x 16; least seconds of 3; memory beyond the photographs, each in a process of its own.")
    for jpeg in (None, 95):
        seconds = in_turns(3, **works(jpeg))
        for name, taken in seconds.items():
            command = [sys.executable, __file__, "memory", str(jpeg), name]
            memory = int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
            ratio = "" if name == "opencv" else f", 1/{seconds['opencv'] / taken:.1f} of OpenCV's"
            print(
                f"{'JPEG 95' if jpeg else 'no JPEG':8} {name:20} {taken:6.2f} s, {memory / 1e6:4.0f} MB{ratio}",
                flush=True,
            )


def truth() -> None:
    print(
        "PSNR-mu (PSNR-L) in dB, mean of three scenes; our own curve, OpenCV with its own; the bound knows the noise."
    )
    print(f"{'':10} {'':3} {'OpenCV':>15} {'the hat':>15} {'hat cut at 250':>15} {'by noise':>15} {'bound':>15}")
    for condition, options in NOISE.items():
        for count, times in TIMES.items():
            rows = []
            for seed, scene in ((1, random_scene(1)), (2, random_scene(2)), (3, chapel_scene())):
                camera = Camera(non_uniformity=0, seed=seed, **options)
                bracket = camera.shoot(scene, times)
                images, radiance, crf = bracket.images, bracket.truth.radiance, recover_crf(bracket).crf
                maps = [
                    merge_opencv(images, times, crf_opencv(bracket)),
                    merge_debevec(images, times, crf, hat_weights()).radiance,
                    merge_debevec(images, times, crf, fitted_weights(images)).radiance,
                    merge_debevec(images, times, crf).radiance,
                ]
                if camera.jpeg_quality is None:
                    maps.append(best_possible(camera, radiance, times))
                rows.append([(psnr_mu(m, radiance), psnr_l(m, radiance)) for m in maps])
            mean = np.mean(rows, axis=0)
            print(
                f"{condition:10} {count:3} " + " ".join(f"{mu:8.1f} ({linear:4.1f})" for mu, linear in mean), flush=True
            )


if __name__ == "__main__":
    if sys.argv[1:2] == ["memory"]:
        jpeg, name = sys.argv[2:]
        print(needed(works(None if jpeg == "None" else int(jpeg))[name]))
    else:
        for name in sys.argv[1:] or ("speed", "truth"):
            {"speed": speed, "truth": truth}[name]()
