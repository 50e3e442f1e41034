"""Code of a student that takes more than its share, or leaves something behind; and grading without a sandbox."""

import os
import resource
import subprocess
import sys
import time
from importlib.util import find_spec

import pytest

if find_spec("nbgrader") is None:
    pytest.skip("nbgrader is not installed; it comes with the extra 'instructor'.", allow_module_level=True)

import psutil
from kernels import SECRET, Kernel, sandboxed
from short_course import Student, shorter_course

from hdr_helpers.grading._running import sandbox
from hdr_helpers.grading._running.examiner import Examiner
from hdr_helpers.grading._running.kernel import size_of
from hdr_helpers.grading._running.sandbox import COURSE, HOME, MB, Bounds, bubblewrap, require_sandbox
from hdr_helpers.grading._running.workers import _remove
from hdr_helpers.grading.course import ROOT, InstructorError
from hdr_helpers.grading.grade import Options, grade


@sandboxed
def test_the_bounds_of_files_and_cores_hold_and_can_not_be_raised(tmp_path):
    with Kernel(tmp_path / "job", Bounds(disk=20)) as kernel:
        assert kernel.attempt("return open('/tmp/a', 'wb').write(bytes(21 * 2**20))") == ("refused", "OSError")
        fill = "for k in range(8):\n    Path({!r}, str(k)).write_bytes(bytes(4 * 2**20))"
        for place in ("/tmp", "/dev/shm", HOME, f"{COURSE}/notebooks"):
            assert kernel.attempt(fill.format(place)) == ("refused", "OSError"), place
        limits = "import resource as r\nreturn r.getrlimit(r.RLIMIT_CORE), r.getrlimit(r.RLIMIT_FSIZE)"
        assert kernel.attempt(limits) == ("got", ((0, 0), (20 * MB, 20 * MB)))
        raising = "import resource\nresource.setrlimit(resource.RLIMIT_CORE, (resource.RLIM_INFINITY,) * 2)"
        assert kernel.attempt(raising) == ("refused", "ValueError")
        assert kernel.attempt("return len(bytearray(9 * 2**30))") == ("refused", "MemoryError")
        assert not kernel.watch.why
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != 20 * MB


CHURN = """
import threading
def churn():
    while True:
        try:
            os.makedirs({line!r} + '/a/b/c')
            os.removedirs({line!r} + '/a/b/c')
        except OSError:
            pass
for _ in range(4):
    threading.Thread(target=churn, daemon=True).start()
time.sleep(2)
"""
TOO_MUCH = {
    "memory": ("memory", "kept = bytearray(400 * 2**20)\ntime.sleep(60)"),
    "memory of many": ("memory", "for _ in range(4):\n    os.fork()\nkept = b'1' * (40 * 2**20)\ntime.sleep(60)"),
    "memory, with folders that come and go": ("memory", CHURN + "kept = b'1' * (400 * 2**20)\ntime.sleep(60)"),
    "processes": ("processes", "while True:\n    if os.fork() == 0:\n        time.sleep(60)\n    time.sleep(0.01)"),
    "files": ("disk", "for k in range(6):\n    Path({line!r}, str(k)).write_bytes(bytes(4 * 2**20))\ntime.sleep(60)"),
    "empty files": ("disk", "for k in range(6000):\n    Path({line!r}, str(k)).touch()\ntime.sleep(60)"),
    "files without a name": (
        "disk",
        "kept = []\nfor k in range(6):\n    kept.append(open({line!r} + '/a', 'wb', buffering=0))\n"
        "    kept[-1].write(b'1' * 2**22)\n    os.unlink({line!r} + '/a')\ntime.sleep(60)",
    ),
    "files in memory": (
        "disk",
        "kept = [os.memfd_create(str(k)) for k in range(6)]\nfor k in kept:\n    os.write(k, b'1' * 2**22)\n"
        "time.sleep(60)",
    ),
    "folders deeper than a path": (
        "disk",
        "os.chdir({line!r})\nfor k in range(30):\n    os.mkdir('a' * 200)\n    os.chdir('a' * 200)\ntime.sleep(60)",
    ),
}


@sandboxed
@pytest.mark.parametrize("case", TOO_MUCH)
def test_a_kernel_that_takes_more_than_its_share_is_ended_with_all_of_its_processes(case, tmp_path):
    why, body = TOO_MUCH[case]
    with Kernel(tmp_path, Bounds(memory=300, processes=24, disk=20)) as kernel:
        family = psutil.Process(kernel.manager.provisioner.process.pid).children(recursive=True)
        assert kernel.ended_by(body.format(line=str(kernel.line))) == why
        _, alive = psutil.wait_procs(family, timeout=10)
        assert family and not alive


@sandboxed
@pytest.mark.parametrize("how", ["shutdown", "watch"])
def test_a_process_that_has_left_its_parents_ends_with_the_kernel(how, tmp_path):
    leave = """
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        while True:
            open({!r}, 'a').write('.')
            time.sleep(0.02)
    os._exit(0)
"""
    with Kernel(tmp_path) as kernel:
        beats = kernel.line / "beats"
        assert kernel.attempt(leave.format(str(beats)))[0] == "got"
        until = time.monotonic() + 10
        while not (beats.exists() and beats.stat().st_size > 3) and time.monotonic() < until:
            time.sleep(0.02)
        assert beats.stat().st_size > 3
        if how == "watch":
            kernel.watch.kill("over")
            time.sleep(0.5)
            size = beats.stat().st_size
    if how == "shutdown":
        size = beats.stat().st_size
    time.sleep(0.3)
    assert beats.stat().st_size == size


@sandboxed
def test_links_and_folders_that_a_kernel_leaves_are_nothing_to_the_next_one(tmp_path):
    precious = tmp_path / "precious"
    precious.write_text(SECRET)
    with Kernel(tmp_path / "job") as kernel:
        plant = f"""
line = Path({str(kernel.line)!r})
(line / 'kernel.json').unlink()
(line / 'kernel.json').symlink_to({str(precious)!r})
(line / 'kernel-9').mkdir()
(line / 'kernel-8').symlink_to('/')
(line / 'fonts').rename(line / 'elsewhere') if (line / 'fonts').exists() else None
(line / 'fonts').symlink_to({str(tmp_path)!r})
return sorted(os.listdir(line))
"""
        assert "kernel-9" in kernel.attempt(plant)[1]
        assert kernel.attempt(f"return open({str(kernel.line / 'kernel.json')!r}).read()")[0] == "refused"
        assert size_of(kernel.line) < 10 * MB
        left = kernel.line.rename(tmp_path / "kept")
        left.rename(kernel.line)
    with Kernel(tmp_path / "job") as kernel:
        assert kernel.attempt("return 5") == ("got", 5)
        assert not (kernel.line / "kernel.json").is_symlink() and not (kernel.line / "kernel-9").exists()
    assert precious.read_text() == SECRET


@sandboxed
def test_the_examiners_address_can_be_asked_but_not_taken(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", None)
    (tmp_path / "scratch").mkdir()
    examiner = Examiner(str(tmp_path / "scratch" / "examiner"), 5, 10.0, tmp_path / "scratch")
    try:
        with Kernel(tmp_path) as kernel:
            assert kernel.attempt("os.unlink(os.environ['HDR_EXAMINER'])") == ("refused", "OSError")
            examiner.expect("3.1")
            ask = "from hdr_helpers.lab.checks import check\nreturn check('3.1', lambda: 5).points"
            assert kernel.attempt(ask) == ("got", 0.0) and examiner.results["3.1"].points == 0
    finally:
        examiner.close()


@sandboxed
def test_a_kernel_has_the_list_of_fonts_and_does_not_make_it_anew(tmp_path):
    with Kernel(tmp_path) as kernel:
        found = list((kernel.line / "fonts").glob("fontlist-*.json"))
        before = [path.stat().st_mtime_ns for path in found]
        find = "from matplotlib import font_manager\nreturn font_manager.findfont('DejaVu Sans').endswith('.ttf')"
        assert kernel.attempt(find) == ("got", True)
        after = list((kernel.line / "fonts").glob("fontlist-*.json"))
        assert found and after == found and [path.stat().st_mtime_ns for path in after] == before


def test_what_kernels_have_left_is_removed_however_deep_or_closed_it_is(tmp_path):
    (tmp_path / "kernels" / "line").mkdir(parents=True)
    (tmp_path / "kept").write_text(SECRET)
    (tmp_path / "kernels" / "line" / "link").symlink_to(tmp_path)
    dig = "import os\nfor k in range(3000):\n    os.mkdir('a')\n    os.chdir('a')\nos.chmod('.', 0)"
    subprocess.run([sys.executable, "-c", dig], cwd=tmp_path / "kernels" / "line", check=True)
    (tmp_path / "kernels" / "line" / "a").chmod(0)
    _remove(tmp_path / "kernels")
    assert not (tmp_path / "kernels").exists() and (tmp_path / "kept").read_text() == SECRET


def test_without_a_sandbox_a_notebook_finds_the_course_where_it_looks_for_it(tmp_path):
    with Kernel(tmp_path, isolated=False) as kernel:
        assert kernel.attempt("return os.getcwd()") == ("got", str(tmp_path / "work" / "notebooks"))
        there = "return os.path.isfile('../hdr_helpers/crf.py') and os.path.isdir('../data')"
        assert kernel.attempt(there) == ("got", True)
        look = "from hdr_helpers.lab import data\nreturn len(data.chapel().images) > 2"
        assert kernel.attempt(look) == ("got", True)
        assert kernel.attempt("return os.path.exists('/etc/passwd')") == ("got", os.path.exists("/etc/passwd"))


def test_without_a_sandbox_a_submission_is_graded(tmp_path):
    source = shorter_course(tmp_path / "source")[1:]
    Student(source).hand_in(tmp_path / "in" / "ada")
    options = Options(workers=1, sandboxed=False)
    (ada,) = grade(tmp_path / "in", tmp_path / "out", options, say=lambda _: None, notebooks=source)
    assert ada.todos and all(todo.state == "right" for todo in ada.todos) and not ada.all_flags


LEFT_OUT = "Cell 4 was left out, because it ended the kernel."


@sandboxed
def test_what_comes_after_the_time_of_a_notebook_is_not_run_and_what_came_before_counts(tmp_path):
    source = shorter_course(tmp_path / "source")[:1]
    due = {
        "": ["It took more than 45 seconds; cell 5 and later were not run."],
        "import os\nos._exit(3)": [LEFT_OUT, "It took more than 45 seconds, and was not run again."],
    }
    for k, last in enumerate(due):
        Student(source).insert("todo-3-2", f"import time\ntime.sleep(45)\n{last}").hand_in(tmp_path / "in" / f"s{k}")
    options = Options(bounds=Bounds(notebook=45))
    students = grade(tmp_path / "in", tmp_path / "out", options, say=lambda _: None, notebooks=source)
    for student, flags in zip(students, due.values(), strict=True):
        assert [todo.state for todo in student.todos] == ["right", "unasked", "unasked"]
        assert student.todos[1].said == ["The check was not reached, because the notebook was stopped before."]
        assert student.notebooks[0].kind == "stopped"
        assert student.notebooks[0].flags == flags


@pytest.fixture
def fresh():
    """What is known of bubblewrap is forgotten before and after."""
    bubblewrap.cache_clear()
    yield
    bubblewrap.cache_clear()


def test_where_bubblewrap_is_missing_it_is_said_what_to_do(fresh, monkeypatch):
    monkeypatch.setattr(sandbox.shutil, "which", lambda _: None)
    with pytest.raises(InstructorError, match=r"no sandbox here.*apt install bubblewrap.*--no-sandbox"):
        require_sandbox()


def fake(folder, script):
    folder.mkdir()
    (folder / "bwrap").write_text(f"#!/bin/sh\n{script}\n")
    (folder / "bwrap").chmod(0o755)
    return f"{folder}:/usr/bin:/bin"


# As in a container that allows nothing, and in one that allows namespaces but no /proc in them.
NOT_ENOUGH = ["exit 1", 'for word; do [ "$word" = --proc ] && exit 1; done; exit 0']


@pytest.mark.parametrize("script", NOT_ENOUGH)
def test_a_bubblewrap_that_may_not_do_all_that_is_asked_of_it_counts_as_none(script, fresh, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", fake(tmp_path / "bin", script))
    with pytest.raises(InstructorError, match="no sandbox here"):
        require_sandbox()


def test_an_older_bubblewrap_is_used_without_what_it_does_not_know(fresh, monkeypatch, tmp_path):
    script = 'for word; do [ "$word" = --disable-userns ] && exit 1; done; exit 0'
    monkeypatch.setenv("PATH", fake(tmp_path / "bin", script))
    require_sandbox()
    assert bubblewrap() == (str(tmp_path / "bin" / "bwrap"), *sandbox.ISOLATED)


def test_the_command_ends_with_that_sentence_where_there_is_no_sandbox(tmp_path):
    (tmp_path / "in" / "ada").mkdir(parents=True)
    command = [sys.executable, "-m", "hdr_helpers.grading", "grade", str(tmp_path / "in"), "-o", str(tmp_path / "out")]
    environment = os.environ | {"PATH": fake(tmp_path / "bin", "exit 1")}
    ended = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 1 and "no sandbox here" in ended.stderr and "Traceback" not in ended.stderr
