"""A check survives whatever a student's function does, says it in a sentence, and lets nothing through."""

import os
import sys
import threading
import time
import warnings
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from hdr_helpers.lab import checks
from hdr_helpers.lab.checks import check
from hdr_helpers.lab.checks._todos import TODOS


def prints_ten_megabytes():
    for _ in range(1000):
        print("x" * 10_000)
        print("x" * 100, file=sys.stderr)
    return np.minimum(np.arange(256.0), 255 - np.arange(256))


def test_nothing_that_a_function_prints_or_warns_of_is_shown(capfd):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert check("3.1", prints_ten_megabytes).passed
        check("4.1", lambda Z, B, g, w: np.exp((w[Z] * g[Z]).sum(0) / w[Z].sum(0)))
        check("4.1", lambda Z, B, g, w: np.zeros(Z.shape[1:]))
    assert not caught
    assert capfd.readouterr() == ("", "")


def leaves():
    sys.exit(0)


def interrupts():
    raise KeyboardInterrupt


def recurses():
    return recurses()


def asks():
    return input("weights?")


def moves():
    os.chdir("/")
    return np.zeros(3)


class Odd:
    """Neither array nor number, and angry when it is looked at."""

    def __array__(self, *_, **__):
        raise RuntimeError("no")

    def __eq__(self, other):
        raise RuntimeError("no")

    __hash__ = None


ODD = 0, "text", [], (1, 2, 3), {}, np.zeros(0), np.full((3, 3), np.nan), np.array(["a"]), Odd(), (Odd(), Odd())


@pytest.mark.parametrize("number", sorted(TODOS))
def test_any_value_is_answered_with_a_sentence(number):
    for value in ODD:
        result = check(number, lambda *_, value=value, **__: value)
        assert not result.passed and result.started


@pytest.mark.parametrize("function", [leaves, interrupts, recurses, asks, moves])
def test_a_check_survives_what_a_function_does(function):
    before = Path.cwd()
    result = check("3.1", function)
    assert not result.passed and result.started
    assert Path.cwd() == before


def never_ends():
    while True:
        with suppress(Exception):
            time.sleep(0.001)


def test_an_endless_loop_is_stopped_in_the_main_thread_and_in_another():
    began = time.monotonic()
    assert "seconds at most" in str(check("3.1", never_ends, limit=0.3))
    said = []
    thread = threading.Thread(target=lambda: said.append(str(check("3.1", never_ends, limit=0.3))))
    thread.start()
    thread.join(20)
    assert "seconds at most" in said[0]
    assert time.monotonic() - began < 20


def test_right_answers_are_right_in_another_thread_too():
    results = []
    thread = threading.Thread(
        target=lambda: results.append(check("4.3", checks.maps.stops_above_median.course.__wrapped__))
    )
    thread.start()
    thread.join()
    assert results[0].passed


def test_an_exception_is_told_with_the_students_line():
    def hat():
        weights = np.zeros(256)
        weights[300] = 1
        return weights

    sentence = check("3.1", hat).lines[0].sentence
    assert "IndexError" in sentence and "weights[300] = 1" in sentence


def test_answers_that_exist_are_out_of_reach_under_any_name_and_are_back_afterwards():
    import cv2

    from hdr_helpers import gsolve

    names = {}
    exec(
        "from hdr_helpers import gsolve as mine\nfrom hdr_helpers import gsolve\n"
        "def my_gsolve(Z, B, lam, w):\n    try:\n        return mine(Z, B, lam, w)\n    except Exception:\n"
        "        return None\n",
        names,
    )
    result = check("3.4", names["my_gsolve"])
    assert result.points == 0 and "gsolve" in result.lines[0].sentence and "out of reach" in result.lines[0].sentence
    assert names["mine"] is gsolve and checks.crf.gsolve is gsolve
    assert "createTonemapReinhard" in str(check("5.2", lambda m, **_: cv2.createTonemapReinhard().process(m)))
    assert cv2.createTonemapReinhard(1.5, 0, 0, 0).process(np.ones((2, 2, 3), np.float32)).shape == (2, 2, 3)


def test_the_checks_own_answer_is_out_of_reach_too():
    assert "out of reach" in str(check("3.1", lambda: TODOS["3.1"].course()))


def test_something_else_than_a_function_is_told_so():
    assert "function should stand" in str(check("3.3", 5))
