"""Seconds and memory of a piece of work, each run in a process of its own (Linux)."""

import multiprocessing
import time
from pathlib import Path

import numpy as np

from hdr_helpers import Bracket


def best_of(runs: int, *works) -> dict:
    """For each work, a function without arguments, its least seconds and the bytes it needed beyond what was there."""
    best = {}
    for _ in range(runs):
        for work in works:  # in turns: a noisy moment hits all of them
            figures = _alone(work)
            best[work] = min(best.get(work, figures), figures)
    return best


def in_turns(runs: int, **works) -> dict[str, float]:
    """Least seconds of each work, all in this process: threads and caches are warm, as they are in a notebook."""
    best = {name: [] for name in works}
    for _ in range(runs + 1):  # the first round warms up
        for name, work in works.items():
            started = time.perf_counter()
            work()
            best[name].append(time.perf_counter() - started)
    return {name: min(seconds[1:]) for name, seconds in best.items()}


def needed(work) -> int:
    """Bytes that a work needed beyond what was there, its result included."""
    Path("/proc/self/clear_refs").write_text("5")  # the highest point so far is forgotten
    before = _status("VmRSS")
    work()
    return _status("VmHWM") - before


def _alone(work) -> tuple[float, int]:
    fork = multiprocessing.get_context("fork")
    queue = fork.Queue()
    process = fork.Process(target=_measured, args=(work, queue))
    process.start()
    figures = queue.get()
    process.join()
    return figures


def _measured(work, queue) -> None:
    Path("/proc/self/clear_refs").write_text("5")  # the highest point so far is forgotten
    before, started = _status("VmRSS"), time.perf_counter()
    work()
    queue.put((time.perf_counter() - started, _status("VmHWM") - before))


def _status(key) -> int:
    (line,) = [text for text in Path("/proc/self/status").read_text().splitlines() if text.startswith(key)]
    return 1024 * int(line.split()[1])


def enlarged(bracket, shape) -> Bracket:
    """The photographs repeated until they fill a shape."""
    times = [-(-n // m) for n, m in zip(shape, bracket.images[0].shape, strict=False)]
    images = [np.ascontiguousarray(np.tile(i, (*times, 1))[: shape[0], : shape[1]]) for i in bracket.images]
    return Bracket(tuple(images), bracket.times, bracket.names)
