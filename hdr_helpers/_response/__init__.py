"""Rooms behind crf.py: which pixel values can be trusted, and how much; when a pixel is clipped."""

LEVELS = 256
MIDDLE = 128  # g[MIDDLE] = 0 fixes the gauge: equation 3 leaves g free up to a constant
