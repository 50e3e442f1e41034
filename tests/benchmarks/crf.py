"""What gsolve costs against the number of pixels, beside the dense way of the paper and OpenCV, in the same run.

python tests/benchmarks/crf.py
"""

import sys
from functools import partial
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from measure import best_of
from test_crf import paper_solution

from hdr_helpers import gsolve, hat_weights

TIMES = 2.0 ** np.arange(16)
DENSE, OPENCV = 1000, 1000  # pixels up to which the others are tried: both grow with their square or faster


def samples(count: int, photographs: int):
    """Z of a camera with a gamma of 2.2, and its log times."""
    log_times = np.log(TIMES[:photographs])
    log_E = np.random.default_rng(0).uniform(-log_times[-1] - 2, -0.5, (count, 1))
    return np.clip(np.rint(255 * np.exp((log_E + log_times) / 2.2)), 0, 255).astype(np.uint8), log_times


def by_opencv(Z, log_times):
    """CalibrateDebevec asked for as many samples as there are pixels."""
    side = int(np.sqrt(len(Z)))
    images = [np.repeat(z[: side * side].reshape(side, side, 1), 3, axis=2) for z in Z.T]
    cv2.createCalibrateDebevec(samples=side * side).process(images, np.exp(log_times).astype(np.float32))


if __name__ == "__main__":
    w = hat_weights()
    print("One channel; OpenCV always does three, so its time is divided by 3. Best of 3.")
    for photographs in (4, 16):
        for count in (100, 1000, 10_000, 100_000, 1_000_000):
            Z, log_times = samples(count, photographs)
            ours = partial(gsolve, Z, log_times, 20.0, w)
            others = {}
            if count <= DENSE and photographs * count <= 4 * DENSE:
                others["the paper's matrix"] = partial(paper_solution, Z, log_times, 20.0, w)
            if count <= OPENCV and photographs * count <= 4 * OPENCV:
                others["OpenCV"] = partial(by_opencv, Z, log_times)
            figures = best_of(3, ours, *others.values())
            seconds, memory = figures[ours]
            line = f"{count:8,} pixels x {photographs:2}: {seconds:7.3f} s {memory / 1e6:5.0f} MB"
            for name, work in others.items():
                theirs, taken = figures[work]
                theirs = theirs / 3 if name == "OpenCV" else theirs
                line += f"   {name} {theirs:7.3f} s {taken / 1e6:5.0f} MB ({theirs / seconds:.0f} times as long)"
            print(line, flush=True)
