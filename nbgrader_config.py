"""Where nbgrader finds the course when it is started in this folder; it reads this file by itself.

First `python -m hdr_helpers.grading stage`, which lays the notebooks out in build/, then `nbgrader` as you like.
"""

from hdr_helpers.grading.course import configure

configure(get_config())  # noqa: F821  nbgrader provides it
