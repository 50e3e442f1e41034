"""Running a submitted notebook: nbgrader's Execute with a watched kernel, bounds, and an examiner for the checks.

Where a cell ends its kernel, the notebook is run once more without that cell, so that bad cells cost no others.
"""

import os
import secrets
import time
from dataclasses import dataclass, field
from pathlib import Path

from nbclient.exceptions import CellTimeoutError, DeadKernelError
from nbformat.v4 import new_code_cell, new_output
from nbgrader.preprocessors import Execute

from hdr_helpers.grading._running.examiner import GRACE, Examiner, unasked
from hdr_helpers.grading._running.harmless import harmless
from hdr_helpers.grading._running.kernel import Watch, kernel_manager
from hdr_helpers.grading._running.sandbox import MB, SCRATCH, Bounds
from hdr_helpers.lab.checks._examined import TICKET
from hdr_helpers.lab.checks._running import shortened

BEGINNING = "get_ipython().ask_exit = lambda: None"  # exit() ends a kernel a moment later, in some other cell
PRELUDE = "from hdr_helpers.lab.checks import check, hint\n__import__('os').environ[{!r}] = {!r}"
ENDINGS = {
    "dead": "it ended the kernel",
    "memory": "it took more than {memory} MB of memory",
    "processes": "it started more than {processes} processes",
    "disk": "it wrote more than {disk} MB",
    "time": "it went on for more than {cell:g} seconds and could not be interrupted",
    "examiner": "it could not be interrupted",
}


@dataclass
class Task:
    """One notebook to run, and what came of it.

    folder : for this notebook alone; seed : of the examiner's data
    results : of the checks, by number; asked : the numbers of those that were run
    flags : sentences for the instructor; stopped : whether the notebook did not get to its end
    """

    folder: Path
    bounds: Bounds
    seed: int
    sandboxed: bool
    results: dict = field(default_factory=dict)
    asked: set = field(default_factory=set)
    flags: list = field(default_factory=list)
    stopped: bool = False


def number_of(cell, kind: str = "check") -> str:
    """ "3.1" for the check cell of TODO 3.1 (or kind "todo", its own cell), empty for any other cell."""
    name = str(cell.metadata.get("nbgrader", {}).get("grade_id", ""))
    return name.removeprefix(f"{kind}-").replace("-", ".") if name.startswith(f"{kind}-") else ""


class ExecuteSubmission(Execute):
    """nbgrader's Execute for the notebook in task, which is set before nbgrader makes an instance."""

    task: Task = None

    def preprocess(self, nb, resources=None, km=None):
        """Run all cells, then put what the examiner found into the check cells."""
        task = self.task
        self.store_widget_state = False
        self.skipped, self.ended, self.watch = {}, set(), None
        self.deadline = time.monotonic() + task.bounds.notebook
        (task.folder / SCRATCH).mkdir(parents=True, exist_ok=True)
        self.examiner = Examiner(
            str(task.folder / SCRATCH / "examiner") if os.name == "posix" else None,
            task.seed,
            task.bounds.check,
            task.folder / SCRATCH,
            stop=lambda: self.watch.kill("examiner"),
        )
        try:
            while not self._runs_to_its_end(nb, resources):  # each run leaves one thing more out
                if time.monotonic() > self.deadline:
                    task.stopped = True
                    task.flags.append(f"It took more than {task.bounds.notebook:g} seconds, and was not run again.")
                    break
        finally:
            self.examiner.close()
        task.results = self.examiner.results
        task.asked = set(task.results)
        for cell in nb.cells:
            harmless(cell)
            if number := number_of(cell):
                self._show(cell, number, nb)
        return nb, self.resources

    def _runs_to_its_end(self, nb, resources) -> bool:
        """Run the notebook; where that fails, see to it that the next run does not fail there for the same reason."""
        self.at, self.began = 0, False
        try:
            super().preprocess(nb, resources)
            return True
        except (DeadKernelError, CellTimeoutError, RuntimeError) as problem:
            if not self.began:
                raise  # no kernel at all: this is not the student's doing
            self.examiner.settle()
            why = self.watch.why or ("time" if isinstance(problem, CellTimeoutError) else "dead")
        finally:
            if self.watch:
                self.watch.kill("over")
                self.watch.stop()
        number, said = number_of(nb.cells[self.at]), ENDINGS[why].format(**vars(self.task.bounds))
        if number in self.examiner.results and number not in self.ended:  # it does not ask for this function again
            self.ended.add(number)
            self.task.flags.append(f"TODO {number}, when its check ran it: {said}. The notebook was run once more.")
        else:
            self.skipped[self.at] = f"Cell {self.at + 1} was left out, because {said}."
            self.task.flags.append(self.skipped[self.at])
        return False

    def create_kernel_manager(self):
        task = self.task
        self.km, self.place = kernel_manager(task.folder, self.examiner.address, task.bounds, task.sandboxed)
        return self.km

    def start_new_kernel(self, **keywords):
        super().start_new_kernel(**keywords | {"cwd": str(self.place)})
        self.fresh = True  # nothing has run in it
        self.watch = Watch(self.km.provisioner.process.pid, self.task.folder, self.task.bounds)

    def preprocess_cell(self, cell, resources, index):
        self.at, self.began, self.shown = index, True, 0
        if index in self.skipped:
            said = self.skipped[index]
            cell["outputs"] = [new_output("error", ename="LeftOut", evalue=said, traceback=[said])]
            return cell, resources
        if time.monotonic() > self.deadline:
            if not self.task.stopped:
                self.task.stopped = True
                said = (
                    f"It took more than {self.task.bounds.notebook:g} seconds; cell {index + 1} and later were not run."
                )
                self.task.flags.append(said)
            cell["outputs"] = []
            return cell, resources
        number, bounds = number_of(cell), self.task.bounds
        ticket = secrets.token_hex(8)
        self.examiner.expect(number, ticket)
        # The examiner ends a check by itself, and knows why.
        self.timeout = int(max(bounds.cell, bounds.check + 2 * GRACE) if number else bounds.cell)
        self.raise_on_iopub_timeout = False  # a cell that ended and whose output comes late is no slow cell
        if self.fresh:
            self.fresh = False
            self._run_our_own(BEGINNING, index)
        if number:  # a student may have used the name for something else
            self._run_our_own(PRELUDE.format(TICKET, ticket), index)
        cell, resources = super().preprocess_cell(cell, resources, index)
        if any(output.get("ename") == "CellTimeoutError" for output in cell.get("outputs", ())):
            self.task.flags.append(f"Cell {index + 1} was interrupted after {self.timeout} seconds.")
        for output in cell.get("outputs", ()):
            if output.output_type == "error" and not self._may_show(output):  # nbgrader adds one that was dropped
                output.ename, output.evalue = shortened(output.ename), shortened(output.evalue)
                output.traceback = [f"{output.ename}: {output.evalue}"]
        return cell, resources

    def _run_our_own(self, source, index):
        """Run something before the cell at this index."""
        cell = self.nb.cells[index]
        try:
            self.execute_cell(new_code_cell(source), index, store_history=False)
        finally:
            self.nb.cells[index] = cell  # where nbclient has put ours

    async def _async_handle_timeout(self, timeout, cell=None):
        """Interrupt a cell; from now on, one that does not end can't be interrupted."""
        self.raise_on_iopub_timeout = True
        return await super()._async_handle_timeout(timeout, cell)

    def output(self, outs, msg, display_id, cell_index):
        """Keep what a cell shows, as far as it may."""
        return super().output(outs, msg, display_id, cell_index) if self._may_show(msg["content"]) else None

    def _update_display_id(self, display_id, msg):
        """Change what was shown before, as far as this cell may show more; nbclient has no other place for this."""
        if msg["msg_type"] != "update_display_data" or self._may_show(msg["content"]):
            super()._update_display_id(display_id, msg)

    def _may_show(self, content) -> bool:
        """Count what the cell that runs now shows."""
        self.shown += len(str(content))
        if self.shown <= self.task.bounds.output * MB:
            return True
        said = f"Cell {self.at + 1} showed more than {self.task.bounds.output:g} MB; the rest was dropped."
        if said not in self.task.flags:
            self.task.flags.append(said)
        return False

    def _show(self, cell, number, nb):
        """The check cell shows the examiner's result, whatever the kernel printed there."""
        if number not in self.task.results:
            self.task.results[number] = unasked(number, self._why_unasked(cell, number, nb))
        result = self.task.results[number]
        data = {"text/plain": repr(result), "text/html": result._repr_html_()}
        cell.outputs = [new_output("execute_result", data=data, execution_count=cell.get("execution_count"))]

    def _why_unasked(self, cell, number, nb) -> str:
        own = [other for other in nb.cells if number_of(other, "todo") == number]
        if not own:
            return f"The cell of TODO {number} is not in this notebook."
        for place, where in (("its own cell", own[0]), ("its check cell", cell)):
            for error in (output for output in where.get("outputs", ()) if output.output_type == "error"):
                said = " ".join(f"{error.ename}: {error.evalue}".split())[:160]
                return f"The check could not be run, because {place} ended with {said}."
        if self.task.stopped:
            return "The check was not reached, because the notebook was stopped before."
        return "The check was not asked for: in this notebook the name check no longer stands for the course's."
