"""What a response costs and how far it is from the truth, beside OpenCV and the paper's matrix, in the same run.

python tests/benchmarks/crf.py [gsolve | recover | truth]
"""

import sys
from functools import partial
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from measure import best_of, enlarged, in_turns
from test_crf import paper_solution

from hdr_helpers import gsolve, hat_weights, recover_crf
from hdr_helpers.crf import crf_opencv
from hdr_helpers.lab.camera import FAMILIES
from hdr_helpers.lab.metrics import crf_rmse
from hdr_helpers.lab.scenes import random_scene

TIMES = {4: [1 / 30, 1 / 4, 2.5, 15], 16: 2.0 ** np.arange(-10, 6)}
DENSE, OPENCV = 1000, 1000  # pixels up to which the others are tried: both grow with their square or faster


def samples(count: int, photographs: int):
    """Z of a camera with a gamma of 2.2, and its log times."""
    log_times = np.log(2.0 ** np.arange(photographs))
    log_E = np.random.default_rng(0).uniform(-log_times[-1] - 2, -0.5, (count, 1))
    return np.clip(np.rint(255 * np.exp((log_E + log_times) / 2.2)), 0, 255).astype(np.uint8), log_times


def by_opencv(Z, log_times):
    """CalibrateDebevec asked for as many samples as there are pixels."""
    side = int(np.sqrt(len(Z)))
    images = [np.repeat(z[: side * side].reshape(side, side, 1), 3, axis=2) for z in Z.T]
    cv2.createCalibrateDebevec(samples=side * side).process(images, np.exp(log_times).astype(np.float32))


def gsolves() -> None:
    print("gsolve, one channel, hat weights; OpenCV always does three, so its time is divided by 3. Best of 3.")
    w = hat_weights()
    for photographs in (4, 16):
        for count in (100, 1000, 10_000, 100_000, 1_000_000, 12_000_000):
            Z, log_times = samples(count, photographs)
            ours = partial(gsolve, Z, log_times, 20.0, w)
            others = {}
            if count <= DENSE and photographs * count <= 4 * DENSE:
                others["the paper's matrix"] = partial(paper_solution, Z, log_times, 20.0, w)
            if count <= OPENCV:
                others["OpenCV"] = partial(by_opencv, Z, log_times)
            figures = best_of(3 if count <= 1_000_000 else 1, ours, *others.values())
            seconds, memory = figures[ours]
            memory -= 8 * count  # log_E, which is the answer
            line = f"{count:10,} pixels x {photographs:2}: {seconds:7.3f} s {memory / 1e6:5.0f} MB"
            for name, work in others.items():
                theirs, taken = figures[work]
                theirs = theirs / 3 if name == "OpenCV" else theirs
                line += f"   {name} {theirs:7.3f} s {taken / 1e6:5.0f} MB ({theirs / seconds:.0f} times as long)"
            print(line, flush=True)
    print("Growth: ours with the number of pixels and with the square of that of photographs;")
    print("a dense solution with the cube of the pixels, its matrix with their square.")


def recoveries() -> None:
    print("recover_crf, three channels, beside OpenCV. Best of 5 (2 MP), of 2 (12 MP), of 1 (Robertson).")
    camera = FAMILIES["film"](jpeg_quality=None, bits=16)
    for photographs, shape, runs in ((4, (1152, 1728), 5), (16, (2832, 4256), 2)):
        bracket = enlarged(camera.shoot(random_scene(5), TIMES[photographs]), shape)
        times, response = bracket.times.astype(np.float32), np.exp(camera.crf()).T[:, None].astype(np.float32)
        seconds = in_turns(
            runs,
            ours=partial(recover_crf, bracket),
            debevec=partial(cv2.createCalibrateDebevec().process, list(bracket.images), times),
            merge=partial(cv2.createMergeDebevec().process, list(bracket.images), times, response.copy()),
        )
        print(
            f"{shape[0] * shape[1] / 1e6:.0f} MP x {photographs}: {seconds['ours']:.3f} s; CalibrateDebevec, 70 pixels "
            f"{seconds['debevec']:.3f} s ({seconds['ours'] / seconds['debevec']:.2f} of it); MergeDebevec "
            f"{seconds['merge']:.2f} s ({seconds['ours'] / seconds['merge']:.3f} of it)",
            flush=True,
        )
    for shape in ((128, 192), (256, 384), (512, 768)):
        bracket = enlarged(camera.shoot(random_scene(5, (128, 192)), TIMES[4]), shape)
        seconds = in_turns(1, ours=partial(recover_crf, bracket), robertson=partial(crf_opencv, bracket, "robertson"))
        megapixels = shape[0] * shape[1] / 1e6
        print(f"{megapixels:.2f} MP x 4: {seconds['ours']:.3f} s; CalibrateRobertson {seconds['robertson']:.2f} s")


def truths() -> None:
    print(
        "Error of g against the truth over 5..250, RMS in stops, mean of channels and of 5 random scenes; in brackets"
    )
    print("the share of values within one standard error.")
    print(f"{'camera':32} {'photographs':>11} {'':9} {'recover_crf':>18} {'CalibrateDebevec':>17} {'ratio':>6}")
    for (family, camera), photographs in ((f, p) for f in FAMILIES.items() for p in TIMES):
        for quality in (None, 95, 85):
            ours, theirs, within = [], [], []
            for seed in range(1, 6):
                shot = camera(jpeg_quality=quality, bits=16, seed=seed).shoot(
                    random_scene(seed, (384, 576)), TIMES[photographs]
                )
                response, truth = recover_crf(shot), shot.truth.crf
                ours.append(crf_rmse(response.crf, truth))
                theirs.append(crf_rmse(crf_opencv(shot), truth))
                within.append((np.abs(response.crf - truth) <= response.errors)[:, np.r_[5:128, 129:251]].mean())
            a, b = np.mean(ours), np.mean(theirs)
            kind = "noise" if quality is None else f"JPEG {quality}"
            print(
                f"{family:32} {photographs:11} {kind:9} {a:11.4f} ({np.mean(within):.2f}) {b:17.4f} {a / b:6.3f}",
                flush=True,
            )


if __name__ == "__main__":
    parts = {"gsolve": gsolves, "recover": recoveries, "truth": truths}
    for name in sys.argv[1:] or parts:
        parts[name]()
