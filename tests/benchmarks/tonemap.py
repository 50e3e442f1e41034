"""What a picture costs, beside OpenCV in the same run: every operator, and exposure fusion.

python tests/benchmarks/tonemap.py [preview | full | fusion | judged]

Figures are ratios of one run: the times themselves say as much of the machine. OpenCV no longer has Durand's operator
and never had Reinhard's of 2002; beside them stand its Mantiuk and its Reinhard of 2005.
"""

import sys
from functools import partial

import cv2
import numpy as np
from measure import in_turns

from hdr_helpers.lab import data
from hdr_helpers.lab.judging import judge
from hdr_helpers.papers.mertens2007 import exposure_fusion
from hdr_helpers.tonemap import OPERATORS, tonemap

PREVIEW, FULL = (427, 640), (2832, 4256)
BESIDE = {
    "gamma": cv2.createTonemap,
    "reinhard": cv2.createTonemapReinhard,
    "reinhard_global": cv2.createTonemapReinhard,
    "drago": cv2.createTonemapDrago,
    "mantiuk": cv2.createTonemapMantiuk,
    "durand": cv2.createTonemapMantiuk,
}


def chapel(shape) -> np.ndarray:
    """The chapel's true radiance map, enlarged or made smaller."""
    return cv2.resize(data.chapel().truth.radiance, shape[::-1], interpolation=cv2.INTER_CUBIC)


def operators(shape, runs: int) -> None:
    print(f"{shape[1]} x {shape[0]}; least seconds of {runs}. Ours end in a picture from 0 to 1 without NaN.")
    radiance = np.maximum(chapel(shape), 1e-6)
    for name in OPERATORS:
        theirs = BESIDE[name]
        seconds = in_turns(
            runs, ours=partial(tonemap, radiance, name), opencv=lambda make=theirs: make(2.2).process(radiance)
        )
        print(
            f"{name:16} {1e3 * seconds['ours']:8.1f} ms; {theirs.__name__:22} {1e3 * seconds['opencv']:8.1f} ms; "
            f"ratio {seconds['ours'] / seconds['opencv']:.2f}",
            flush=True,
        )


def fusion() -> None:
    print("Exposure fusion of 4 photographs; least seconds of 2.")
    for shape in (PREVIEW, FULL):
        images = [cv2.resize(image, shape[::-1], interpolation=cv2.INTER_CUBIC) for image in data.chapel().images[1::2]]
        seconds = in_turns(
            2,
            ours=partial(exposure_fusion, images),
            opencv=lambda images=images: cv2.createMergeMertens(1, 1, 1).process(images),
        )
        print(
            f"{shape[1]} x {shape[0]}: {seconds['ours']:.3f} s; MergeMertens {seconds['opencv']:.3f} s; "
            f"ratio {seconds['ours'] / seconds['opencv']:.2f}",
            flush=True,
        )


def judged() -> None:
    print("The chapel, judged by its true radiance map.")
    radiance = data.chapel().truth.radiance
    pictures = {name: tonemap(radiance, name) for name in OPERATORS}
    pictures["fusion"] = exposure_fusion(data.chapel().images)
    for name, ldr in pictures.items():
        clipped, detail, tmqi = (judgement := judge(ldr, radiance)).clipped, judgement.detail, judgement.tmqi
        print(
            f"{name:16} detail kept: dark {detail.dark:.2f}, bright {detail.bright:.2f}; black {clipped.black:.2%}, "
            f"white {clipped.white:.2%}; TMQI {tmqi.quality:.3f} (fidelity {tmqi.fidelity:.3f}, "
            f"naturalness {tmqi.naturalness:.3f})"
        )


if __name__ == "__main__":
    parts = {
        "preview": partial(operators, PREVIEW, 7),
        "full": partial(operators, FULL, 2),
        "fusion": fusion,
        "judged": judged,
    }
    for name in sys.argv[1:] or parts:
        parts[name]()
