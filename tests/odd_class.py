"""A class of odd submissions of the shorter course: TODOs 3.1, 3.2, 3.4 and, mostly not handed in, 4.3.

Every function below spoils one student's notebooks by what its code does or claims. Its decorator says what is due.
Odd cells and files, and pasted answers, are in odd_files.
"""

import json
from typing import NamedTuple

from short_course import Student

from hdr_helpers.grading.solutions import BEGIN

CLASS = {}
ALL, NONE = "right right right", "unasked unasked unasked"
GRADED = ("graded", "missing")


class Due(NamedTuple):
    """What a submission is due, and why.

    spoil : changes a Student, or returns the files that are handed in
    states : of 3.1, 3.2, 3.4, 4.3; kinds : of 03_crf and 04_merge
    flags : words of each flag, in order; said : number -> words of the first sentence of its check
    """

    spoil: object
    states: list
    kinds: tuple
    flags: tuple
    said: dict


def due(states, *flags, kinds=GRADED, **said):
    """said : words of checks, such as t31 for that of 3.1"""

    def add(spoil):
        numbers = {f"{name[1]}.{name[2]}": words for name, words in said.items()}
        CLASS[spoil.__name__] = Due(spoil, [*states.split(), "unasked"][:4], kinds, flags, numbers)
        return spoil

    return add


def each(words, *names):
    return [words.format(name) for name in names]


def begin(student, grade_id, text):
    """Put lines before the solution of a TODO."""
    cell = student.cell(grade_id)
    cell["source"] = cell["source"].replace(f"    {BEGIN}\n", f"    {BEGIN}\n{text}\n")


def as_bytes(student, name="03_crf"):
    return json.dumps(student.notebooks[name]).encode()


def files(odd: Due, student: Student) -> dict[str, bytes]:
    """What is handed in, by name."""
    return odd.spoil(student) or {"03_crf.ipynb": as_bytes(student)}


# Code that does not end, or wants too much. Loops wait in between, for other tests run beside them

# Not left by any signal before it ends, for Python looks for signals between its own steps only.
IN_C = "import ctypes, itertools\n{}sum(map(ctypes.PyDLL(None).usleep, itertools.repeat(10_000)))"


@due("wrong right right", t31="was stopped, because the check gives it 15 seconds")
def a_loop_in_a_function_and_100_MB_printed_in_another(student):
    student.write("todo-3-1", "    import time\n    while True:\n        time.sleep(0.01)")
    begin(student, "todo-3-4", "    print('x' * 10**8)")


@due("wrong wrong right", *each("TODO {}, when its check ran it: it could not be interr", "3.1", "3.2"), t31="went on")
def a_loop_that_stops_the_clock_and_one_in_c(student):
    stop = "    import signal\n    signal.signal(signal.SIGALRM, signal.SIG_IGN)\n"
    student.write("todo-3-1", f"{stop}    import time\n    while True:\n        time.sleep(1)")
    student.write("todo-3-2", f"    {IN_C.format('    return ')}")


@due(ALL, *each("Cell {} was interrupted after 40 seconds", 2, 5))
def a_loop_in_a_cell_and_a_shell_that_sleeps(student):
    student.insert("todo-3-1", "import time\nwhile True:\n    time.sleep(0.1)")
    student.insert("todo-3-2", "%%bash\nsleep 1000")


@due(ALL, "Cell 4 was left out, because it went on for more than 40 seconds and could not be interrupted")
def a_loop_in_c_in_a_cell(student):
    student.insert("todo-3-2", IN_C.format(""))


@due("right wrong right", "Cell 2 was left out, because it took more than 800 MB", "TODO 3.2, when", t32="more memory")
def eats_memory_in_a_cell_and_in_a_function(student):
    student.insert("todo-3-1", "hoard = [np.ones(2**22) for _ in range(1000)]")
    student.write("todo-3-2", "    hoard = [np.ones(2**22) for _ in range(1000)]")


@due(ALL, *each("Cell {} showed more than 1 MB", 2, 3, 4, 5))
def floods_what_its_cells_show(student):
    student.insert("todo-3-1", "for _ in range(3000):\n    print('x' * 10_000)")
    student.insert("todo-3-1", "shown = display('a', display_id=True)\nshown.update('x' * 10**7)")
    student.insert("todo-3-1", "for _ in range(5000):\n    display('x' * 1000)")
    student.insert("todo-3-1", "raise ValueError('x' * 10**7)")


@due(
    ALL,
    "Cell 2 was left out, because it started more than 40 pro",
    "Cell 3 was left out, because it wrote more than 64",
)
def starts_many_processes_and_fills_the_disk(student):
    fill = "import os, pathlib\nfor k in range(2000):\n    (pathlib.Path({}) / str(k)).write_bytes(bytes(2**20))"
    student.insert("todo-3-1", "import subprocess\nall = [subprocess.Popen(['sleep', '1000']) for _ in range(1000)]")
    student.insert("todo-3-1", fill.format("os.environ['MPLCONFIGDIR']"))
    student.insert("todo-3-1", fill.format("'.'"))


# Code that ends the kernel, or would


@due("wrong right right", "TODO 3.1, when its check ran it: it e", "Cell 4 was left out, because it e", t31="ended the")
def leaves_by_os_exit_in_a_function_and_in_a_cell(student):
    student.write("todo-3-1", "    import os\n    os._exit(3)")
    student.insert("todo-3-2", "import os\nos._exit(3)")


@due("wrong right right", "TODO 3.1, when its", *each("Cell {} was left out, because it", 4, 5, 6, 7), t31="ended")
def ends_its_kernel_in_a_function_and_in_one_cell_after_another(student):
    student.write("todo-3-1", "    import os\n    os._exit(3)")
    for _ in range(4):
        student.insert("todo-3-2", "import os\nos._exit(3)")


@due(ALL, "Cell 9 was left out, because it ended the kernel")
def kills_its_kernel_some_seconds_later(student):
    student.insert("check-3-4", "import time\ntime.sleep(100)", after=True)
    timer = "import os, threading\nthreading.Timer(5, os.kill, (os.getpid(), 9)).start()"
    student.insert("check-3-4", timer, after=True)


@due("right wrong right", t32="ended with SystemExit")
def says_exit_and_asks_who_you_are_and_deletes_the_helpers(student):
    for text in ("exit()", "sys.exit(0)", "input('Who?')", "shutil.rmtree('../hdr_helpers')"):
        student.insert("todo-3-1", f"import shutil, sys\n{text}")
    begin(student, "todo-3-1", "    get_ipython().ask_exit()")
    student.write("todo-3-2", "    raise SystemExit")


# Code that raises, or changes what others use


@due("unasked right right", "setup-3 was edited; it was put back", t31="its own cell ended with SyntaxError")
def raises_at_import_and_has_an_error_of_syntax(student):
    student.cell("setup-3")["source"] = "import no_such_thing\n"
    student.insert("todo-3-1", "import no_such_thing")
    student.write("todo-3-1", "    return np.minimum(z, 255 - z")


SHOUTS = """
import sys, threading, time
def shout():
    while True:
        print("!", file=sys.stderr, flush=True)
        time.sleep(0.001)
threading.Thread(target=shout).start()
"""


@due(ALL)
def changes_numpy_and_prints_in_a_thread_for_ever(student):
    student.insert("todo-3-1", "np.dot = np.random.default_rng = np.min = np.allclose = None\nnp.random.seed(5)")
    student.insert("todo-3-1", SHOUTS)


# Points that nobody gave


FULL = """
class Full:
    points = most = 22.0
    def __repr__(self):
        return "22.0"
result = Full()
print(22.0)
"""


@due("empty empty empty")
def forges_what_is_shown(student):
    student.empty().insert("todo-3-1", f"{FULL}check = lambda *_, **__: result")
    student.insert("check-3-1", f"{FULL}result", after=True)
    student.insert("check-3-4", "check = display = print = lambda *_: 22.0")


CHANGES = """
from types import SimpleNamespace
from hdr_helpers.lab import checks
from hdr_helpers.lab.checks import _examined, _report, _todos
full = SimpleNamespace(points=22.0, passed=True, function=len)
checks.check = checks.examine = _examined.ask = _todos.examine = lambda *_, **__: full
_report.Result.points = property(lambda self: 22.0)
_todos.TODOS.clear()
"""


@due(NONE, t31="no longer stands for", t32="no longer stands for", t34="no longer stands for")
def changes_the_checks(student):
    student.empty().insert("todo-3-1", CHANGES)


TALKS = """
import os
from multiprocessing.connection import Client
from hdr_helpers.lab.checks._wire import pack
claim = {"number": "3.1", "own": True, "last": "", "lines": [("right", "All.", 22.0)]}
for say in ({"check": "3.1"}, {"check": "3.1", "result": claim}, {"result": claim}, {"value": 22.0}):
    with Client(os.environ["HDR_EXAMINER"]) as line:
        try:
            for message in (pack(say), pack({"value": claim}), pack({"result": claim}), b"22.0"):
                line.send_bytes(message)
        except OSError:
            pass
"""


@due("empty empty empty")
def talks_to_the_examiner_itself(student):
    student.empty().insert("todo-3-1", TALKS)


STANDS_IN = """
import os, threading
from multiprocessing.connection import Listener
from hdr_helpers.lab.checks._wire import pack
try:
    os.remove(os.environ["HDR_EXAMINER"])
except OSError:
    os.environ["HDR_EXAMINER"] = "/tmp/mine"
listener = Listener(os.environ["HDR_EXAMINER"])
claim = {"number": "3.1", "own": True, "last": "", "difference": "", "notes": []}
def serve():
    while True:
        with listener.accept() as line:
            line.recv_bytes()
            line.send_bytes(pack({"result": claim | {"lines": [("right", "All.", 22.0)]}}))
threading.Thread(target=serve, daemon=True).start()
"""


@due(NONE, t31="no longer stands for", t32="no longer stands for", t34="no longer stands for")
def answers_in_the_examiners_place(student):
    student.empty().insert("todo-3-1", STANDS_IN)
