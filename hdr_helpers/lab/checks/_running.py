"""Run a student's function so that whatever it does comes back as a value or as one sentence.

A time limit, bounded output, no warnings, inputs that are copies, and an exception told with the line it comes from.
It is no sandbox: a function that means harm can do it.
"""

import builtins
import copy
import ctypes
import dis
import io
import linecache
import os
import signal
import sys
import threading
import traceback
import warnings
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from unittest.mock import patch

import numpy as np

KEPT = 2000  # characters of what a function prints; the rest is dropped
AGAIN = 0.01  # seconds after which a function that swallowed the time limit is told again
PATIENCE = 100  # times that a thread is told to end before it is left alone


class Wrong(Exception):
    """A property does not hold; the text is the sentence for the student."""


class Stop(Wrong):
    """The function can't be asked anything more: each further call would fail like this one, or take as long."""


class NotStarted(Exception):
    """The function is still a stub."""


class TimeUp(BaseException):
    """The time limit. No Exception, so that a student's except clause does not take it for one."""


class Bounded(io.TextIOBase):
    """A text stream that keeps the first KEPT characters."""

    def __init__(self):
        super().__init__()
        self.text = ""

    def write(self, text):
        self.text += str(text)[: KEPT - len(self.text)]
        return len(text)

    def writable(self):
        return True


def run_safely(function, args, keywords, limit: float):
    """What function(*args, **keywords) returns.

    limit : seconds
    Raises NotStarted where it is a stub; Stop where it runs out of time or wants to end the program; Wrong, with the
    exception and the student's line, where it raises, and where it changes its arguments.
    """
    copies = copy.deepcopy((args, keywords))

    def call():
        # In here, because a thread has warnings and error states of its own.
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            return function(*copies[0], **copies[1])

    try:
        with _quiet():
            value = call_within(call, limit)
    except TimeUp:
        raise Stop(
            f"{name_of(function)} was stopped, because the check gives it {limit:.2g} seconds at most; does a loop "
            "never end, or go over every pixel one by one?"
        ) from None
    except NotImplementedError as problem:
        if type(problem) is NotImplementedError:
            raise NotStarted from None
        raise Wrong(_told(function, problem)) from None
    except MemoryError as problem:
        raise Stop(_told(function, problem)) from None
    except Exception as problem:
        raise Wrong(_told(function, problem)) from None
    except BaseException as problem:  # SystemExit, KeyboardInterrupt, or something of the student's own
        raise Stop(f"{name_of(function)} ended with {type(problem).__name__} and returned nothing.") from None
    if value is None and returns_only_none(function):
        raise NotStarted
    if not same(copies, (args, keywords)):
        raise Wrong(
            f"{name_of(function)} changes the arrays that it is given, so that whoever called it goes on with other "
            "data; work on a copy."
        )
    return value


def call_within(call, limit: float):
    """What call() returns, or TimeUp after limit seconds: by a timer where there is one, else in a thread."""
    if limit <= 0:
        raise TimeUp
    if hasattr(signal, "setitimer") and threading.current_thread() is threading.main_thread():
        return _by_timer(call, limit)
    return _by_thread(call, limit)


def _by_timer(call, limit):
    running = True

    def ring(*_):
        if running:
            raise TimeUp

    before = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, limit, AGAIN)
        try:
            return call()
        finally:
            running = False
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def _by_thread(call, limit):
    outcome = {}

    def work():
        try:
            outcome["value"] = call()
        except BaseException as problem:
            outcome["problem"] = problem

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(limit)
    late = thread.is_alive()
    for _ in range(PATIENCE):
        if not thread.is_alive():
            break
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident), ctypes.py_object(TimeUp))
        thread.join(AGAIN)
    if late or not outcome:
        raise TimeUp
    if "problem" in outcome:
        raise outcome["problem"]
    return outcome["value"]


@contextmanager
def _quiet():
    """Nothing of what runs in here shows: no print, no figure, no display, no question; the folder stays the same."""

    def no_input(*_):
        raise RuntimeError("input() can't be answered while a check runs")

    pyplot, ipython = sys.modules.get("matplotlib.pyplot"), sys.modules.get("IPython")
    figures = set(pyplot.get_fignums()) if pyplot else set()
    shell = ipython.get_ipython() if ipython else None
    folder = os.getcwd()
    with ExitStack() as stack:
        stack.enter_context(redirect_stdout(Bounded()))
        stack.enter_context(redirect_stderr(Bounded()))
        stack.enter_context(patch.object(builtins, "input", no_input))
        if shell is not None:
            stack.enter_context(patch.object(shell.display_pub, "publish", lambda *_, **__: None))
        try:
            yield
        finally:
            with suppress(OSError):
                os.chdir(folder)
            if pyplot := sys.modules.get("matplotlib.pyplot"):
                for number in set(pyplot.get_fignums()) - figures:
                    pyplot.close(number)


def _told(function, problem) -> str:
    """The exception in a sentence, with the last line of the student's own code that it passed."""
    code = getattr(function, "__code__", None)
    frames = [f for f in traceback.extract_tb(problem.__traceback__) if code and f.filename == code.co_filename]
    said = shortened(" ".join(str(problem).split()))
    sentence = f"{name_of(function)} stops with {type(problem).__name__}{f' ({said})' if said else ''}"
    if not frames:
        return f"{sentence}."
    line = shortened(linecache.getline(frames[-1].filename, frames[-1].lineno).strip(), 90)
    return f"{sentence} in line {frames[-1].lineno} of its cell{f': {line}' if line else '.'}"


def shortened(text: str, length: int = 160) -> str:
    return text if len(text) <= length else f"{text[: length - 3]}..."


def name_of(function) -> str:
    return getattr(function, "__name__", type(function).__name__)


def returns_only_none(function) -> bool:
    """Whether a function's code does nothing but return None, as pass or a docstring alone does."""
    code = getattr(function, "__code__", None)
    return code is not None and _steps(code) <= _steps((lambda: None).__code__) | {("NOP", None)}


def _steps(code) -> set[tuple]:
    """What a function compiles to, which every Python does otherwise."""
    return {(step.opname, step.argval) for step in dis.get_instructions(code)}


def same(these, those) -> bool:
    """Whether two nests of arrays, lists, dicts and plain values are equal."""
    if isinstance(these, np.ndarray) or isinstance(those, np.ndarray):
        alike = isinstance(these, np.ndarray) and isinstance(those, np.ndarray) and these.shape == those.shape
        return alike and these.dtype == those.dtype and bool(np.array_equal(these, those))
    if isinstance(these, dict):
        return isinstance(those, dict) and these.keys() == those.keys() and all(same(these[k], those[k]) for k in these)
    if isinstance(these, (list, tuple)):
        return len(these) == len(those) and all(map(same, these, those))
    return bool(these == those)
