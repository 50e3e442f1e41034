"""Where student code runs: a kernel with no network, a few folders to read, and only its own to write to.

bubblewrap (bwrap) builds it from what Linux has; nothing is installed in it and nothing is left of it.
"""

import functools
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from hdr_helpers.grading._running.calls import call_filter
from hdr_helpers.grading.course import ROOT, InstructorError
from hdr_helpers.lab.checks import MUST_PASS
from hdr_helpers.lab.checks._examined import EXAMINER

SYSTEM = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32", "/nix/store", "/gnu/store")
SETTINGS = ("/etc/ld.so.cache", "/etc/ld.so.conf", "/etc/fonts", "/etc/alternatives", "/etc/localtime")
COURSE, HOME = "/course", "/home/student"
FILTER = "9"  # number under which bubblewrap finds the filter of calls opened
LINE, SCRATCH = "line", "scratch"  # folders of a job that its kernel gets: one to speak in, one to read from
FONTS = "fonts"  # in LINE: matplotlib's list of fonts
ISOLATED = ("--unshare-all", "--die-with-parent", "--new-session", "--cap-drop", "ALL")
NO_NESTS = ("--unshare-user", "--disable-userns")  # no namespaces within, in which a student could mount things
# Read-only, for where root grades, the settings of the whole machine are files of its own in /proc/sys.
SYSTEM_OF_ITS_OWN = ("--proc", "/proc", "--remount-ro", "/proc", "--dev", "/dev", "--remount-ro", "/dev")
MB = 2**20


@dataclass(frozen=True)
class Bounds:
    """What one notebook may use.

    cell, notebook : seconds; memory : MB of all its processes together; processes : at one time; output : MB that a
    cell may show; disk : MB in each of its folders; check : seconds for all calls of one check
    """

    cell: float = 120.0
    notebook: float = 900.0
    memory: int = 4096
    processes: int = 64
    output: float = 4.0
    disk: int = 512
    check: float = 40.0


@functools.cache
def bubblewrap() -> tuple[str, ...] | None:
    """A bubblewrap that works here with what isolates it most, or None: in some containers it may not do enough."""
    path = shutil.which("bwrap")
    if path is None:
        return None
    for most in ((*ISOLATED, *NO_NESTS), ISOLATED):  # bubblewrap has NO_NESTS since 0.8
        tried = subprocess.run(
            [path, *most, "--ro-bind", "/", "/", *SYSTEM_OF_ITS_OWN, "true"], capture_output=True, check=False
        )
        if tried.returncode == 0:
            return (path, *most)
    return None


def require_sandbox() -> None:
    """Raise InstructorError where student code can't be kept in a sandbox on this machine."""
    if bubblewrap() is None:
        raise InstructorError(
            "There is no sandbox here to run student code in. On Linux install bubblewrap (apt install bubblewrap); a "
            "container must allow it to make namespaces. On macOS and Windows grade in a container, as README.md says. "
            "Or add --no-sandbox: then what students have written can do whatever you can do on this machine."
        )


def kernel_command(folder: Path, examiner: str, bounds: Bounds, sandboxed: bool) -> tuple[list[str], dict, Path]:
    """How a kernel is started: its command for a kernelspec, its environment, and the folder it starts in.

    examiner : address of the examiner of its checks
    folder : holds LINE (the kernel's sockets, and FONTS) and SCRATCH (the examiner's)
    """
    kernel = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    if sandboxed:
        # An empty environment for bubblewrap too, as that of its own process can be read from within.
        command = ["env", "-i", *_walled(folder, examiner, bounds, kernel)]
        if (calls := call_filter()) is not None:
            (folder / "calls").write_bytes(calls)
            command = ["/bin/sh", "-c", f'exec "$@" {FILTER}<"$0"', str(folder / "calls"), *command]
        return _limited(command, bounds), {}, folder
    work = folder / "work" / "notebooks"  # beside it the two folders that notebooks look for at ../
    work.mkdir(parents=True, exist_ok=True)
    for part in ("hdr_helpers", "data"):
        if not (work.parent / part).exists():
            (work.parent / part).symlink_to(ROOT / part, target_is_directory=True)
    return _limited(kernel, bounds), _environment(folder, examiner, str(ROOT)), work


def _environment(folder: Path, examiner: str, course: str) -> dict[str, str]:
    """What the kernel finds in its environment, in a sandbox and out of it."""
    return {
        EXAMINER: examiner,
        MUST_PASS: "0",
        "HDR_RESULTS": "results",
        "MPLCONFIGDIR": str(folder / LINE / FONTS),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": course,
        "PYTHONDONTWRITEBYTECODE": "1",
    }


def _limited(command: list[str], bounds: Bounds) -> list[str]:
    """The same command with the limits that a shell can set, where there is one."""
    if os.name != "posix":
        return command
    # Addresses are cheap and libraries reserve many, so this bound is above that of the memory in use.
    limits = f'ulimit -c 0; ulimit -v {(bounds.memory + 4096) * 1024}; ulimit -f {bounds.disk * 2048}; exec "$@"'
    return ["/bin/sh", "-c", limits, "sh", *command]


def _walled(folder: Path, examiner: str, bounds: Bounds, kernel: list[str]) -> list[str]:
    """The command in a sandbox of bubblewrap. Whatever is not named here is not there."""
    parts = [*bubblewrap(), "--clearenv", "--hostname", "grading"]
    for path in (*SYSTEM, *SETTINGS):
        if os.path.islink(path):
            parts += ["--symlink", os.readlink(path), path]
        elif os.path.exists(path):
            parts += ["--ro-bind", path, path]
    parts += SYSTEM_OF_ITS_OWN
    for path in ("/dev/shm", "/tmp", HOME, f"{COURSE}/notebooks"):
        parts += ["--size", str(bounds.disk * MB), "--tmpfs", path]
    # After /tmp, for the environment or the job may lie in there.
    for path in dict.fromkeys((sys.base_prefix, sys.prefix)):
        if not path.startswith("/usr"):
            parts += ["--ro-bind", path, path]
    for part in ("hdr_helpers", "data"):
        parts += ["--ro-bind", str(ROOT / part), f"{COURSE}/{part}"]
    parts += ["--tmpfs", f"{COURSE}/hdr_helpers/grading", "--remount-ro", f"{COURSE}/hdr_helpers/grading"]
    parts += ["--bind", str(folder / LINE), str(folder / LINE)]
    parts += ["--ro-bind", str(folder / SCRATCH), str(folder / SCRATCH)]
    inside = _environment(folder, examiner, COURSE) | {
        "PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin",
        "HOME": HOME,
        "LANG": "C.UTF-8",
    }
    for name, value in inside.items():
        parts += ["--setenv", name, value]
    if call_filter() is not None:
        parts += ["--seccomp", FILTER]
    return [*parts, "--remount-ro", "/", "--chdir", f"{COURSE}/notebooks", *kernel]
