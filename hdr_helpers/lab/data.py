"""The brackets that the course brings along, and their truth."""

import io
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from hdr_helpers.load import Bracket, Truth, load_bracket
from hdr_helpers.merge import write_whole

DATA = Path(__file__).parents[2] / "data"


@cache
def chapel() -> Bracket:
    """The chapel, nine JPEG photographs from 1/400 s to 4 s, shot by the virtual camera, with their truth."""
    return with_truth(load_bracket(DATA / "chapel"), DATA / "chapel")


def with_truth(bracket: Bracket, folder) -> Bracket:
    """The same bracket with the truth of folder/truth.npz, or as it is where there is no such file."""
    path = Path(folder) / "truth.npz"
    if not path.is_file():
        return bracket
    with np.load(path) as stored:
        radiance = stored["radiance"].astype(np.float32) * stored["scale"]
        return replace(bracket, truth=Truth(radiance.astype(np.float32), stored["crf"]))


def save_truth(folder, truth: Truth, scale: float) -> None:
    """Write folder/truth.npz: radiance / scale as float16, and the crf, float64.

    Not compressed: that saves a tenth, and what a compressor writes depends on its version.
    """
    content = io.BytesIO()
    half = (truth.radiance / scale).astype(np.float16)
    np.savez(content, radiance=half, scale=np.float32(scale), crf=truth.crf)
    write_whole(Path(folder) / "truth.npz", content.getvalue())
