"""Results carried from one notebook to the next, so that each notebook can also be opened first."""

from pathlib import Path

import numpy as np

RESULTS = Path("results")  # beside the notebooks, in the student's own folder


def keep(name: str, array) -> None:
    """Save a result of yours for the next notebooks, as results/NAME.npy."""
    RESULTS.mkdir(exist_ok=True)
    np.save(RESULTS / f"{name}.npy", array)
    print(f"Kept for the next notebooks: {RESULTS.name}/{name}.npy")


def carry(name: str, shape: tuple, otherwise):
    """Your own result of an earlier notebook, or what otherwise() computes where there is none.

    shape : what it must have; a result of another shape, or with values that are not finite, is not used
    """
    path = RESULTS / f"{name}.npy"
    if path.is_file():
        array = np.load(path)
        if array.shape == shape and np.all(np.isfinite(array)):
            print(f"Your own {name}, from an earlier notebook.")
            return array
        print(f"{path.name} can't be used (shape {array.shape}, expected {shape}, all finite).")
    print(f"The course's own {name}.")
    return otherwise()
