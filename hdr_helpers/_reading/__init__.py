"""The rooms behind load.py: how a bracket is found on disk, read, timed and doubted.

files     a folder or zip      ->  the photographs and text files in it, as bytes
pictures  bytes                ->  an upright RGB picture, where it is opaque, and its EXIF
lists     a text file          ->  the numbers written there for each photograph
names     file names           ->  the same
times     all of these         ->  exposure times, where each came from, notes on what was decided
evidence  pixels and times     ->  which times the photographs contradict
borders   pixels               ->  which pixels are no photograph: borders left by an alignment
"""

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".ppm")
TEXT_SUFFIXES = (".txt", ".csv", ".json")


class BracketError(ValueError):
    """A bracket can't be used. The message names the file or value and what would be accepted."""
