"""The instructor's side of the course: the student edition out, submissions in, a table and a report out.

course      the notebooks staged for nbgrader, and its interface
solutions   the TODOs of the source notebooks, and whether a file gives one away
release     the student edition, as a folder and a zip
grade       a class graded: what is new is run, what was marked by hand stays
outcome     what grading found out, as plain data
gradebook   nbgrader's gradebook: points in, marks out
_intake     what a learning platform gives, brought in and put right
_running    a notebook in a sandbox, an examiner outside of it, jobs side by side
_reporting  the table, the report of the class, a page for each student

No other part of the course imports this package, and the student edition comes without it.
"""
