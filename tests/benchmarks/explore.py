"""How long a move takes in each explorer, in milliseconds of the kernel: python tests/benchmarks/explore.py

Every control is taken through its values and back, with the course's bracket, in one thread. Where the processor was
busy for less time than passed, other programs had it: then measure again when it is quiet.
"""

import os
import sys
import time
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # set before numpy is there
sys.path.insert(0, str(Path(__file__).parents[1]))

import cv2
import numpy as np
from test_explorers import NAMES, every_move, make

from hdr_helpers.lab.data import chapel


def clocks() -> np.ndarray:
    """Milliseconds that passed, and those in which the processor was busy with this program."""
    return 1000 * np.array([time.perf_counter(), time.process_time()])


def main() -> None:
    cv2.setNumThreads(1)
    bracket = chapel()
    print(f"{'milliseconds':42}{'moves':>6}{'median':>9}{'95%':>8}{'busy, median':>15}")
    for name in NAMES:
        began, took = clocks(), {}
        moving = every_move(make(name, bracket))
        took["made and drawn for the first time"] = [clocks() - began]
        began = clocks()
        for label, _ in moving:
            took.setdefault(label, []).append(clocks() - began)
            began = clocks()
        took["all moves"] = [move for label in list(took)[1:] for move in took[label]]
        for label, each in took.items():
            passed, busy = np.transpose(each)
            numbers = f"{np.median(passed):9.1f}{np.percentile(passed, 95):8.1f}{np.median(busy):15.1f}"
            print(f"{name + ': ' + label:42}{len(each):6}{numbers}")


if __name__ == "__main__":
    main()
