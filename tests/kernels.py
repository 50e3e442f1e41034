"""A kernel as grading starts it, for tests that run a student's code in it."""

import ast
import asyncio
import time
from contextlib import suppress
from queue import Empty
from textwrap import indent

import pytest
from jupyter_client.blocking import BlockingKernelClient

from hdr_helpers.grading._running.kernel import Watch, kernel_manager
from hdr_helpers.grading._running.sandbox import Bounds, bubblewrap

sandboxed = pytest.mark.skipif(bubblewrap() is None, reason="bubblewrap is missing or may not make namespaces here.")
SECRET = "the-answer-that-nobody-may-see"
ATTEMPT = """
import ctypes, os, socket, stat, sys, time
from pathlib import Path
def attempt():
{}
try:
    print(ascii(("got", attempt())))
except BaseException as problem:
    print(ascii(("refused", type(problem).__name__)))
"""


class Kernel:
    """A kernel as a job starts it, and a client that runs cells in it."""

    def __init__(self, folder, bounds=Bounds(), isolated=True):  # noqa: B008  (it is frozen)
        (folder / "scratch").mkdir(parents=True, exist_ok=True)
        self.line, self._loop = folder / "line", asyncio.new_event_loop()
        self.manager, place = kernel_manager(folder, str(folder / "scratch" / "examiner"), bounds, isolated)
        self._loop.run_until_complete(self.manager.start_kernel(cwd=str(place)))
        self.watch = Watch(self.manager.provisioner.process.pid, folder, bounds)
        self.client = BlockingKernelClient()
        self.client.load_connection_info(self.manager.get_connection_info())
        self.client.start_channels()
        self._wait_for_both_channels()

    def _wait_for_both_channels(self):
        # Not the client's own wait_for_ready, which takes a late heartbeat on a busy machine for a dead kernel.
        for _ in range(60):
            self.client.kernel_info(reply=True, timeout=60)
            with suppress(Empty):
                return self.client.get_iopub_msg(timeout=1)
        raise TimeoutError("The kernel does not say what it does.")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.watch.kill("over")
        self.watch.stop()
        self.client.stop_channels()
        self._loop.run_until_complete(self.manager.shutdown_kernel(now=True))
        self._loop.close()

    def attempt(self, body: str):
        """What the body of a function returns in the kernel, as ("got", value), or ("refused", name of exception)."""
        said = []

        def hear(message):
            said.append(message["content"].get("text", ""))

        code = ATTEMPT.format(indent(body, "    "))
        self.client.execute_interactive(code, output_hook=hear, timeout=60, allow_stdin=False)
        return ast.literal_eval("".join(said).strip().splitlines()[-1])

    def ended_by(self, body: str) -> str:
        """Run code that the watch is to end the kernel for; the reason that it gives, or nothing."""
        self.client.execute(ATTEMPT.format(indent(body, "    ")))
        until = time.monotonic() + 30
        while not self.watch.why and time.monotonic() < until:
            time.sleep(0.05)
        return self.watch.why
