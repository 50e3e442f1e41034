"""The examiner keeps the points: nothing that a notebook says sways it, and nobody keeps it from the next check."""

import contextlib
import importlib
import os
import subprocess
import sys
import tempfile
import time
from multiprocessing.connection import Client
from pathlib import Path

import numpy as np
import pytest

from hdr_helpers.grading._running import examiner as rooms
from hdr_helpers.grading._running.examiner import Examiner
from hdr_helpers.lab.checks import check
from hdr_helpers.lab.checks._running import same
from hdr_helpers.lab.checks._wire import pack, unpack

sys.path.insert(0, str(Path(__file__).parent))
corpus = importlib.import_module("mistakes.corpus")
for stage in ("load", "align", "crf", "system", "curves", "merge", "tonemap"):
    importlib.import_module(f"mistakes.{stage}")

RIGHT = {answer.number: answer.function for answer in corpus.RIGHT}
SEED = 918273


@pytest.fixture
def make(monkeypatch, tmp_path):
    """make(limit, ...) is an examiner, which check() asks from then on."""
    monkeypatch.setattr(tempfile, "tempdir", None)  # it sets this; here it is put back
    made = []

    def make(limit=20.0, seed=SEED, **others):
        (tmp_path / "scratch").mkdir()
        made.append(Examiner(str(tmp_path / "line"), seed, limit, tmp_path / "scratch", **others))
        monkeypatch.setenv("HDR_EXAMINER", made[0].address)
        return made[0]

    yield make
    for one in made:
        one.close()


def test_an_answer_is_judged_on_data_of_the_examiners_own(make, monkeypatch):
    make()
    for number in ("1.3", "2.1", "2.3", "3.2", "3.3", "3.4", "3.5", "3.6", "4.1", "4.2", "4.3", "5.1", "5.2"):
        given = []

        def takes(*args, given=given):
            given.append([np.concatenate([np.ravel(part).astype(str) for part in args])])
            return 0

        check(number, takes)
        with monkeypatch.context() as alone:
            alone.delenv("HDR_EXAMINER")
            check(number, takes)
        assert len(given) >= 2 and not same(given[0], given[len(given) // 2]), number


def test_photographs_lie_in_the_folder_that_the_kernel_can_read(make, tmp_path):
    given, examiner = [], make()
    right = RIGHT["1.3"]

    def load(folder, *others):
        given.append((Path(folder), len(list(Path(folder).iterdir()))))
        return right(folder, *others)

    examiner.expect("1.3")
    assert check("1.3", load).passed
    assert given and all(tmp_path / "scratch" in folder.parents and count > 1 for folder, count in given)


def question(examiner, number="3.3"):
    """A caller's line after its first message, and what it is asked."""
    line = Client(examiner.address)
    line.send_bytes(pack({"check": number}))
    return line, line.recv_bytes()


def test_neither_seed_nor_anything_but_arguments_is_told_to_the_kernel(make):
    line, asked = question(make())
    assert set(unpack(asked)) == {"args", "keywords", "limit"} and str(SEED).encode() not in asked
    line.close()


def test_only_the_check_of_the_cell_that_runs_counts(make):
    examiner = make()
    for expected in (None, "", "3.2"):
        examiner.expect(expected)
        assert check("3.1", RIGHT["3.1"]).passed and not examiner.results
    examiner.expect("3.1")
    check("3.1", RIGHT["3.1"])
    examiner.expect("3.2")
    check("3.1", lambda: 0)
    assert examiner.results.keys() == {"3.1"} and examiner.results["3.1"].passed


def test_a_question_of_an_earlier_cell_that_is_read_late_does_not_count(make, monkeypatch):
    examiner = make()
    examiner.expect("3.1", "now")
    for ticket in ("", "before"):
        monkeypatch.setenv("HDR_TICKET", ticket)
        assert check("3.1", RIGHT["3.1"]).passed and not examiner.results
    monkeypatch.setenv("HDR_TICKET", "now")
    check("3.1", RIGHT["3.1"])
    assert examiner.results["3.1"].passed


FULL = {"number": "3.3", "last": "", "own": True, "difference": "", "notes": [], "lines": [("right", "All.", 7.0)]}


def test_a_result_that_the_caller_claims_is_not_taken(make):
    examiner = make()
    examiner.expect("3.3")
    with Client(examiner.address) as line:
        line.send_bytes(pack({"result": FULL, "number": "3.3"}))
        with pytest.raises(EOFError):
            line.recv_bytes()
    assert not examiner.results
    line, _ = question(examiner)
    while True:
        line.send_bytes(pack({"result": FULL, "own": True, "points": 7.0}))
        if "result" in (said := unpack(line.recv_bytes())):
            break
    assert sum(points for state, _, points in said["result"]["lines"] if state == "right") == 0
    assert examiner.results["3.3"].points == 0


def test_a_sentence_from_the_kernel_is_cut_and_can_be_written_to_a_file(make):
    examiner = make()
    examiner.expect("3.3")
    line, _ = question(examiner)
    while True:
        line.send_bytes(pack({"wrong": "\ud800" + "x" * 10**6}))
        if "result" in unpack(line.recv_bytes()):
            break
    assert 100 < len(examiner.results["3.3"].lines[0].sentence) <= rooms.SAID
    str(examiner.results["3.3"]).encode("utf-8")


NO_CHECKS = map(pack, (5, [], {}, {"check": "9.9"}, {"check": [1]}, {"check": {}}, {"check": np.zeros(2)}))


@pytest.mark.parametrize("first", [b"", bytes(50), bytes(rooms.QUESTION + 1), *NO_CHECKS])
def test_whoever_does_not_ask_for_a_check_is_sent_away(make, first):
    make()
    with Client(os.environ["HDR_EXAMINER"]) as line:
        with contextlib.suppress(OSError):
            line.send_bytes(first)
        with pytest.raises((EOFError, OSError)):
            line.recv_bytes()
    assert check("3.1", RIGHT["3.1"]).passed


def silent(line):
    """Says nothing."""


def in_the_middle(line):
    os.write(line.fileno(), b"\0\0")


def of_a_terabyte(line):
    os.write(line.fileno(), b"\xff" * 4 + (2**40).to_bytes(8, "big"))


def goes_away(line):
    line.send_bytes(pack({"check": "3.3"}))
    line.close()


@pytest.mark.parametrize("caller", [silent, in_the_middle, of_a_terabyte, goes_away])
def test_other_callers_do_not_keep_a_check_from_being_answered(make, caller):
    make()
    lines = []
    for _ in range(3 * rooms.CALLERS):
        lines.append(Client(os.environ["HDR_EXAMINER"]))
        with contextlib.suppress(OSError):
            caller(lines[-1])
    began = time.monotonic()
    assert check("3.1", RIGHT["3.1"]).passed
    assert time.monotonic() - began < rooms.FIRST / 2
    for line in lines:
        line.close()


@pytest.mark.parametrize("caller", [silent, in_the_middle, of_a_terabyte])
def test_a_caller_that_is_asked_and_does_not_answer_is_ended_and_the_next_is_heard(make, caller, monkeypatch):
    monkeypatch.setattr(rooms, "GRACE", 0.3)
    ended = []
    examiner = make(limit=0.3, stop=lambda: ended.append(True))
    examiner.expect("3.3")
    line, _ = question(examiner)
    caller(line)
    began = time.monotonic()
    assert check("3.1", RIGHT["3.1"]).passed
    assert time.monotonic() - began < 3 and examiner.results["3.3"].points == 0
    assert bool(ended) == (caller is not of_a_terabyte)
    line.close()


def test_a_caller_that_takes_nothing_is_ended_too(make, monkeypatch):
    monkeypatch.setattr(rooms, "GRACE", 0.3)
    ended = []
    make(limit=0.3, stop=lambda: ended.append(True))
    with Client(os.environ["HDR_EXAMINER"]) as line:
        line.send_bytes(pack({"check": "4.2"}))  # photographs, more than a socket holds
        assert line.poll(10)
        assert check("3.1", RIGHT["3.1"]).passed and ended


def test_an_answer_of_more_than_the_largest_ends_the_line_and_nothing_else(make, monkeypatch):
    monkeypatch.setattr(rooms, "LARGEST", 10_000)
    examiner = make()
    examiner.expect("3.1")
    with pytest.raises(OSError):  # the rest of the answer finds nobody
        check("3.1", lambda: np.zeros(10**7))
    assert "returned more than" in str(examiner.results["3.1"]) and examiner.results["3.1"].points == 0
    assert check("2.2", RIGHT["2.2"]).passed


KERNEL = """
import sys
from hdr_helpers.lab.checks import check
def hat():
    {}
print(check("3.1", hat))
"""


def kernel(body):
    """Another process that checks a function with this body."""
    return subprocess.Popen([sys.executable, "-c", KERNEL.format(body)], stdout=subprocess.PIPE, text=True)


def test_a_function_that_ends_its_process_is_told_so_and_not_called_again(make):
    examiner = make()
    examiner.expect("3.1")
    process = kernel("import os; sys.__stdout__.write('called'); sys.__stdout__.flush(); os._exit(3)")
    assert "called" in process.communicate(timeout=30)[0] and process.returncode == 3
    examiner.settle()
    assert "ended the notebook's kernel" in str(examiner.results["3.1"]) and examiner.results["3.1"].points == 0
    process = kernel("sys.__stdout__.write('called'); return 5")
    said = process.communicate(timeout=30)[0]
    assert process.returncode == 0 and "ended the notebook's kernel" in said and "called" not in said.split("TODO")[0]
    assert check("3.1", RIGHT["3.1"]).points == 0 and check("3.3", RIGHT["3.3"]).passed


def test_a_function_that_can_not_be_interrupted_is_ended_with_its_kernel(make, monkeypatch):
    monkeypatch.setattr(rooms, "GRACE", 0.5)
    processes = []
    examiner = make(limit=0.5, stop=lambda: processes[0].kill())
    examiner.expect("3.1")
    processes.append(kernel("import signal; signal.pthread_sigmask(0, range(1, 65))\n    while True: pass"))
    processes[0].communicate(timeout=30)
    assert processes[0].returncode == -9
    examiner.settle()
    assert "could not be interrupted" in examiner.results["3.1"].lines[0].sentence


def test_a_closed_examiner_can_not_be_asked(make):
    make().close()
    with pytest.raises(OSError):
        check("3.1", RIGHT["3.1"])
