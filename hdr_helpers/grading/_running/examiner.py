"""The examiner: looks at a student's functions from a process that the student's code can't reach.

A check cell in the student's kernel says which TODO it stands for. The examiner makes the data, asks the kernel to call
the function, looks at what comes back and keeps the points. A notebook can print what it likes; it can't give itself
points, and it never sees the seed or what is expected.
"""

import os
import socket
import tempfile
import threading
from contextlib import contextmanager, suppress
from multiprocessing.connection import Listener

from hdr_helpers.lab.checks import TODOS
from hdr_helpers.lab.checks._examined import told
from hdr_helpers.lab.checks._report import Line, Result
from hdr_helpers.lab.checks._running import NotStarted, Stop, Wrong, shortened
from hdr_helpers.lab.checks._todos import NOT_LOOKED_AT, examine
from hdr_helpers.lab.checks._wire import WireError, pack, unpack

LARGEST = 256 * 2**20  # bytes of one answer
QUESTION = 2**16  # bytes of what a caller says first
CALLERS = 32  # that have said nothing yet; one more, and the first of them is sent away
SAID = 600  # characters of a sentence, which may be a student's own
GRACE = 10.0  # seconds after the limit in which the kernel may still say itself that the function took too long
FIRST = 5.0  # seconds in which a caller says what it wants


class Examiner:
    """Answers the check cells of one kernel after another, at an address that a sandbox can be given.

    address : for multiprocessing.connection; None for one of its own choice
    seed : of the data, not the notebooks' own
    limit : seconds for all calls of a check
    scratch : folder that the kernel can read, for photographs that a function is to load
    stop : called where a function can't be stopped in any other way; it ends the kernel
    """

    def __init__(self, address, seed: int, limit: float, scratch=None, stop=lambda: None):
        self.seed, self.limit, self.stop = seed, limit, stop
        self.results = {}  # of check cells: number -> Result
        self._ended = {}  # of functions that ended their kernel: they are not called again
        self._cell = None, ""  # number and ticket of the check cell that runs now
        self._silent, self._one, self._closed = [], threading.Lock(), False
        if scratch is not None:
            tempfile.tempdir = str(scratch)
        self._listener = Listener(address)
        self.address = self._listener.address
        threading.Thread(target=self._serve, daemon=True).start()

    def expect(self, number, ticket: str = "") -> None:
        """From now on the cell of this check runs; None for any other cell. Only what it asks for counts.

        ticket : what the cell shows with its question; whatever is read late, and was asked before, shows another
        """
        self._cell = number, ticket

    def settle(self, seconds: float = GRACE) -> None:
        """Wait until nothing is being looked at."""
        if self._one.acquire(timeout=seconds):
            self._one.release()

    def close(self) -> None:
        self._closed = True
        with suppress(OSError):
            self._listener.close()

    def _serve(self):
        while True:
            try:
                line = Speech(self._listener.accept())
            except (OSError, EOFError):  # closed, or a caller that went away at once
                if self._closed:
                    return
                continue
            self._silent.append(line)
            for first in self._silent[:-CALLERS]:
                first.end()
            threading.Thread(target=self._hear, args=(line,), daemon=True).start()

    def _hear(self, line):
        """Answer one caller. Each is heard in a thread of its own, so that none keeps another from asking."""
        # The caller may go away, or never speak our language; its check cell then has no result.
        with line, suppress(OSError, EOFError, WireError):
            try:
                question = line.hear(FIRST, QUESTION)
            finally:
                self._silent.remove(line)
            asked = question.get("check")
            if isinstance(asked, str) and asked in TODOS:
                with self._one:
                    self._examine(line, asked, str(question.get("ticket", "")))

    def _examine(self, line, asked, ticket):
        counts, todo = (asked, ticket) == self._cell, TODOS[asked]
        result = self._ended.get(asked)
        if result is None:
            caller = Caller(line, self.stop)
            result = examine(todo, caller.stub(todo.name), self.seed, self.limit, caller.call)
            for part in result.lines:
                part.sentence = shortened(part.sentence.encode("utf-8", "replace").decode("utf-8"), SAID)
            if caller.lost:
                result.own = False
                if counts:  # another cell may have asked for another function of this name
                    self._ended[asked] = result
        if counts:
            self.results[asked] = result
        line.say(told(result), FIRST)


class Speech:
    """A caller's line, on which nothing takes for ever: the other end may stop in the middle of a message."""

    def __init__(self, connection):
        self._connection = connection
        self._ends = socket.socket(fileno=os.dup(connection.fileno())) if os.name == "posix" else None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._connection.close()
        if self._ends:
            self._ends.close()

    def end(self) -> None:
        """Whoever waits for this line waits no longer."""
        with suppress(OSError):
            self._ends.shutdown(socket.SHUT_RDWR) if self._ends else self._connection.close()

    def say(self, message: bytes, seconds: float) -> None:
        """Send a message. Raises OSError, TimeoutError where the other end does not take it."""
        with self._within(seconds):
            self._connection.send_bytes(message)

    def hear(self, seconds: float, most: int) -> dict:
        """The next message, of so many bytes at most.

        Raises TimeoutError, EOFError, OSError where there is none or a larger one, WireError where it is no message.
        """
        with self._within(seconds):
            if not self._connection.poll(seconds):
                raise TimeoutError
            data = self._connection.recv_bytes(most)
        message = unpack(data)
        if not isinstance(message, dict):
            raise WireError("a message is a dictionary")
        return message

    @contextmanager
    def _within(self, seconds):
        late = threading.Event()
        timer = threading.Timer(seconds, lambda: (late.set(), self.end()))
        timer.daemon = True
        timer.start()
        try:
            yield
        except (OSError, EOFError):
            if late.is_set():
                raise TimeoutError from None
            raise
        finally:
            timer.cancel()
            timer.join()


class Caller:
    """Calls a student's function at the other end of a line."""

    def __init__(self, line, stop):
        self.line, self.stop, self.lost = line, stop, False

    def stub(self, name):
        def function(*_, **__):
            raise RuntimeError("only the kernel can call this")

        function.__name__ = name
        return function

    def call(self, todo, function, args, keywords, limit):
        """What the kernel's function returns. Raises as hdr_helpers.lab.checks._todos.call does."""
        if limit <= 0:
            raise Stop(f"{todo.name} took more time than the check has.")
        try:
            self.line.say(pack({"args": args, "keywords": keywords, "limit": limit}), limit + GRACE)
            said = self.line.hear(limit + GRACE, LARGEST)
        except TimeoutError:
            self.lost = True
            self.stop()
            raise Stop(
                f"{todo.name} was stopped, and the notebook's kernel with it: it went on after the {limit:.2g} seconds "
                "that the check gives it, and could not be interrupted."
            ) from None
        except (OSError, EOFError):
            self.lost = True
            raise Stop(
                f"{todo.name} ended the notebook's kernel, or took more memory than there is, or returned more than "
                f"{LARGEST // 2**20} MB."
            ) from None
        except WireError:
            raise Wrong("What it returns could not be read.") from None
        if "value" in said:
            return said["value"]
        if "not started" in said:
            raise NotStarted
        if "stop" in said:
            raise Stop(str(said["stop"]))
        raise Wrong(str(said.get("wrong")))


def unasked(number: str, reason: str) -> Result:
    """The result of a check that was never run. reason : a sentence"""
    first, *others = TODOS[number].parts
    lines = [Line("wrong", reason, first[0]), *(Line("wrong", NOT_LOOKED_AT, part[0]) for part in others)]
    return Result(number, lines, "", own=False)
