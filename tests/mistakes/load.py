"""Answers to the TODOs of notebook 1."""

import re
from pathlib import Path

import cv2
import numpy as np
from mistakes.corpus import answer, right, slip, wrong

answer(
    "1.1",
    """
    def read_times(text):
        times = {}
        for line in text.splitlines():
            line = line.strip()
            if not line or line.startswith("#"):
                continue
            name, time = line.rsplit(maxsplit=1)
            if "/" in time:
                a, b = time.split("/")
                times[name] = float(a) / float(b)
            else:
                times[name] = float(time)
        return times
    """,
)
slip("1.1", "one over the time", "float(a) / float(b)", "float(b)")
slip("1.1", "one over the time", "float(a) / float(b)", "float(b) / float(a)")
slip("1.1", "behind the point", "float(a) / float(b)", "float(a) // float(b)")
slip("1.1", "ValueError", 'if "/" in time:', "if False:")
slip("1.1", "ValueError", "line.rsplit(maxsplit=1)", "line.split()")
slip("1.1", "not a time to a name", "times[name] = float(time)", "times[float(time)] = name")
slip("1.1", "the text", "times[name] = float(time)", "times[name] = time")
slip("1.1", "comment", 'not line or line.startswith("#")', "not line")
slip("1.1", "ValueError", 'not line or line.startswith("#")', 'line.startswith("#")')
slip("1.1", "None", "return times", "print(times)")
slip("1.1", "milliseconds", "= float(time)", "= 1000 * float(time)")
slip("1.1", "list", "return times", "return list(times.values())")


@wrong("1.1", says="cut at a blank")
def first_word_is_the_name(text):
    lines = [line.split() for line in text.splitlines() if line.strip() and line[0] != "#"]
    return {words[0]: eval(words[-1]) for words in lines}


@wrong("1.1", says="SyntaxError")
def eval_of_everything(text):
    return {line.split()[0]: eval(line.split()[1]) for line in text.splitlines()[1:] if line} and eval("1 2")


@right("1.1")
def by_expression(text):
    found = re.findall(r"^(?!#)(.*\S)\s+([\d.]+)(?:/([\d.]+))?\s*$", text, re.M)
    return {name: float(a) / float(b or 1) for name, a, b in found}


@right("1.1")
def by_eval(text):
    lines = [line.strip() for line in text.split("\n") if line.strip() != "" and line.strip()[0] != "#"]
    return {" ".join(line.split()[:-1]): float(eval(line.split()[-1])) for line in lines}


answer(
    "1.2",
    """
    def time_from_name(name):
        stem = name[:name.rindex(".")]
        return float(stem.split("_")[-1])
    """,
)
slip("1.2", "behind the point", 'name.rindex(".")', 'name.index(".")')
slip("1.2", "the text", 'float(stem.split("_")[-1])', 'stem.split("_")[-1]')
slip("1.2", "behind the point", 'float(stem.split("_")[-1])', 'int(float(stem.split("_")[-1]))')
slip("1.2", "ValueError", '.split("_")[-1]', '.split("_")[1]')
slip("1.2", "one over the time", "return float", "return 1 / float")
slip("1.2", "logarithm", 'float(stem.split("_")[-1])', 'np.log(float(stem.split("_")[-1]))')


@wrong("1.2", says="ValueError")
def four_letters_cut_off(name):
    return float(name[4:-4])


@right("1.2")
def digits_behind_the_last_underscore(name):
    return float(re.findall(r"_([0-9.]+)\.\w+$", name)[0])


answer(
    "1.3",
    """
    def load_in_order(folder, times):
        names = sorted(times, key=lambda name: times[name])
        images = []
        for name in names:
            image = cv2.imread(str(folder / name))
            images.append(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
        return images, np.array([times[name] for name in names])
    """,
)
slip("1.3", "Red and blue", "cv2.cvtColor(image, cv2.COLOR_BGR2RGB)", "image")
slip("1.3", "by their names", "sorted(times, key=lambda name: times[name])", "sorted(times)")
slip(
    "1.3",
    "another order",
    "[times[name] for name in names]",
    "sorted(times.values())",
    "key=lambda name: times[name]",
    "key=str",
)
slip("1.3", "longest exposure", "times[name])\n", "-times[name])\n")
slip("1.3", "order of the list", "sorted(times, key=lambda name: times[name])", "list(times)")
slip(
    "1.3",
    "another order",
    "[times[name] for name in names]",
    "list(times.values())",
    "names = sorted",
    "times = dict(sorted(times.items(), key=lambda pair: pair[1])); names = sorted",
    "key=lambda name: times[name])",
    "key=lambda name: (len(name), name))",
)
slip("1.3", "float", "cv2.cvtColor(image, cv2.COLOR_BGR2RGB)", "cv2.cvtColor(image, cv2.COLOR_BGR2RGB) / 255")
slip("1.3", "grey", "cv2.cvtColor(image, cv2.COLOR_BGR2RGB)", "cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)")
slip("1.3", "stops with error", "str(folder / name)", "name")
slip("1.3", "array", "np.array([times[name] for name in names])", "[times[name] for name in names]")
slip("1.3", "2 things", "return images, np.array([times[name] for name in names])", "return images")


@wrong("1.3", says="calls load_bracket,")
def the_course_does_it(folder, times):
    from hdr_helpers import load_bracket

    bracket = load_bracket(folder)
    return list(bracket.images), bracket.times


@wrong("1.3", says=None)
def every_file_of_the_folder(folder, times):
    images = [cv2.imread(str(path))[..., ::-1] for path in Path(folder).iterdir()]
    return images, np.array(sorted(times.values()))


@right("1.3")
def imdecode_and_argsort(folder, times):
    names, seconds = np.array(list(times)), np.array(list(times.values()))
    order = seconds.argsort()
    images = [cv2.imdecode(np.fromfile(Path(folder) / n, dtype=np.uint8), cv2.IMREAD_COLOR) for n in names[order]]
    return tuple(image[:, :, ::-1] for image in images), seconds[order]
