"""A kernel for student code: in the sandbox, if there is one, and watched while it runs."""

import os
import shutil
import stat
import threading
import time
from contextlib import suppress
from pathlib import Path

import matplotlib.font_manager  # it writes the list of fonts
import psutil
from jupyter_client.kernelspec import KernelSpec
from jupyter_client.manager import AsyncKernelManager

from hdr_helpers.grading._running.sandbox import FONTS, LINE, MB, Bounds, kernel_command

LOOK = 0.2  # seconds between two looks at what a kernel uses
BLOCK = 4096  # bytes


def kernel_manager(folder: Path, examiner: str, bounds: Bounds, sandboxed: bool) -> tuple[AsyncKernelManager, Path]:
    """A manager for one kernel, and the folder to start it in. Arguments as for kernel_command."""
    command, environment, place = kernel_command(folder, examiner, bounds, sandboxed)
    line = folder / LINE
    if sandboxed and line.exists():  # whatever an earlier kernel has left in there, no process outside looks at it
        line.rename(folder / f"left-{time.monotonic_ns()}")
    (line / FONTS).mkdir(parents=True, exist_ok=True)
    for known in Path(matplotlib.get_cachedir()).glob("fontlist-*.json"):  # else each kernel looks for all fonts anew
        shutil.copy(known, line / FONTS)
    manager = AsyncKernelManager(kernel_name="python3", connection_file=str(line / "kernel.json"))
    if sandboxed:  # there is no network in there, and signals do not get in
        manager.transport, manager.ip = "ipc", str(line / "kernel")
    manager._kernel_spec = KernelSpec(
        argv=command, env=environment, language="python", interrupt_mode="message" if sandboxed else "signal"
    )
    return manager, place


class Watch:
    """Ends a kernel that uses more than it may. why : what it was: memory, processes, disk, or what kill was told"""

    def __init__(self, pid: int, folder: Path, bounds: Bounds):
        self.why, self._over = "", threading.Event()
        self._root, self._line, self._bounds = psutil.Process(pid), folder / LINE, bounds
        threading.Thread(target=self._look, daemon=True).start()

    def stop(self) -> None:
        self._over.set()

    def kill(self, why: str) -> None:
        self.why = self.why or why
        for process in self._family():
            with suppress(psutil.Error):
                process.kill()

    def _family(self):
        with suppress(psutil.Error):
            return [self._root, *self._root.children(recursive=True)]
        return []

    def _look(self):
        while not self._over.wait(LOOK):
            family = self._family()
            if memory_of(family, self._bounds.memory * MB) > self._bounds.memory * MB:
                self.kill("memory")
            elif len(family) > self._bounds.processes:
                self.kill("processes")
            else:
                most = self._bounds.disk * MB
                if size_of(self._line, most) + size_of_nameless(family) > most:
                    self.kill("disk")


def memory_of(processes, enough: float) -> int:
    """Bytes of memory that processes use together. What they share is told apart where it seems more than enough."""
    sizes = {}
    for process in processes:
        with suppress(psutil.Error):
            sizes[process] = process.memory_info().rss
    if sum(sizes.values()) > enough:
        for process in sizes:
            with suppress(psutil.Error):
                sizes[process] = getattr(process.memory_full_info(), "pss", sizes[process])
    return sum(sizes.values())


def size_of(folder: Path, enough: float = float("inf")) -> float:
    """Bytes in a folder that others write to meanwhile; not counted any further where it is more than enough.

    No file counts for less than a block, for many empty ones fill a disk too. Links are not followed. A folder that
    can't be looked into, or lies so deep that its path is too long, counts as endless.
    """
    size, folders = 0, [os.fspath(folder)]
    while folders and size <= enough:
        try:
            with os.scandir(folders.pop()) as entries:
                for entry in entries:
                    size += max(entry.stat(follow_symlinks=False).st_size, BLOCK)
                    if entry.is_dir(follow_symlinks=False):
                        folders.append(entry.path)
                    if size > enough:
                        break
        except FileNotFoundError:  # gone since it was listed
            continue
        except OSError:
            return float("inf")
    return size


def size_of_nameless(processes) -> int:
    """Bytes in files that have no name (any more), as long as one of these processes holds them open."""
    sizes = {}
    for process in processes:
        with suppress(OSError):
            for entry in os.scandir(f"/proc/{process.pid}/fd"):
                with suppress(OSError):
                    facts = os.stat(entry.path)
                    if stat.S_ISREG(facts.st_mode) and facts.st_nlink == 0:
                        sizes[facts.st_dev, facts.st_ino] = facts.st_blocks * 512
    return sum(sizes.values())
