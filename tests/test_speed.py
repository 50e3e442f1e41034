"""The benchmarks in a quick form: beside OpenCV in the same run, with a wide margin, so that a slip of speed is seen.

Seen on a quiet machine: 0.35, 0.85 and 0.27; where every core is wanted thrice, 0.85 for the first. tests/benchmarks/
measure seconds, at the size that the README speaks of.
"""

import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from hdr_helpers import align_mtb, merge_debevec, recover_crf
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.scenes import random_scene

sys.path.insert(0, str(Path(__file__).parent / "benchmarks"))
from measure import enlarged

TIMES = 2.0 ** np.arange(-7, 2)
SHAPE = (1000, 1500)


@pytest.fixture(scope="module")
def camera():
    return Camera(jpeg_quality=None)


@pytest.fixture(scope="module")
def bracket(camera):
    """Nine photographs of 1.5 megapixels."""
    return enlarged(camera.shoot(random_scene(1), TIMES), SHAPE)


def share_of_opencv(ours, theirs):
    """Processor time of ours in that of OpenCV's, the least of three runs: what else the machine does hardly counts."""
    least = {}
    for work in 3 * (ours, theirs):
        began = time.process_time()
        work()
        least[work] = min(time.process_time() - began, least.get(work, np.inf))
    return least[ours] / least[theirs]


def test_a_merge_takes_no_more_than_twice_the_work_of_mergedebevec(bracket, camera):
    crf = camera.crf()
    response = np.exp(crf).T[:, None].astype(np.float32).copy()
    times, images = bracket.times.astype(np.float32), list(bracket.images)
    share = share_of_opencv(
        lambda: merge_debevec(images, bracket.times, crf),
        lambda: cv2.createMergeDebevec().process(images, times, response),
    )
    assert share < 2


def test_an_alignment_takes_no_more_than_four_times_the_work_of_alignmtb(bracket):
    images = list(bracket.images)
    share = share_of_opencv(
        lambda: align_mtb(images), lambda: cv2.createAlignMTB().process(images, [image.copy() for image in images])
    )
    assert share < 4


def test_a_response_from_all_pixels_takes_no_more_than_twice_the_work_of_a_merge_by_opencv(bracket, camera):
    response = np.exp(camera.crf()).T[:, None].astype(np.float32).copy()
    times, images = bracket.times.astype(np.float32), list(bracket.images)
    share = share_of_opencv(
        lambda: recover_crf(bracket), lambda: cv2.createMergeDebevec().process(images, times, response)
    )
    assert share < 2
