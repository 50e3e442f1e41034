"""Tables say what was found, and what is doubtful and why."""

import numpy as np

from hdr_helpers.align import align_mtb
from hdr_helpers.lab import tables
from hdr_helpers.lab.brackets import CHAPEL_TIMES
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.scenes import chapel_scene


def test_motions_are_printed_with_how_sure_they_are_and_doubts_with_their_reason(capsys):
    bracket = Camera(seed=2).shoot(chapel_scene()[:250, :350], CHAPEL_TIMES[3:7], [(0, 0), (6, 1), (0, 0), (5, -3)])
    images = [*bracket.images[:3], np.random.default_rng(0).integers(0, 256, bracket.images[0].shape).astype(np.uint8)]
    found = align_mtb(images)
    answers = {"shifts": found.shifts, "truth": -bracket.truth.shifts}
    tables.print_motions(bracket.times, answers, found)
    head, *rows = capsys.readouterr().out.splitlines()
    assert head.split()[:3] == ["time", "shifts", "truth"]
    assert rows[1].startswith("  1/10 s    (-6, -1)   (-6, -1)   50, ")
    assert rows[2].endswith("the reference")
    assert "doubtful" in rows[3]
    assert f"{found.matches[3].agree} of {found.matches[3].blocks} blocks agree" in rows[3]
    tables.print_motions(bracket.times, {"turned": np.column_stack([found.shifts, found.rotations])}, found)
    assert "(-6.00, -1.00) +0.000°" in capsys.readouterr().out
