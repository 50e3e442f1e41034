"""Where nbgrader finds the course when it is started in this folder; it reads this file by itself.

First `python -m hdr_helpers.grading stage`, which lays the notebooks out in build/, then `nbgrader` as you like.
"""

from pathlib import Path

c = get_config()  # noqa: F821  nbgrader provides it
c.CourseDirectory.root = str(Path(__file__).parent / "build")
