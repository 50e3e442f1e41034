"""How often, how fast and how well align_mtb does its work, beside OpenCV's AlignMTB in the same run.

    python tests/benchmarks/align.py truth [N]      N random brackets (200) of each kind, against their truth
    python tests/benchmarks/align.py speed          time, and memory beyond the photographs, at 2 and 12 megapixels
    python tests/benchmarks/align.py real [FOLDER]  crops of real brackets: as shot, by OpenCV, by align_mtb

Figures are ratios of one run: the times themselves say as much of the machine.
"""

import sys
import time
from functools import partial
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from conftest import REAL
from measure import best_of
from test_align import FOUR, SIXTEEN, random_bracket

from hdr_helpers import align_mtb, load_bracket
from hdr_helpers.align import unaligned
from hdr_helpers.lab.metrics import misplacement

KINDS = (  # exposures, largest shift, largest turn, rows and columns
    (FOUR, 20, 0.0, (384, 512)),
    (SIXTEEN, 20, 0.0, (384, 512)),
    (SIXTEEN, 50, 0.0, (512, 768)),
    (SIXTEEN, 20, 0.5, (384, 512)),
    (FOUR, 20, 0.5, (384, 512)),
)


def by_opencv(images):
    """An Alignment of AlignMTB's shifts to the middle photograph."""
    grays = [cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in images]
    middle, aligner = len(images) // 2, cv2.createAlignMTB()
    still = unaligned(images)
    for k, gray in enumerate(grays):
        if k != middle:
            still.shifts[k] = aligner.calculateShift(grays[middle], gray)
    return still


def chained_by_opencv(images):
    """The same from neighbour to neighbour."""
    middle, still = len(images) // 2, unaligned(images)
    for step, side in ((1, range(middle + 1, len(images))), (-1, range(middle - 1, -1, -1))):
        for k in side:
            still.shifts[k] = still.shifts[k - step] + by_opencv([images[k], images[k - step]]).shifts[0]
    return still


def truth(count: int) -> None:
    print(f"{count} brackets of each kind. Off: more than 1 pixel from where it belongs.")
    for times, reach, turn, size in KINDS:
        started, off, silent, doubtful, brackets, others = time.perf_counter(), 0, 0, 0, 0, np.zeros(2)
        for seed in range(1000, 1000 + count):
            bracket = random_bracket(seed, times, reach, turn, size)
            found = align_mtb(bracket.images)
            wrong = misplacement(bracket, found) > 1
            off, silent = off + wrong.sum(), silent + (wrong & ~found.doubtful).sum()
            doubtful, brackets = doubtful + found.doubtful.sum(), brackets + wrong.any()
            if not turn:
                for i, other in enumerate((by_opencv, chained_by_opencv)):
                    others[i] += np.sum(misplacement(bracket, other(bracket.images)) > 1)
        frames = count * len(times)
        opencv = (
            "" if turn else f"; OpenCV {others[0] / frames:.1%} off to the middle, {others[1] / frames:.1%} chained"
        )
        print(
            f"{len(times):2} exposures, shifts to {reach} px, turns to {turn} degrees: {off / frames:.2%} of {frames} "
            f"off, of these {silent} not reported; {doubtful / frames:.2%} doubtful; {brackets} brackets not "
            f"perfect{opencv}  ({time.perf_counter() - started:.0f} s)",
            flush=True,
        )


def _process(images):
    """AlignMTB's own way, into photographs of their own, as align_mtb gives them."""
    aligned = [np.empty_like(image) for image in images]
    aligned[len(images) // 2] = images[len(images) // 2]  # this one it does not write
    cv2.createAlignMTB().process(images, aligned)
    return aligned


def speed() -> None:
    print("The best of 5 runs each. Both keep the photographs they were given and make new ones.")
    for height, width in ((1152, 1728), (2832, 4256)):
        for times in (FOUR, SIXTEEN):
            small = random_bracket(0, times, 10, size=(height // 4, width // 4)).images
            images = [cv2.resize(image, (width, height), interpolation=cv2.INTER_CUBIC) for image in small]
            works = partial(align_mtb, images), partial(_process, images)
            align_mtb(small)  # what libraries need at their first use is not counted
            best = best_of(5, *works)
            (ours, memory), (theirs, other) = (best[work] for work in works)
            print(
                f"{width * height / 1e6:4.1f} MP x {len(images):2}: {ours:.2f} s, OpenCV {theirs:.2f} s, "
                f"ratio {ours / theirs:.2f}; memory {memory / 1e6:.0f} MB, OpenCV {other / 1e6:.0f} MB",
                flush=True,
            )


CROPS = {"hdr": (1480, 500, 240, 320), "pixel7": (900, 1500, 240, 320), "pingpong": (640, 1150, 240, 320),
         "memorial": (480, 240, 120, 160), "window": (200, 400, 120, 160)}  # fmt: skip


def real(folder: Path) -> None:
    """Neighbours laid over each other, the darker one in red and blue: grey where they lie on each other."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (top, left, height, width) in CROPS.items():
        images = load_bracket(REAL / name).images
        rows = []
        for pictures in (images, _process(images), align_mtb(images).images):
            crops = [cv2.cvtColor(p, cv2.COLOR_RGB2GRAY)[top : top + height, left : left + width] for p in pictures]
            crops = [cv2.equalizeHist(c) for c in crops]
            rows.append(np.concatenate([np.dstack([a, b, a]) for a, b in pairwise(crops)], axis=1))
        cv2.imwrite(str(folder / f"{name}.png"), np.concatenate(rows))
        print(f"{folder / name}.png: as shot, OpenCV, align_mtb")


if __name__ == "__main__":
    what, *rest = sys.argv[1:] or ["help"]
    if what == "truth":
        truth(int(rest[0]) if rest else 200)
    elif what == "speed":
        speed()
    elif what == "real":
        real(Path(rest[0] if rest else "build/align"))
    else:
        sys.exit(__doc__)
