"""Values as bytes and back, where a student's function runs in one process and is looked at in another.

Plain data only. What comes from a student's process is never unpickled, for unpickling runs code; whatever has no
plain form arrives as an empty object of a class with the same name, enough to be told what it is.
"""

import io
import json
import math
import pathlib

import numpy as np

DEPTH, NODES = 20, 500_000  # of a nest of lists; more is not plain data
HEAD = 32 * 2**20  # bytes of a message that are not arrays
ELEMENTS = 2**25  # of an array that is only described, or may be written out
PICTURES = 20  # axes in one message, and lines in one of them
SCALES = ("linear", "log", "symlog", "logit")


class WireError(ValueError):
    """The bytes are no message."""


def pack(message) -> bytes:
    """A nest of plain values, arrays and Figures as bytes: a line of JSON, then every array in .npy form."""
    arrays = []
    tree = _plain(message, arrays, [0])
    blobs = [_npy(array) for array in arrays]
    head = json.dumps({"tree": tree, "sizes": [len(blob) for blob in blobs]}).encode("utf-8")
    return b"".join([head, b"\n", *blobs])


def unpack(data: bytes):
    """The inverse of pack. Raises WireError where data is something else."""
    try:
        begin = data.index(b"\n", 0, HEAD) + 1
        facts, arrays = json.loads(data[:begin]), []
        for size in facts["sizes"]:
            arrays.append(_array_of(data[begin : begin + size]))
            begin += size
        return _Reader(arrays).built(facts["tree"])
    except Exception as problem:  # whatever a forged message can bring about
        raise WireError(f"no message ({type(problem).__name__}: {problem})"[:200]) from None


def _array_of(blob: bytes) -> np.ndarray:
    """The array of a .npy file. np.load would also open archives, and make room for whatever the header says."""
    content = io.BytesIO(blob)
    version = np.lib.format.read_magic(content)
    header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, by_columns, dtype = header(content)
    if dtype.hasobject or math.prod(shape) * dtype.itemsize != len(blob) - content.tell():
        raise WireError("an array that is not what its header says")
    if not dtype.itemsize:
        _few(shape)
    order = "F" if by_columns else "C"
    return np.ndarray(shape, dtype, blob, content.tell(), order=order).copy(order="K")


def _npy(array) -> bytes:
    content = io.BytesIO()
    np.save(content, array, allow_pickle=False)
    return content.getvalue()


def _plain(value, arrays, count, depth=0):
    """value as JSON can hold it, arrays put aside."""
    count[0] += 1
    if depth > DEPTH or count[0] > NODES:
        return ["odd", "nest"]

    def inner(part):
        return _plain(part, arrays, count, depth + 1)

    kind = type(value)
    if value is None or kind in (bool, float, str) or (kind is int and abs(value) < 2**63):
        return ["value", value]
    if kind in (np.ndarray, np.ma.MaskedArray, np.matrix) or isinstance(value, np.generic):
        return _array(value, arrays)
    if isinstance(value, dict):
        return ["dict", [[inner(key), inner(part)] for key, part in value.items()]]
    if isinstance(value, (list, tuple)):
        return ["list" if isinstance(value, list) else "tuple", [inner(part) for part in value]]
    if isinstance(value, pathlib.PurePath):
        return ["path", str(value)]
    if kind is complex:
        return ["complex", [value.real, value.imag]]
    return _from_a_library(value, inner) or ["odd", kind.__name__]


def _array(value, arrays):
    if value.dtype.hasobject:
        return ["objects", list(value.shape)]
    arrays.append(np.asarray(value))
    return ["scalar" if isinstance(value, np.generic) else type(value).__name__, len(arrays) - 1]


def _from_a_library(value, inner):
    """A sparse matrix or a part of a matplotlib picture; None for anything else."""
    package = type(value).__module__.split(".")[0]
    if package == "scipy" and hasattr(value, "tocoo"):
        entries = value.tocoo()
        return ["sparse", [inner(part) for part in (entries.data, entries.row, entries.col, tuple(value.shape))]]
    if package == "matplotlib":
        from matplotlib.axes import Axes
        from matplotlib.figure import Figure

        if isinstance(value, Figure):
            return ["figure", inner(_seen(value))]
        if isinstance(value, Axes):
            return ["axes", None]
    return None


def _seen(figure) -> dict:
    """What a check looks at in a Figure."""
    from matplotlib.colors import to_rgba

    axes = []
    for ax in figure.axes:
        lines = [
            (np.asarray(line.get_xdata()), np.asarray(line.get_ydata()), list(to_rgba(line.get_color())))
            for line in ax.lines
        ]
        names = {name: str(getattr(ax, f"get_{name}")()) for name in ("xlabel", "ylabel", "xscale", "yscale", "title")}
        axes.append(names | {"lines": lines, "texts": len(ax.texts), "legend": ax.get_legend() is not None})
    return {
        "axes": axes,
        "supxlabel": figure.get_supxlabel(),
        "supylabel": figure.get_supylabel(),
        "legends": len(figure.legends),
    }


class _Reader:
    """Makes the values that trees stand for, and no more of them than memory and patience allow."""

    def __init__(self, arrays):
        self.arrays, self.pictures, self.depth = arrays, 0, 0

    def built(self, tree):
        self.depth += 1
        if self.depth > 2 * DEPTH:
            raise WireError("a nest")
        value = self._built(*tree)
        self.depth -= 1
        return value

    def _built(self, kind, content):
        if kind == "value" and not isinstance(content, (list, dict)):
            return content
        if kind in ("list", "tuple"):
            return {"list": list, "tuple": tuple}[kind](map(self.built, content))
        if kind == "dict":
            return {self.built(key): self.built(part) for key, part in content}
        if kind == "path":
            return pathlib.Path(content)
        if kind == "complex":
            return complex(*content)
        if kind == "odd":
            return type(str(content)[:80], (), {})()
        if kind == "objects":
            return np.empty(_few(content), dtype=object)
        if kind == "scalar":
            return self.arrays[content][()]
        if kind == "sparse":
            from scipy.sparse import coo_array

            data, row, col, shape = map(self.built, content)
            return coo_array((data, (row, col)), shape=_few(shape))
        if kind == "figure":
            return self.drawn(self.built(content))
        if kind == "axes":
            return self.axes_in(None)
        return {"ndarray": np.asarray, "matrix": np.asmatrix, "MaskedArray": np.ma.asarray}[kind](self.arrays[content])

    def axes_in(self, figure):
        from matplotlib.figure import Figure

        self.pictures += 1
        if self.pictures > PICTURES:
            raise WireError("too many pictures")
        return (figure or Figure()).add_subplot()

    def drawn(self, seen: dict):
        """A Figure in which a check sees the same."""
        from matplotlib.figure import Figure

        figure = Figure()
        for facts in seen["axes"]:
            ax = self.axes_in(figure)
            for x, y, colour in facts["lines"][:PICTURES]:
                ax.plot(x, y, color=colour)
            scales = {name: facts[name] if facts[name] in SCALES else "symlog" for name in ("xscale", "yscale")}
            ax.set(**{name: facts[name] for name in ("xlabel", "ylabel", "title")}, **scales)
            for _ in range(min(facts["texts"], 10)):
                ax.text(0, 0, "text")
            if facts["legend"]:
                ax.legend(["line"])
        for name in ("supxlabel", "supylabel"):
            if seen[name]:
                getattr(figure, name)(seen[name])
        if seen["legends"]:
            figure.legend(["line"])
        return figure


def _few(shape) -> tuple:
    """A shape, or WireError where it has more elements than anybody should write out."""
    if not all(type(length) is int and length >= 0 for length in shape) or math.prod(shape) > ELEMENTS:
        raise WireError("a shape of too many elements")
    return tuple(shape)
