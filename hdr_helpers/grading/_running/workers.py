"""Jobs side by side: in processes of this machine, or on a cluster by Dask."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from hdr_helpers.grading._running.job import Job, nothing
from hdr_helpers.grading._running.sandbox import require_sandbox
from hdr_helpers.grading.course import ROOT, InstructorError
from hdr_helpers.grading.outcome import NotebookOutcome, from_json

INTERRUPTED = (-signal.SIGINT, 128 + signal.SIGINT)  # exit codes of a job that was told to end, as by Ctrl-C
SPARE = 120.0  # seconds that a notebook may take beyond its bound, to start kernels and to end them


@dataclass(frozen=True)
class Work:
    """A job with its files, to be sent anywhere.

    notebooks : name -> the file as it was handed in; marked : name -> marked_cells; gradebook : the bytes of one
    without students; course : fingerprint of the course that it is to be graded with, empty on this machine
    """

    job: Job
    notebooks: dict[str, bytes]
    marked: dict[str, list[dict]]
    gradebook: bytes
    course: str


def results(works: list[Work], workers: int, scheduler: str | None = None):
    """Run all jobs and yield (student, {name: (outcome, graded file or None)}) as they end.

    workers : jobs at one time on this machine; scheduler : address of a Dask scheduler that has workers of its own
    Raises InstructorError where Dask is missing or its workers have another course.
    """
    if scheduler is None:
        with ThreadPoolExecutor(workers) as pool:
            futures = {pool.submit(run, work): work for work in works}
            try:
                for future in as_completed(futures):
                    yield futures[future].job.student, future.result()
            finally:
                pool.shutdown(wait=False, cancel_futures=True)
        return
    try:
        from distributed import Client
        from distributed import as_completed as completed
    except ImportError as problem:
        raise InstructorError(
            f'--scheduler needs Dask ({problem}); install the extra "cluster" in the course folder: '
            'python -m pip install -e ".[instructor,cluster]"'
        ) from None
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, ValueError) as problem:
        raise InstructorError(f"There is no Dask scheduler at {scheduler} ({type(problem).__name__}).") from None
    with client:
        futures = [client.submit(run, work, key=f"{work.job.student}-{k}", pure=False) for k, work in enumerate(works)]
        names = {future.key: work.job.student for future, work in zip(futures, works, strict=True)}
        for future in completed(futures):
            yield names[future.key], future.result()


def run(work: Work) -> dict[str, tuple[NotebookOutcome, bytes | None]]:
    """Grade one student's notebooks in processes of their own, whatever they do.

    Raises InstructorError where this machine has another version of the course, or no sandbox where one is wanted.
    """
    if work.course and fingerprint() != work.course:
        raise InstructorError(f"{ROOT} is another version of the course than the one that grades; bring it up to date.")
    if work.job.sandboxed:
        require_sandbox()
    with tempfile.TemporaryDirectory(prefix="hdr_", ignore_cleanup_errors=True) as folder:
        folder = Path(folder)
        _lay_out(folder, work)
        done = {}
        while pending := [name for name in work.job.names if name not in done]:
            said = _go(folder, work.job, len(pending))
            for name in pending:
                if (outcome := _bytes(folder / "out" / f"{name}.json")) is not None:
                    done[name] = from_json(outcome.decode("utf-8")), _bytes(folder / "out" / f"{name}.ipynb")
            left = [name for name in pending if name not in done]
            if left:  # the first of them is what the job was at; the next go does the others
                done[left[0]] = nothing(left[0], "stopped", work.marked[left[0]], said), None
            _remove(folder / "kernels")
        return done


def _remove(folder: Path) -> None:
    """Remove what kernels have written to: students may nest folders deeper than Python can follow, or close them."""
    if os.name == "posix":
        command = ["/bin/sh", "-c", 'chmod -R u+rwX -- "$1"; rm -rf -- "$1"', "sh", str(folder)]
        subprocess.run(command, capture_output=True, check=False)


def _lay_out(folder: Path, work: Work) -> None:
    for part in ("in", "marked", "out", "course"):
        (folder / part).mkdir()
    (folder / "job.json").write_text(work.job.to_json(), encoding="utf-8")
    (folder / "course" / "gradebook.db").write_bytes(work.gradebook)
    for name in work.job.names:
        (folder / "in" / f"{name}.ipynb").write_bytes(work.notebooks[name])
        (folder / "marked" / f"{name}.json").write_text(json.dumps(work.marked[name]), encoding="utf-8")


def _go(folder: Path, job: Job, count: int) -> str:
    """Start the job once. Returns a sentence about how it ended, for the notebook that it was at."""
    command = [sys.executable, "-m", "hdr_helpers.grading._running.job", str(folder)]
    longest = count * (2 * job.bounds.notebook + SPARE)
    with open(folder / "log", "ab") as log:
        try:
            code = subprocess.run(command, cwd=ROOT, stdout=log, stderr=log, timeout=longest, check=False).returncode
        except subprocess.TimeoutExpired:
            return f"Grading it took more than {longest:g} seconds."
    if code in INTERRUPTED:
        raise KeyboardInterrupt
    last = (_bytes(folder / "log") or b"").decode("utf-8", "replace").strip().splitlines()[-1:]
    return f"Grading it ended with exit code {code}: {' '.join(last)[:200]}"


def _bytes(path: Path) -> bytes | None:
    return path.read_bytes() if path.exists() else None


def fingerprint() -> str:
    """A word for everything that decides a mark: helpers, checks, grading and data of this course."""
    digest = hashlib.sha256()
    for path in sorted([*(ROOT / "hdr_helpers").rglob("*.py"), *(ROOT / "data").rglob("*.txt")]):
        if "_reporting" not in path.parts:  # it changes no mark
            digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
