"""How many submissions are graded in an hour, with one worker and with two: python tests/benchmarks/grade.py [STUDENTS]

All of them have all five notebooks, half solved and half empty. Needs the instructor extra.
"""

import shutil
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from filling import fill_in

from hdr_helpers.grading._running.sandbox import bubblewrap
from hdr_helpers.grading.grade import Options, grade
from hdr_helpers.grading.release import release


def main(students: int, workers: list[int]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        edition, _ = release(folder / "edition")
        empty = shutil.copytree(edition / "notebooks", folder / "empty")
        fill_in(edition)
        for k in range(students):
            shutil.copytree(empty if k % 2 else edition / "notebooks", folder / "in" / f"student{k:03}")
        for count in workers:
            began = time.perf_counter()
            options = Options(workers=count, sandboxed=bubblewrap() is not None)
            graded = grade(folder / "in", folder / f"out{count}", options, lambda sentence: None)
            took = time.perf_counter() - began
            points = sorted({sum(todo.points for todo in student.todos) for student in graded})
            print(
                f"{count} worker{'s' * (count > 1)}: {len(graded)} submissions in {took / 60:.1f} minutes, "
                f"{3600 * students / took:.0f} an hour; points {points}",
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 4, [int(word) for word in sys.argv[2:]] or [1, 2])
