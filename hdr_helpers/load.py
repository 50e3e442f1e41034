"""Stage 1: read a bracket, the photographs of one scene at several exposure times.

How files are read, times are found and doubted, and borders are recognised is in the rooms of _reading/.
"""

from collections import Counter
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from hdr_helpers._reading import IMAGE_SUFFIXES, TEXT_SUFFIXES, BracketError
from hdr_helpers._reading.borders import find_borders
from hdr_helpers._reading.files import bracket_files, is_photograph, natural
from hdr_helpers._reading.pictures import decode
from hdr_helpers._reading.times import Times, find_times

__all__ = ["Bracket", "BracketError", "Truth", "in_8_bits", "load_bracket"]


@dataclass(frozen=True)
class Truth:
    """What a virtual camera knows about its own photographs.

    radiance : (H, W, 3) float32, relative linear radiance behind the lens, RGB
    crf : (3, 256) float64, log inverse response of each channel, crf[:, 128] = 0
    shifts : (P, 2), (dx, dy) pixels by which the hand moved each picture right and down, or None
    rotations : (P,) degrees by which it turned each counter-clockwise about its middle, before the shift, or None
    moved : (H, W) bool, True where in some photograph the scene was not as radiance has it, or None
    """

    radiance: np.ndarray
    crf: np.ndarray
    shifts: np.ndarray | None = None
    rotations: np.ndarray | None = None
    moved: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Bracket:
    """Photographs of one scene, shortest exposure first.

    images : tuple of P arrays (H, W, 3), RGB, all uint8 or all uint16
    times : (P,) float64, exposure times in seconds, strictly ascending; relative where notes say so
    names : tuple of P file names
    source : where the times came from, for people
    places : tuple of P strings, where each time is written, such as "shutter.txt, line 2"
    notes : sentences for people: what was decided or looked odd while loading
    valid : tuple of P arrays (H, W) bool, False where a pixel is no photograph (a border that an alignment
        left); None where all are
    truth : Truth where the camera was a virtual one, else None

    Raises BracketError where these do not fit each other.

    >>> images = [np.full((2, 3, 3), value, np.uint8) for value in (60, 120)]
    >>> bracket = Bracket(images, [0.1, 0.2], ("short.jpg", "long.jpg"))
    >>> (np.diff(bracket.log_times) / np.log(2)).round(6).tolist()  # twice the light is one stop
    [1.0]
    """

    images: tuple[np.ndarray, ...]
    times: np.ndarray
    names: tuple[str, ...]
    source: str = "given"
    places: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    valid: tuple[np.ndarray, ...] | None = None
    truth: Truth | None = None

    def __post_init__(self):
        times = np.array(self.times, dtype=np.float64)
        times.flags.writeable = False
        if not len(self.images) == len(times) == len(self.names):
            raise BracketError(
                f"{len(self.images)} images, {len(times)} times and {len(self.names)} names were given; "
                "there must be one of each for every exposure."
            )
        if len(times) < 2:
            raise BracketError("A bracket needs at least two photographs with different exposure times.")
        for name, image in zip(self.names, self.images, strict=True):
            if image.dtype not in (np.uint8, np.uint16) or image.shape[2:] != (3,):
                raise BracketError(
                    f"{name} is {image.dtype} {image.shape}; photographs are (H, W, 3), uint8 or uint16."
                )
        _check_alike(self.names, self.images)
        if not np.all(np.isfinite(times)) or times[0] <= 0 or np.any(np.diff(times) <= 0):
            raise BracketError(f"Exposure times must be positive and strictly ascending; got {times.tolist()} seconds.")
        if self.valid is not None:
            object.__setattr__(self, "valid", tuple(np.asarray(mask, dtype=bool) for mask in self.valid))
            if [mask.shape for mask in self.valid] != [image.shape[:2] for image in self.images]:
                raise BracketError(f"valid must hold one mask of {self.images[0].shape[:2]} for each photograph.")
        object.__setattr__(self, "times", times)

    def __len__(self):
        return len(self.images)

    @property
    def log_times(self) -> np.ndarray:
        """(P,) float64, natural logarithm of the times: B in the paper, ln seconds."""
        return np.log(self.times)

    def in_8_bits(self) -> "Bracket":
        """The same bracket with the upper 8 bits of each value, for what works on 256 levels."""
        return replace(self, images=tuple(map(in_8_bits, self.images)))


def in_8_bits(image) -> np.ndarray:
    """The upper 8 bits of a picture: uint8 as it is, uint16 from 0..65535 to 0..255 as uint8.

    image : array of any shape, uint8 or uint16

    >>> in_8_bits(np.array([0, 255, 256, 65535], np.uint16)).tolist()
    [0, 0, 1, 255]
    """
    return image if image.dtype == np.uint8 else (image >> 8).astype(np.uint8)


def load_bracket(path) -> Bracket:
    """Read every photograph of a folder or zip, with its exposure time.

    path : folder or .zip that holds the photographs (JPEG, PNG, TIFF, BMP or PPM; 8 or 16 bits), and perhaps a
        text file that lists their times

    Times come from the text file, the file names or EXIF, in this order of trust; where the photographs contradict
    one of them and bear out another, from that one. Where EXIF says that ISO or aperture change, times are
    exposures: t ISO / N^2.
    Returns a Bracket in ascending time; its notes say what was decided.
    Raises BracketError where the photographs or the times can't be used; nothing is loaded then.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:  # two grey walls, the longer exposure first
    ...     for name, value in ("wall_0.5.ppm", 120), ("wall_0.25.ppm", 90):
    ...         _ = Path(folder, name).write_bytes(b"P6 4 3 255 " + bytes([value] * 36))
    ...     load_bracket(folder).times.tolist()
    [0.25, 0.5]
    """
    try:
        path = Path(path).expanduser()
    except (TypeError, RuntimeError):
        raise BracketError(f"{path!r} is no path; give the folder or zip that holds the photographs.") from None
    try:
        return _load(path)
    except MemoryError:
        raise BracketError(
            f"The photographs of {path} do not fit into memory; scale them down, or take fewer."
        ) from None


def _load(path: Path) -> Bracket:
    files = bracket_files(path)
    names = sorted(filter(is_photograph, files), key=natural)
    if len(names) < 2:
        raise BracketError(
            f"{path} holds {len(names)} photograph{'s' * (len(names) != 1)}; a bracket needs at least two of "
            f"{', '.join(IMAGE_SUFFIXES)} in one folder. HEIC and raw files have to be exported as JPEG first."
        )
    texts = {n: files[n]() for n in sorted(files) if n.lower().endswith(TEXT_SUFFIXES)}
    photographs = [decode(name, files[name]()) for name in names]
    _check_alike(names, [p.image for p in photographs])
    images, deep = _all_bits([p.image for p in photographs])
    small = [in_8_bits(image) for image in images]

    find = partial(find_times, path, names, texts, [p.exif for p in photographs])
    times, masks = _times_and_borders(find, small, [p.opaque for p in photographs])
    order = np.argsort(times.seconds)
    names = tuple(names[i] for i in order)
    valid, borders = _valid(names, [masks[i] for i in order], small[0].shape[:2])
    return Bracket(
        images=tuple(images[i] for i in order),
        times=times.seconds[order],
        names=names,
        source=times.source,
        places=tuple(times.places[i] for i in order),
        notes=(*deep, *times.notes, *borders),
        valid=valid,
    )


def _times_and_borders(find, images, opaque) -> tuple[Times, list[np.ndarray | None]]:
    """Exposure times, and where each photograph is one, as find_borders gives it; both in the order of images.

    find : from histograms (P, 256) to Times
    A wrong time looks like a border, for light can't explain its photograph; and borders make right times look
    wrong. So where times are in doubt, borders are believed if without them the doubt is gone.
    """
    times = find(_histograms(images, opaque))
    masks = _borders(images, opaque, times)
    if not times.doubted or all(mask is None for mask in masks):
        return times, masks
    common = np.logical_and.reduce([mask for mask in masks if mask is not None])
    again = find(_histograms(images, [common] * len(images)))
    return (again, masks) if not again.doubted else (times, _borders(images, opaque, times, doubted=True))


def _borders(images, opaque, times, doubted=False) -> list[np.ndarray | None]:
    """find_borders for images in any order."""
    order = np.argsort(times.seconds)
    found = find_borders([images[i] for i in order], [opaque[i] for i in order], doubted)
    return [found[place] for place in np.argsort(order)]


def _histograms(images, masks) -> np.ndarray:
    """(P, 256) counts of the green values, the channel with the least noise, of about a million pixels each."""
    stride = max(1, int(np.sqrt(images[0][..., 1].size / 1e6)))
    few = np.s_[::stride, ::stride]
    values = [
        image[..., 1][few].ravel() if mask is None else image[..., 1][few][mask[few]]
        for image, mask in zip(images, masks, strict=True)
    ]
    return np.array([np.bincount(v, minlength=256) for v in values])


def _all_bits(images) -> tuple[list[np.ndarray], list[str]]:
    """The images with their values spread over all 16 bits, if they stand in the lowest ones; and a note then."""
    if images[0].dtype != np.uint16:
        return images, []
    bits = max(int(max(image.max() for image in images)).bit_length(), 8)
    if bits > 14:
        return images, []
    factor = 2 ** (16 - bits)
    note = f"The 16-bit files hold values of {bits} bits only, up to {2**bits - 1}; they were multiplied by {factor}."
    return [image * np.uint16(factor) for image in images], [note]


def _valid(names, masks, shape) -> tuple[tuple[np.ndarray, ...] | None, list[str]]:
    """Bracket.valid from masks, None where all of a photograph is one, and a note where there is something to say.

    Raises BracketError where no pixel is valid in all photographs.
    """
    marked = [name for name, mask in zip(names, masks, strict=True) if mask is not None]
    if not marked:
        return None, []
    everywhere = np.ones(shape, dtype=bool)
    masks = tuple(everywhere if mask is None else mask for mask in masks)
    share = 1 - np.logical_and.reduce(masks).mean()
    if share == 1:
        raise BracketError(
            f"No part of the frame is opaque in all photographs, {marked[0]} among them; a bracket shows one view, "
            "not the parts of a panorama."
        )
    which = f"{', '.join(marked[:3])}{f' and {len(marked) - 3} more' if len(marked) > 3 else ''}"
    edges = "an edge of one colour, or transparent, as an alignment leaves it, is not used"
    return masks, [f"{which}: {edges} ({share:.1%} of the frame)."]


def _check_alike(names, images) -> None:
    """Raise BracketError unless all images have one form, naming one that differs from most."""
    forms = [f"{i.shape[1]} x {i.shape[0]} pixels of {8 * i.itemsize} bits" for i in images]
    usual = Counter(forms).most_common(1)[0][0]
    for name, form in zip(names, forms, strict=True):
        if form != usual:
            raise BracketError(
                f"{name} is {form}, {names[forms.index(usual)]} is {usual}; "
                "take it out of the folder, or export all photographs with one size and depth."
            )
