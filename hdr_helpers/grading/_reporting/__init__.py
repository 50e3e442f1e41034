"""Rooms behind grade: what an instructor and a student read afterwards."""
