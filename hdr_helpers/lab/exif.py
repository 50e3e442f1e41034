"""EXIF for the virtual camera's photographs: the few entries that say how they were exposed."""

import struct

EXPOSURE_TIME, F_NUMBER, ISO, EXIF_DIRECTORY = 0x829A, 0x829D, 0x8827, 0x8769
SHORT, LONG, RATIONAL = 3, 4, 5


def exif_block(order="<", seconds=None, iso=None, f_number=None) -> bytes:
    """A TIFF header, a pointer, and an Exif directory with ExposureTime, FNumber and ISO, where given.

    order : "<" or ">", least or most significant byte first
    seconds, f_number : (numerator, denominator); iso : integer
    """
    mark = {"<": b"II", ">": b"MM"}[order]
    given = [(EXPOSURE_TIME, seconds), (F_NUMBER, f_number), (ISO, iso)]
    given = [(tag, value) for tag, value in given if value is not None]
    end = 26 + 2 + 12 * len(given) + 4
    directory, fractions = struct.pack(order + "H", len(given)), b""
    for tag, value in given:
        if isinstance(value, tuple):
            directory += struct.pack(order + "HHII", tag, RATIONAL, 1, end + len(fractions))
            fractions += struct.pack(order + "II", *value)
        else:
            directory += struct.pack(order + "HHIHH", tag, SHORT, 1, value, 0)
    first = struct.pack(order + "HHHIII", 1, EXIF_DIRECTORY, LONG, 1, 26, 0)
    return mark + struct.pack(order + "HI", 42, 8) + first + directory + bytes(4) + fractions
