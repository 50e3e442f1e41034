"""Is everything there that the course needs? Imports nothing of it, so that it can say what is missing."""

import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

CHAPEL = Path(__file__).parents[2] / "data" / "chapel"
PACKAGES = ("numpy", "scipy", "opencv-python-headless", "matplotlib", "jupyterlab", "nbval", "ipywidgets")
COURSE = "hdr-helpers"


def check_environment() -> None:
    """Print a tick for everything the course needs, and for what is missing a cross and what to do."""
    rows = [
        (
            "Python 3.11 or newer",
            sys.version_info >= (3, 11),
            sys.version.split()[0],
            "install a newer Python, then make the environment again",
        )
    ]
    for package in (*PACKAGES, COURSE):
        try:
            rows.append((package, True, version(package), ""))
        except PackageNotFoundError:
            rows.append((package, False, "missing", "python -m pip install -r environment.txt"))
    there = (CHAPEL / "shutter.txt").is_file()
    rows.append(("data/chapel", there, "found" if there else "missing", "fetch the course folder again"))
    for name, fine, found, remedy in rows:
        print(f"{'✓' if fine else '✗'} {name:24} {found}{'' if fine else '  -> ' + remedy}")
