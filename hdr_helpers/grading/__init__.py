"""The instructor's side of the course: the student edition is made from the notebooks by nbgrader's own tools.

course     where nbgrader finds what, notebooks staged for it, its interface
solutions  the TODOs of the source notebooks, and whether a file gives one away
release    the student edition, as a folder and a zip

No other part of the course imports this package, and the student edition comes without it.
"""
