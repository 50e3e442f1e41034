"""Is everything there that the course needs?"""

import sys
from importlib.metadata import PackageNotFoundError, version

from hdr_helpers.lab.data import DATA

PACKAGES = ("numpy", "scipy", "opencv-python-headless", "matplotlib", "jupyterlab", "nbval", "ipywidgets")


def check_environment() -> None:
    """Print a tick for everything the course needs, and for what is missing a cross and what to do."""
    rows = [
        (
            "Python 3.11 or newer",
            sys.version_info >= (3, 11),
            sys.version.split()[0],
            "install a newer Python",
        )
    ]
    for package in PACKAGES:
        try:
            rows.append((package, True, version(package), ""))
        except PackageNotFoundError:
            rows.append((package, False, "missing", "run: pip install -r environment.txt"))
    there = (DATA / "chapel" / "shutter.txt").is_file()
    rows.append(("data/chapel", there, "found" if there else "missing", "fetch the course folder again"))
    for name, fine, found, remedy in rows:
        print(f"{'✓' if fine else '✗'} {name:24} {found}{'' if fine else '  -> ' + remedy}")
