"""Sentences about what a function returned: its type, shape, dtype, and values that are no numbers."""

import numpy as np

from hdr_helpers.lab.checks._running import Wrong

KINDS = {"f": "floats", "iu": "integers", "b": "booleans", "fiu": "numbers"}


def described(value) -> str:
    """A value in two or three words."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} of shape {value.shape}"
    if isinstance(value, (tuple, list)):
        return f"a {type(value).__name__} of {len(value)}"
    return f"a {type(value).__name__}"


def something(value, what: str):
    """Raise Wrong for None."""
    if value is None:
        raise Wrong(f"It returns None where {what} should come; is there a return at the end?")


def array(value, what: str, shape=None, kinds: str = "f") -> np.ndarray:
    """The value, or Wrong where it is not an array of this shape with elements of these kinds.

    what : "g", "A": what the sentence calls it; kinds : a key of KINDS
    """
    something(value, what)
    if not isinstance(value, np.ndarray):
        raise Wrong(f"{what} is {described(value)}; it should be a NumPy array of shape {shape}.")
    if shape is not None and value.shape != shape:
        turned = value.shape == shape[::-1] and len(shape) > 1
        raise Wrong(f"{what} has shape {value.shape}; it should have {shape}{', so it is transposed' * turned}.")
    if value.dtype.kind not in kinds:
        raise Wrong(f"{what} holds {value.dtype}; it should hold {KINDS[kinds]}{_why(value, kinds)}.")
    return value


def _why(value, kinds) -> str:
    if kinds == "f" and value.dtype.kind in "iu":
        return ", for an integer array cuts off everything behind the point"
    if kinds == "iu" and value.dtype.kind == "f":
        return ", for they are pixel values, and index tables"
    return ""


def finite(value, what: str) -> None:
    """Raise Wrong where some values are NaN or infinite."""
    bad = int(np.sum(~np.isfinite(value)))
    if bad:
        kind = "NaN" if np.isnan(value).any() else "infinite"
        raise Wrong(f"{bad} of the {np.size(value)} values of {what} are {kind}; every one has to be a finite number.")


def number(value, what: str) -> float:
    """The value as a float, or Wrong where it is no single finite number."""
    something(value, what)
    if isinstance(value, (str, bytes)):
        raise Wrong(f"{what} is the text {str(value)!r}; it should be a number.")
    if not isinstance(value, (int, float, np.number)) and not (isinstance(value, np.ndarray) and value.ndim == 0):
        raise Wrong(f"{what} is {described(value)}; it should be a single number.")
    if not np.isfinite(float(value)):
        raise Wrong(f"{what} is {float(value)}, which is no number to go on with.")
    return float(value)


def several(value, count: int, what: str):
    """The value, or Wrong where it is not a tuple or list of count things."""
    something(value, what)
    if not isinstance(value, (tuple, list)) or len(value) != count:
        raise Wrong(f"It returns {described(value)}; it should return {what}, {count} things.")
    return value


def recognised(yours, suspects: dict, otherwise: str, tolerance: float = 1e-6) -> str:
    """The sentence of the first suspect whose value is yours, else the other sentence.

    suspects : from a sentence to what a known mistake gives, an array or a number; None where it can't be said
    """
    for sentence, value in suspects.items():
        if value is not None and close(yours, value, tolerance):
            return sentence
    return otherwise


def close(yours, spec, tolerance: float = 1e-6) -> bool:
    """Whether two arrays agree within tolerance, relative to the larger of 1 and the size of what is expected."""
    yours, spec = np.asarray(yours, dtype=np.float64), np.asarray(spec, dtype=np.float64)
    if yours.shape != spec.shape:
        return False
    with np.errstate(all="ignore"):
        return bool(np.allclose(yours, spec, rtol=tolerance, atol=tolerance, equal_nan=True))
