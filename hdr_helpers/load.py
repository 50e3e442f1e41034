"""Stage 1: read a bracket, the photographs of one scene at several exposure times.

How files are read, times are found and doubted, and borders are recognised is in the rooms of _reading/.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hdr_helpers._reading import IMAGE_SUFFIXES, TEXT_SUFFIXES, BracketError
from hdr_helpers._reading.borders import find_borders
from hdr_helpers._reading.files import bracket_files, is_photograph, natural
from hdr_helpers._reading.pictures import decode
from hdr_helpers._reading.times import find_times

__all__ = ["Bracket", "BracketError", "Truth", "in_8_bits", "load_bracket"]


@dataclass(frozen=True)
class Truth:
    """What a virtual camera knows about its own photographs.

    radiance : (H, W, 3) float32, relative linear radiance behind the lens, RGB
    crf : (3, 256) float64, log inverse response of each channel, crf[:, 128] = 0
    shifts : (P, 2) int, (dx, dy) pixels by which the hand moved each picture right and down, or None
    """

    radiance: np.ndarray
    crf: np.ndarray
    shifts: np.ndarray | None = None


@dataclass(frozen=True)
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
        times = np.asarray(self.times, dtype=np.float64)
        if not len(self.images) == len(times) == len(self.names):
            raise BracketError(
                f"{len(self.images)} images, {len(times)} times and {len(self.names)} names were given; "
                "there must be one of each for every exposure."
            )
        if len(times) < 2:
            raise BracketError("A bracket needs at least two photographs with different exposure times.")
        for name, image in zip(self.names, self.images, strict=True):
            _check_alike(name, image, self.names[0], self.images[0])
        if not np.all(np.isfinite(times)) or times[0] <= 0 or np.any(np.diff(times) <= 0):
            raise BracketError(f"Exposure times must be positive and strictly ascending; got {times.tolist()} seconds.")
        shapes = [mask.shape for mask in self.valid] if self.valid is not None else []
        if shapes and shapes != [image.shape[:2] for image in self.images]:
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
    """The upper 8 bits of a picture: uint8 as it is, uint16 from 0..65535 to 0..255 as uint8."""
    return image if image.dtype == np.uint8 else (image >> 8).astype(np.uint8)


def load_bracket(path) -> Bracket:
    """Read every photograph of a folder or zip, with its exposure time.

    path : folder or .zip that holds the photographs (JPEG, PNG, TIFF, BMP or PPM; 8 or 16 bits) and, if the
        times are neither in the file names nor in EXIF, one text file that lists them

    Returns a Bracket in ascending time; its notes say what was decided. Where EXIF says that ISO or aperture
    change, times are exposures: t ISO / N^2.
    Raises BracketError where the photographs or the times can't be used; nothing is loaded then.
    """
    path = Path(path)
    files = bracket_files(path)
    names = sorted(filter(is_photograph, files), key=natural)
    if len(names) < 2:
        raise BracketError(
            f"{path} holds {len(names)} photograph{'s' * (len(names) != 1)}; a bracket needs at least two of "
            f"{', '.join(IMAGE_SUFFIXES)} in one folder. HEIC and raw files have to be exported as JPEG first."
        )
    texts = {n: files[n]() for n in sorted(files) if n.lower().endswith(TEXT_SUFFIXES)}
    try:
        photographs = []
        for name in names:
            photographs.append(decode(name, files[name]()))
            _check_alike(name, photographs[-1].image, names[0], photographs[0].image)
        small = [in_8_bits(p.image) for p in photographs]
    except MemoryError:
        raise BracketError(
            f"The {len(names)} photographs in {path} do not fit into memory; scale them down, or take fewer."
        ) from None

    times = find_times(path, names, texts, [p.exif for p in photographs], np.array([_histogram(i) for i in small]))
    order = np.argsort(times.seconds)
    valid, borders = _valid([small[i] for i in order], [photographs[i].opaque for i in order])
    return Bracket(
        images=tuple(photographs[i].image for i in order),
        times=times.seconds[order],
        names=tuple(names[i] for i in order),
        source=times.source,
        places=tuple(times.places[i] for i in order),
        notes=(*times.notes, *borders),
        valid=valid,
    )


def _histogram(image) -> np.ndarray:
    """(256,) counts of the green values, the channel with the least noise, of about a million pixels."""
    stride = max(1, int(np.sqrt(image[..., 1].size / 1e6)))
    return np.bincount(image[::stride, ::stride, 1].ravel(), minlength=256)


def _valid(images, opaque) -> tuple[tuple[np.ndarray, ...] | None, list[str]]:
    """Bracket.valid from borders and transparency, and a note where there is something to say."""
    masks = find_borders(images, opaque)
    marked = sum(mask is not None for mask in masks)
    if not marked:
        return None, []
    everywhere = np.ones(images[0].shape[:2], dtype=bool)
    masks = tuple(everywhere if mask is None else mask for mask in masks)
    share = 1 - np.logical_and.reduce(masks).mean()
    return masks, [
        f"{marked} of {len(masks)} photographs have borders that are no photograph, {share:.1%} of the frame "
        "altogether; they are left out."
    ]


def _check_alike(name, image, first_name, first) -> None:
    if image.shape != first.shape or image.dtype != first.dtype:
        raise BracketError(
            f"{name} is {_form(image)}, {first_name} is {_form(first)}; "
            "all photographs of a bracket must have the same size and depth."
        )


def _form(image: np.ndarray) -> str:
    return f"{image.shape[1]} x {image.shape[0]} pixels of {8 * image.itemsize} bits"
