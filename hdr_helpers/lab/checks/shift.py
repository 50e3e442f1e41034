"""Check of TODO 2.3, the search for the shift at which two frames' bitmaps disagree least."""

import numpy as np
from scipy.ndimage import gaussian_filter

from hdr_helpers.lab.checks._running import Wrong
from hdr_helpers.lab.checks._todos import Todo
from hdr_helpers.lab.checks._words import number, several
from hdr_helpers.lab.checks.align import course_bitmaps, course_disagreement


def _overlap(fixed, moving, shift):
    (height, width), (dx, dy) = fixed.shape, shift
    here = fixed[max(dy, 0) : height + min(dy, 0), max(dx, 0) : width + min(dx, 0)]
    there = moving[max(-dy, 0) : height + min(-dy, 0), max(-dx, 0) : width + min(-dx, 0)]
    return here, there


def _score(fixed, moving, shift):
    (bright_a, bright_b), (clear_a, clear_b) = (_overlap(a, b, shift) for a, b in zip(fixed, moving, strict=True))
    return course_disagreement(bright_a, clear_a, bright_b, clear_b)


NEIGHBOURS = [(dx, dy) for dx in (0, -1, 1) for dy in (0, 1, -1)]


def _course_best_shift(fixed, moving, start=(0, 0)):
    near = [(start[0] + dx, start[1] + dy) for dx, dy in NEIGHBOURS]
    return min(near, key=lambda shift: _score(fixed, moving, shift))


best_shift = Todo(
    "2.3",
    "best_shift",
    _course_best_shift,
    uses=("disagreement",),
    barred=("align",),
    hints=(
        "How many shifts are to be tried, and around which one: around (0, 0), or around start?",
        "Of both frames two arrays have to be cut, so that four arrays lie on each other. Which helper does it?",
        "When you find a better shift, which two things have to be kept?",
        "A sign that is turned round, or x taken for y: which picture would tell them apart?",
    ),
    praise="It finds its way. The pyramid below calls it at every level: how far does it get from one pixel a step?",
)


def _frames(trial, key, shift):
    """Bitmaps of one scene twice: the second has to go by shift to lie on the first."""
    scene = gaussian_filter(trial.rng(23, key).standard_normal((70, 83)), 1.2)
    levels = np.uint8(255 * (scene - scene.min()) / np.ptp(scene))
    top, left = 10 + shift[1], 10 + shift[0]
    fixed, moving = levels[10:-10, 10:-10], levels[top : top + 50, left : left + 63]
    return course_bitmaps(fixed), course_bitmaps(moving)


def _pair(value) -> tuple[int, int]:
    value = several(tuple(value) if isinstance(value, np.ndarray) else value, 2, "(dx, dy)")
    return tuple(int(number(v, "A shift")) for v in value)


@best_shift.part(1, "It returns a pair (dx, dy), (0, 0) for a frame with itself.")
def _(trial):
    found = _pair(trial.run(*_frames(trial, 1, (0, 0))))
    if found == (1, 1):
        raise Wrong(
            "A frame with itself gives (1, 1), the shift tried last: does the best one change although nothing better "
            "came, or is it the same list as the one being tried?"
        )
    if found != (0, 0):
        raise Wrong(f"A frame with itself gives {found}; it should be (0, 0).")


@best_shift.part(1, "It finds every neighbour of (0, 0).")
def _(trial):
    for key, shift in enumerate(((1, 0), (-1, 1), (0, -1), (1, -1))):
        found = _pair(trial.run(*_frames(trial, 2 + key, shift)))
        trial.compare(f"shift of {shift}", np.array(found), np.array(shift))
        _right_shift(found, shift)


def _right_shift(found, shift):
    if found == shift:
        return
    dx, dy = shift
    sentences = {
        (-dx, -dy): "The sign is turned round: the shift says by how much the second picture has to move.",
        (dy, dx): "x and y are swapped: a shift is (dx, dy), right and down, but an array is indexed [row, column].",
        (-dy, -dx): "x and y are swapped, and the sign is turned round.",
    }
    raise Wrong(
        f"A known shift of {shift} came out as {found}. {sentences.get(found, 'It is another one.')}".replace(
            ". ", ": ", 1
        )
    )


@best_shift.part(1, "It looks around start.")
def _(trial):
    for key, (start, shift) in enumerate((((4, -3), (5, -3)), ((-2, 5), (-3, 4)))):
        found = _pair(trial.run(*_frames(trial, 8 + key, shift), start))
        trial.compare(f"shift from {start}", np.array(found), np.array(shift))
        step = (shift[0] - start[0], shift[1] - start[1])
        if found == step:
            raise Wrong(f"From start {start} it gives {found}: that is the step from start; give the whole shift.")
        if max(map(abs, found)) <= 1:
            raise Wrong(f"From start {start} it gives {found}, a neighbour of (0, 0): it does not look around start.")
        _right_shift(found, shift)


@best_shift.part(1, "What lies outside of one frame has no say.")
def _(trial):
    # All clear pixels on the left are dark and all on the right bright; what tells the shift is little, in between.
    rng, shift = trial.rng(24), (1, 0)
    bright, clear = np.zeros((40, 61), bool), np.ones((40, 61), bool)
    bright[:, 30:] = True
    clear[:, 8:52] = False
    for top, left in ((4, 12), (16, 24), (28, 38)):
        patch = np.s_[top : top + 4, left : left + 5]
        clear[patch], bright[patch] = True, rng.random((4, 5)) < 0.5
    fixed, moving = (bright[:, :-1], clear[:, :-1]), (bright[:, 1:], clear[:, 1:])
    found = _pair(trial.run(fixed, moving))
    if found != shift:
        raise Wrong(
            f"Where left and right edge differ, a shift of {shift} came out as {found}: np.roll brings in the opposite "
            "edge, and it is compared as if it belonged there."
        )
