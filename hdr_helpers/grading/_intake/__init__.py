"""Rooms behind grade: what was handed in, brought in and put right."""
