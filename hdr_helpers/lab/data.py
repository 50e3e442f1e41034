"""The brackets that the course brings along, and their truth."""

import io
import shutil
import tempfile
import zipfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from hdr_helpers.load import Bracket, BracketError, Truth, load_bracket
from hdr_helpers.merge import write_whole

DATA = Path(__file__).parents[2] / "data"


@cache
def handheld() -> Bracket:
    """The cloister, five JPEG photographs shot from the hand while two monks walk, with their truth.

    Each (512, 768, 3) uint8, from 1/3200 s to 1/30 s; read once. Raises BracketError where they are not there.

    >>> bool(handheld().truth.moved.any())
    True
    """
    return with_truth(load_bracket(DATA / "handheld"), DATA / "handheld")


@cache
def chapel() -> Bracket:
    """The chapel, nine JPEG photographs from 1/400 s to 4 s, shot by the virtual camera, with their truth.

    Each (512, 768, 3) uint8; read once. Raises BracketError where they are not there.

    >>> len(chapel()), chapel().times[[0, -1]].tolist()
    (9, [0.0025, 4.0])
    """
    return with_truth(load_bracket(DATA / "chapel"), DATA / "chapel")


def with_truth(bracket: Bracket, folder) -> Bracket:
    """The same bracket with the truth of folder/truth.npz, or as it is where there is no such file.

    bracket : Bracket; folder : path
    Raises BracketError where the file is not the truth of these photographs.

    >>> photographs = replace(chapel(), truth=None)
    >>> with_truth(photographs, DATA / "chapel").truth.crf.shape, with_truth(photographs, DATA).truth
    ((3, 256), None)
    """
    path = Path(folder) / "truth.npz"
    if not path.is_file():
        return bracket
    try:
        with np.load(path) as stored:
            radiance = (stored["radiance"].astype(np.float32) * stored["scale"]).astype(np.float32)
            truth = Truth(radiance, stored["crf"], stored.get("shifts"), stored.get("rotations"), stored.get("moved"))
    except (KeyError, ValueError) as problem:
        raise BracketError(f"{path} is not a truth file ({problem}); remove it, or make the bracket again.") from None
    if truth.radiance.shape != bracket.images[0].shape:
        raise BracketError(f"{path} is not the truth of these photographs: its size differs. Remove it.")
    return replace(bracket, truth=truth)


def what_loading_says(bracket_folder, times: dict) -> list[str]:
    """What load_bracket has to say of a folder's photographs if a list gave them other times.

    bracket_folder : path
    times : from file name to what the list holds
    Copies are loaded and thrown away; the folder stays as it is. Returns the notes, or what the error says.

    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for name in ("a.ppm", "b.ppm"):
    ...         _ = Path(folder, name).write_bytes(b"P6 4 3 255 " + bytes([100] * 36))
    ...     what_loading_says(folder, {"a.ppm": "1/60", "b.ppm": "soon"})[0].startswith("BracketError")
    True
    """
    with tempfile.TemporaryDirectory() as folder:
        for name in times:
            shutil.copy(Path(bracket_folder) / name, folder)
        lines = [f"{name} {time}" for name, time in times.items()]
        (Path(folder) / "times.txt").write_text("\n".join(lines), encoding="utf-8")
        try:
            return list(load_bracket(folder).notes)
        except BracketError as problem:
            return [f"BracketError: {problem}"]


def save_truth(folder, truth: Truth, scale: float) -> None:
    """Write folder/truth.npz: radiance / scale as float16, crf as float64, and what else of it is known.

    folder : path; truth : Truth; scale : as float16 ends at 65504, brighter scenes need one
    The same bytes everywhere, so neither np.savez, which writes the name of the system, nor a compressor,
    which would save a tenth and depends on its version.

    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_truth(folder, chapel().truth, scale=4)
    ...     again = with_truth(replace(chapel(), truth=None), folder).truth
    >>> bool(np.all(again.radiance == chapel().truth.radiance))
    True
    """
    half = (truth.radiance / scale).astype(np.float16)
    arrays = {"radiance": half, "scale": np.float32(scale), "crf": truth.crf}
    known = {"shifts": truth.shifts, "rotations": truth.rotations, "moved": truth.moved}
    arrays |= {name: array for name, array in known.items() if array is not None}
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, array in arrays.items():
            info, part = zipfile.ZipInfo(f"{name}.npy"), io.BytesIO()
            info.create_system = 3
            np.lib.format.write_array(part, np.asarray(array))
            archive.writestr(info, part.getvalue())
    write_whole(Path(folder) / "truth.npz", content.getvalue())
