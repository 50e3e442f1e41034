"""Rooms behind merge.py: what the bracket itself says of its noise, and adding up by tables."""
