"""What several test files share."""

import functools
import os
import tempfile
from importlib.util import find_spec
from pathlib import Path

# Small matrices on shared machines: several threads for each of them wait for each other. Set before numpy is there.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import cv2
import pytest

from hdr_helpers.grading.release import release
from hdr_helpers.lab import data
from hdr_helpers.lab.brackets import CHAPEL_TIMES
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.scenes import chapel_scene

if find_spec("nbgrader"):
    import nbgrader.api

    # For each new gradebook nbgrader starts a program to ask for this; here the answer is remembered.
    nbgrader.api.get_alembic_version = functools.cache(nbgrader.api.get_alembic_version)

# Notebooks under test keep their results away from a student's own; kernels inherit this.
os.environ["HDR_RESULTS"] = tempfile.mkdtemp(prefix="hdr_results_")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    """In notebooks of the source edition solutions have to pass every check; in tests a failed check is a result."""
    os.environ["HDR_CHECKS_MUST_PASS"] = str(int(item.path.suffix == ".ipynb"))


REAL = Path(__file__).parents[2] / "shared" / "brackets"


@pytest.fixture(scope="session")
def chapel():
    return data.chapel()


@pytest.fixture(scope="session")
def small_bracket():
    """A part of the chapel, 160 x 120 pixels, at 1/400, 1/60, 1/10, 0.6 and 4 seconds; with its truth."""
    return Camera(seed=3, jpeg_quality=None).shoot(chapel_scene()[100:220, 200:360], CHAPEL_TIMES[::2])


@pytest.fixture(scope="session")
def edition(tmp_path_factory):
    """The student edition of the course itself, made once: its folder and its zip."""
    return release(tmp_path_factory.mktemp("release") / "edition")


@pytest.fixture
def save(tmp_path, small_bracket):
    """save(names, texts) writes the small bracket, shortest first, under these names; returns the folder."""

    def save(names, texts=None, folder="photographs"):
        folder = tmp_path / folder
        folder.mkdir()
        for name, image in zip(names, small_bracket.images, strict=False):
            cv2.imwrite(str(folder / name), image[..., ::-1])
        for name, text in (texts or {}).items():
            (folder / name).write_text(text)
        return folder

    return save


@pytest.fixture
def real():
    """real(name) is the folder of a bracket shot with a real camera."""

    def real(name):
        if not (REAL / name).is_dir():
            pytest.skip(f"The real photographs of {name} are not part of this repository; {REAL} is absent.")
        return REAL / name

    return real
