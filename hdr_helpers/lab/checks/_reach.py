"""Keep the course's and OpenCV's own answers out of reach while a student's function runs.

Names are replaced wherever they stand: in the modules of hdr_helpers, in cv2 and among the notebook's own names. So a
function that calls one of them is told so in a sentence, even where it swallows the exception.
"""

import importlib
import sys
from contextlib import ExitStack, contextmanager
from functools import wraps
from inspect import unwrap

ANSWERS = {
    "load": ("hdr_helpers.load:load_bracket", "hdr_helpers._reading.pictures:decode"),
    "align": (
        "hdr_helpers.align:align_mtb",
        "hdr_helpers.align:bitmaps",
        "hdr_helpers.papers.ward2003:disagreement",
        "hdr_helpers.papers.ward2003:one_level_finer",
        "hdr_helpers.papers.ward2003:likely_shifts",
        "cv2:createAlignMTB",
    ),
    "crf": (
        "hdr_helpers.crf:gsolve",
        "hdr_helpers.crf:recover_crf",
        "hdr_helpers.crf:crf_opencv",
        "hdr_helpers.crf:hat_weights",
        "hdr_helpers.crf:fitted_weights",
        "hdr_helpers.crf:_solve_reduced",
        "cv2:createCalibrateDebevec",
        "cv2:createCalibrateRobertson",
    ),
    "merge": (
        "hdr_helpers.merge:merge_debevec",
        "hdr_helpers.merge:merge_opencv",
        "hdr_helpers._merging.tables:mean_by_tables",
        "cv2:createMergeDebevec",
        "cv2:createMergeRobertson",
        "cv2:createMergeMertens",
    ),
    "opencv_tonemap": (
        "cv2:createTonemap",
        "cv2:createTonemapReinhard",
        "cv2:createTonemapDrago",
        "cv2:createTonemapMantiuk",
    ),
    "tonemap": (
        "hdr_helpers.tonemap:tonemap",
        "hdr_helpers.tonemap:tonemap_reinhard",
        "hdr_helpers.papers.reinhard2002:tonemap_reinhard_global",
        "hdr_helpers.papers.reinhard2002:log_average",
        "hdr_helpers.papers.reinhard2002:compress",
    ),
}


class OutOfReach(Exception):
    """Raised by a name that is out of reach."""


class Reach:
    """What a student's function may use while it runs.

    called : names that were called although they are out of reach
    """

    active = None  # the Reach of the function that runs now

    def __init__(self):
        self.called, self.helping = [], 0

    def barred(self, name, original):
        """original, but noted and refused unless the course itself is at work."""

        @wraps(original)
        def call(*args, **keywords):
            if self.helping:
                return original(*args, **keywords)
            self.called.append(name)
            raise OutOfReach(f"{name} is out of reach in here")

        return call

    def helper(self, original):
        """original, with everything in its reach: a function of an earlier TODO, lent by the course."""

        @wraps(original)
        def call(*args, **keywords):
            self.helping += 1
            try:
                return original(*args, **keywords)
            finally:
                self.helping -= 1

        return call


@contextmanager
def out_of_reach(function, groups, lent):
    """Within: the ANSWERS of groups refuse to work, and function finds the functions lent under their names.

    groups : names in ANSWERS; lent : dict from a name to the function that stands for it
    Gives the Reach.
    """
    reach = Reach()
    own = getattr(unwrap(function), "__globals__", {})
    modules = [vars(m) for name, m in list(sys.modules.items()) if name.split(".")[0] == "hdr_helpers" and m]
    with ExitStack() as stack:
        for answer in (answer for group in groups for answer in ANSWERS[group]):
            module, name = answer.split(":")
            original = getattr(importlib.import_module(module), name, None)
            if original is None:
                continue
            stand_in = reach.barred(name, original)
            for names in (*modules, vars(sys.modules[module]), own):
                for found in [key for key, value in list(names.items()) if value is original]:
                    stack.enter_context(_put(names, found, stand_in))
        for name, original in lent.items():
            stack.enter_context(_put(own, name, reach.helper(original)))
        before, Reach.active = Reach.active, reach
        try:
            yield reach
        finally:
            Reach.active = before


@contextmanager
def _put(names, name, value):
    """names[name] = value, until the end."""
    missing = object()
    before = names.get(name, missing)
    names[name] = value
    try:
        yield
    finally:
        if before is missing:
            names.pop(name, None)
        else:
            names[name] = before
