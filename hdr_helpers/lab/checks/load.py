"""Checks of notebook 1: times from a list, a time from a name, and photographs in order."""

import re
import tempfile
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np

from hdr_helpers.lab.checks._running import Wrong
from hdr_helpers.lab.checks._todos import Todo
from hdr_helpers.lab.checks._words import array, number, several, something


def _course_read_times(text):
    found = re.findall(r"^[ \t]*([^#\s].*?)[ \t]+(\S+)[ \t]*$", text, re.MULTILINE)
    return {name: float(Fraction(time)) for name, time in found}


read_times = Todo(
    "1.1",
    "read_times",
    _course_read_times,
    hints=(
        "Take one line, such as my house 3.jpg 1/60: which of its words is the time, counted from which end?",
        "float('1/60') raises. What would you do with 1/60 on paper, and what changes for 2.5, which has no stroke?",
        "Which two kinds of line have to be passed over before you look for a time?",
        "A text can be split once, from the right; and a part that is missing can stand for 1. What is left to divide?",
    ),
    praise="Well read. Now look at the names: for which of your own photographs would a list be missing?",
)


def _times(trial, text, expected):
    """What the student reads from a text, compared with what is expected, name by name."""
    found = trial.run(text)
    something(found, "a dictionary")
    if not isinstance(found, dict):
        raise Wrong(f"It returns a {type(found).__name__}; it should return a dictionary from file name to seconds.")
    if set(found) == set(expected.values()) or any(isinstance(key, (int, float)) for key in found):
        raise Wrong("The keys are times; in this dictionary a file name leads to a time, not a time to a name.")
    return found


def _seconds(trial, found, expected):
    for name, time in expected.items():
        if name not in found:
            raise Wrong(f"{name!r} is not among the names found ({', '.join(map(repr, list(found)[:4]))}).")
        got = number(found[name], f"The time of {name}")
        trial.compare(f"seconds of {name}", got, time)
        if abs(got - time) > 1e-9 * max(time, 1):
            raise Wrong(_about_time(name, got, time))


def _about_time(name, got, time) -> str:
    if abs(got * time - 1) < 1e-6:
        return f"{name} came out as {got:g}: that is one over the time; 1/60 s is less than a second."
    if abs(got - 1000 * time) < 1e-6 * got:
        return f"{name} came out in milliseconds ({got:g}); all times of this course are seconds."
    if got == int(time):
        return f"{name} came out as {got:g} where {time:g} s is right: what stands behind the point was cut off."
    if abs(got - np.log(time)) < 1e-6 or abs(got - np.log2(time)) < 1e-6:
        return f"{name} came out as a logarithm ({got:g}); the logarithm is taken later, in notebook 3."
    return f"{name} came out as {got:g}, and {time:g} s is right."


@read_times.part(1, "Decimal numbers are read, and names lead to seconds.")
def _(trial):
    values = trial.rng(1).choice([0.25, 0.5, 1.6, 2.5, 4.0, 15.0], 3, replace=False)
    expected = {f"img_{k}.jpg": float(v) for k, v in enumerate(values)}
    text = "\n".join(f"{name} {time:g}" for name, time in expected.items())
    _seconds(trial, _times(trial, text, expected), expected)


@read_times.part(1, "Fractions such as 1/400 are read as well.")
def _(trial):
    below = trial.rng(2).choice([15, 60, 125, 250, 400, 1000], 3, replace=False)
    expected = {f"IMG_{n}.png": 1 / n for n in below.tolist()} | {"long.jpg": 1.5}
    text = "".join(f"IMG_{n}.png 1/{n}\n" for n in below) + "long.jpg 3/2\n"
    _seconds(trial, _times(trial, text, expected), expected)


@read_times.part(1, "Comments and empty lines are passed over, and names may hold blanks.")
def _(trial):
    n = int(trial.rng(3).integers(20, 90))
    text = f"# photographs of May 9\n\nmy house 3.jpg 1/{n}\n   \n# made on Sunday 12\nroof.JPG   2.5  \n"
    expected = {"my house 3.jpg": 1 / n, "roof.JPG": 2.5}
    found = _times(trial, text, expected)
    more = [str(name) for name in found if name not in expected]
    if any(name.startswith("#") for name in more):
        raise Wrong("A line that starts with # is a comment, and it was read as a photograph.")
    if any(name in ("my", "house", "my house") for name in more):
        raise Wrong("The name my house 3.jpg was cut at a blank; only the last word of a line is the time.")
    _seconds(trial, found, expected)
    if more:
        raise Wrong(f"Besides the photographs it found {more[0]!r}, which is none.")


time_from_name = Todo(
    "1.2",
    "time_from_name",
    lambda name: float(re.search(r"_(\d+(?:\.\d+)?)\.[^.]*$", name)[1]),
    hints=(
        "img_0.033.jpg has two points. Which of them ends the name?",
        "A name may hold more than one _: which of them stands before the time?",
        "Path(name).stem takes off what is behind the last point. What is left to cut, and at which _?",
    ),
    praise="Right. Sort the names by it, and compare with sorted().",
)


@time_from_name.part(1, "img_0.25.jpg was exposed for 0.25 s, as a number.")
def _(trial):
    times = trial.rng(1).choice([0.033, 0.25, 2.5, 0.8], 2, replace=False)
    _names(trial, [(f"img_{time:g}.jpg", float(time)) for time in (*times, 15.0)])


@time_from_name.part(1, "Other names and endings are read as well.")
def _(trial):
    a, b = trial.rng(2).integers(1, 9, 2)
    _names(
        trial, [(f"old_town_{a}.{b}.jpeg", a + b / 10), (f"x_0.0{b}.PNG", b / 100), (f"window_{10 * a}.png", 10.0 * a)]
    )


def _names(trial, names):
    for name, time in names:
        got = number(trial.run(name), f"What comes back for {name}")
        trial.compare(f"seconds of {name}", got, time)
        if abs(got - time) > 1e-9 * time:
            raise Wrong(_about_time(name, got, time))


def _course_load(folder, times):
    order = np.argsort(list(times.values()))
    names = np.array(list(times))[order]
    bgr = [cv2.imdecode(np.frombuffer((Path(folder) / n).read_bytes(), np.uint8), cv2.IMREAD_COLOR) for n in names]
    return [np.ascontiguousarray(image[:, :, ::-1]) for image in bgr], np.array([float(times[n]) for n in names])


load_in_order = Todo(
    "1.3",
    "load_in_order",
    _course_load,
    barred=("load",),
    hints=(
        "What do you sort: names, times, or names by their times? What keeps a photograph and its time together?",
        "sorted() takes a key: a function that says by what. What gives the time of a name?",
        "In which order does OpenCV hand over red, green and blue? How would you see it in the picture of the carpet?",
        "Is every file of the folder a photograph? Which names are worth opening?",
    ),
    praise="In order and in the right colours. Next: what happens when the list itself is wrong?",
)

NAMES = ("img_15.png", "img_2.png", "img_1.png", "img_10.png", "a 3.png")  # no order of names is the order of times


def _sorted_somehow(times) -> bool:
    """Whether the order of the list, or that of the names, is the order of the times, forwards or backwards."""
    steps = [np.diff([times[name] for name in order]) for order in (NAMES, sorted(NAMES))]
    return any((step > 0).all() or (step < 0).all() for step in steps)


def _loaded(trial):
    """What the student loads from a folder of NAMES, and the right answer."""
    rng = trial.rng(1)
    values = rng.permutation([0.01, 0.1, 0.8, 4.0, 9.0])
    times = dict(zip(NAMES, values.tolist(), strict=True))
    while _sorted_somehow(times):
        times = dict(zip(NAMES, rng.permutation(values).tolist(), strict=True))
    with tempfile.TemporaryDirectory() as folder:
        pictures = {}
        for k, name in enumerate(NAMES):
            image = rng.integers(0, 120, (12, 17, 3), dtype=np.uint8)
            image[1:4, 2:7] = (200, 90, 10 + 5 * k)  # RGB, a patch that is orange and blue when swapped
            pictures[name] = image
            done, data = cv2.imencode(".png", np.ascontiguousarray(image[..., ::-1]))
            (Path(folder) / name).write_bytes(data.tobytes() if done else b"")
        (Path(folder) / "shutter.txt").write_text("\n".join(f"{n} {t}" for n, t in times.items()))
        images, found = several(trial.run(Path(folder), times), 2, "images and times")
    ordered = sorted(NAMES, key=times.get)
    something(images, "images")
    return list(images), found, [pictures[n] for n in ordered], np.array([times[n] for n in ordered]), pictures, times


@load_in_order.part(1, "It returns the photographs, (H, W, 3) uint8, and an array of times.")
def _(trial):
    images, found, right, times, _, _ = _loaded(trial)
    if len(images) != len(right):
        raise Wrong(f"It returns {len(images)} photographs for a list of {len(right)} names.")
    for image in images:
        if image is None:
            raise Wrong(
                "One photograph is None: OpenCV could not open it, and says nothing; is the folder in the path?"
            )
        if isinstance(image, np.ndarray) and image.ndim == 2:
            raise Wrong("A photograph has no colours, (H, W); were they read as grey?")
        array(image, "A photograph", right[0].shape, "iu" if np.asarray(image).dtype.kind in "iu" else "f")
        if image.dtype != np.uint8:
            raise Wrong(f"The photographs are {image.dtype}; leave them as they are in the file, uint8 from 0 to 255.")
    array(found, "The array of times", times.shape, "fiu")


@load_in_order.part(1, "Times ascend, and every photograph kept its own.")
def _(trial):
    images, found, right, times, pictures, by_name = _loaded(trial)
    trial.compare("times", found, times)

    def is_in(order):  # colours may still be swapped; that is the other part
        return all(np.array_equal(np.sort(a, axis=2), np.sort(b, axis=2)) for a, b in zip(images, order, strict=True))

    by = {n: pictures[n] for n in sorted(NAMES)}
    if np.allclose(found, times) and is_in(right):
        return
    if is_in(right[::-1]) and np.allclose(found, times[::-1]):
        raise Wrong("The longest exposure comes first; the shortest should.")
    if is_in(list(by.values())) and np.allclose(found, [by_name[n] for n in by]):
        raise Wrong("The photographs are sorted by their names, as text; they should be in the order of their times.")
    if is_in(list(pictures.values())) and np.allclose(found, list(by_name.values())):
        raise Wrong("The photographs come in the order of the list; nothing was sorted by time.")
    if np.allclose(found, times):
        raise Wrong("The times are sorted, but the photographs are in another order: each has the time of another.")
    raise Wrong("Photographs and times are not both in the order of time, shortest first.")


@load_in_order.part(1, "The channels are red, green and blue.")
def _(trial):
    images, _, right, *_ = _loaded(trial)
    patches = sorted(tuple(int(v) for v in image[2, 3]) for image in images)
    wanted = sorted(tuple(int(v) for v in image[2, 3]) for image in right)
    trial.compare("colour of the patch", np.array(patches), np.array(wanted))
    if patches == wanted:
        return
    if patches == sorted(p[::-1] for p in wanted):
        raise Wrong("Red and blue are swapped: OpenCV reads BGR, and an orange patch came out blue.")
    raise Wrong(f"An orange patch, RGB {wanted[0]}, came out as {patches[0]}.")
