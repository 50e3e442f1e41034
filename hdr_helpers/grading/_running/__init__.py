"""Rooms behind grade: running what was handed in, each notebook in a kernel of its own, and looking at it."""
