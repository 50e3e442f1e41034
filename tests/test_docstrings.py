"""What docstrings promise: every parameter, what is raised, and an example that runs and says what it says."""

import ast
import doctest
import importlib
import inspect
import re
import textwrap
from pathlib import Path
from time import process_time

import pytest

HOUSE = Path(__file__).parents[1] / "hdr_helpers"
STAGES = ["load", "align", "crf", "merge", "tonemap"]
PAPERS = [f"papers.{path.stem}" for path in sorted((HOUSE / "papers").glob("[!_]*.py"))]
LAB = ["camera", "metrics", "bound", "judging", "carry", "brackets", "scenes", "data", "tables", "checks"]
MODULES = [*STAGES, *PAPERS, *(f"lab.{name}" for name in LAB)]
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
SLOW = 0.5  # seconds of the processor that the examples of one docstring may take
MOST_LINES = 7  # of an example, with what it prints

# Records whose example is that of the function which returns them: it reads one of their fields.
SHOWN_BY = {
    "align.Alignment": "align.align_mtb",
    "align.Ghosts": "align.remove_ghosts",
    "crf.Response": "crf.recover_crf",
    "merge.Merged": "merge.merge_debevec",
    "merge.Clipping": "merge.clipping",
    "lab.metrics.RadianceError": "lab.metrics.radiance_error",
    "lab.metrics.MovingError": "lab.metrics.moving_error",
    "lab.judging.DetailKept": "lab.judging.detail_kept",
    "lab.judging.Tmqi": "lab.judging.tmqi",
}
# What else has no example, and why.
EXEMPT = {
    "load.Truth": "a record that the virtual camera fills in: Camera's example reads it",
    "merge.weights_by_noise": "no room in merge.py: what merge_debevec does where no weights are given",
    "merge.merge_opencv": "no room in merge.py: for comparison only",
    "merge.write_hdr": "no room in merge.py: it writes a file",
    "merge.write_whole": "no room in merge.py: it writes a file",
    "merge.radiance_formats": "no room in merge.py: it depends on how OpenCV was built",
    "lab.judging.ClippedShare": "a record of two shares: clipped_share's example shows both",
    "lab.judging.Judgement": "no room in judging.py: clipped_share, detail_kept and tmqi together",
    "lab.judging.judge": "no room in judging.py: clipped_share, detail_kept and tmqi together",
    "lab.judging.local_fidelity": "no room in judging.py: structural_fidelity on one scale",
    "lab.brackets.make_chapel": "takes seconds and writes the course's data",
    "lab.brackets.make_handheld": "takes seconds and writes the course's data",
    "lab.brackets.shoot_handheld": "takes seconds",
    "lab.brackets.handheld_chapel": "takes a second",
    "papers.grossberg_nayar2003.TooLittleEvidence": "an exception",
    "lab.checks.CheckFailed": "an exception",
}


def load(name):
    return importlib.import_module(f"hdr_helpers.{name}")


def public(name):
    """(full name, object) of the functions and classes that a module defines for others."""
    module = load(name)
    for own, thing in vars(module).items():
        plain = inspect.unwrap(thing) if callable(thing) else thing  # what a cache is wrapped round
        if own.startswith("_") or not (inspect.isfunction(plain) or inspect.isclass(plain)):
            continue
        if plain.__module__ == module.__name__:
            yield f"{name}.{own}", plain


def methods(full, thing):
    """(full name, function) of a class's own public methods and properties."""
    for own, member in vars(thing).items() if inspect.isclass(thing) else ():
        function = getattr(member, "fget", getattr(member, "__func__", member))  # of a property, a static method
        if not own.startswith("_") and inspect.isfunction(function):
            yield f"{full}.{own}", function


PUBLIC = dict(pair for name in MODULES for pair in public(name))
METHODS = {full: function for owner, thing in PUBLIC.items() for full, function in methods(owner, thing)}
EVERYTHING = PUBLIC | METHODS


def said(full):
    """The docstring without its example; of a method that only its class's parent has described, that."""
    if full in METHODS:
        owner, _, own = full.rpartition(".")
        text = inspect.getdoc(getattr(PUBLIC[owner], own)) or ""
    else:
        text = EVERYTHING[full].__doc__ or ""
    return re.sub(r"^ *>>>.*?(?=\n *\n|\Z)", "", text, flags=re.M | re.S)


def parameters(thing):
    """Names of a function's parameters, or of the fields that a class itself declares."""
    if inspect.isclass(thing):
        return list(inspect.get_annotations(thing))
    return [name for name in inspect.signature(thing).parameters if name != "self"]


def raised(thing):
    """Names of the exceptions raised in a function's own body, and in private functions of its module that it calls."""
    found, waiting, seen = set(), [getattr(thing, "__post_init__", None) if inspect.isclass(thing) else thing], set()
    while waiting:
        function = waiting.pop()
        if function is None or function in seen:
            continue
        seen.add(function)
        for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(function)))):
            if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
                found.add(ast.unparse(node.exc.func))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id.startswith("_"):
                helper = function.__globals__.get(node.func.id)
                waiting.append(helper if inspect.isfunction(helper) else None)
    return found


def has_example(full):
    return bool(doctest.DocTestParser().get_examples(EVERYTHING[full].__doc__ or ""))


def test_there_is_something_to_look_at():
    assert len(PUBLIC) > 100 and len(METHODS) >= 9
    assert {"load.load_bracket", "lab.data.chapel", "papers.ward2003.bitmaps", "lab.checks.check"} <= PUBLIC.keys()
    assert {"load.Bracket.log_times", "lab.camera.Camera.margin"} <= METHODS.keys()


@pytest.mark.parametrize("full", EVERYTHING)
def test_a_docstring_says_what_every_parameter_is(full):
    text = said(full)
    # Python writes a line for a dataclass that has none, such as "Truth(radiance: numpy.ndarray, ...)".
    assert text and not text.startswith(f"{full.split('.')[-1]}("), "there is no docstring"
    if re.search(r"[Aa]rguments (and errors )?as for \w+", text):
        return
    missing = [name for name in parameters(EVERYTHING[full]) if not re.search(rf"\b{name}\b", text)]
    assert not missing


@pytest.mark.parametrize("full", EVERYTHING)
def test_what_is_raised_is_said(full):
    exceptions = raised(EVERYTHING[full])
    assert not exceptions or re.search(r"\bRaises?\b|errors as for \w+", said(full)), exceptions


@pytest.mark.parametrize("full", PUBLIC)
def test_everything_public_has_an_example_or_a_reason_for_none(full):
    if full in SHOWN_BY:
        shown = EVERYTHING[SHOWN_BY[full]]
        assert inspect.signature(shown).return_annotation is PUBLIC[full] and has_example(SHOWN_BY[full])
        used = "".join(e.source + e.want for e in doctest.DocTestParser().get_examples(shown.__doc__))
        assert any(re.search(rf"\.{name}\b|\b{name}=", used) for name in parameters(PUBLIC[full]))
        assert not has_example(full)
    else:
        assert has_example(full) != (full in EXEMPT), "an example, or a line in EXEMPT, and not both"


def test_nothing_is_exempt_that_is_not_there():
    assert SHOWN_BY.keys() <= PUBLIC.keys() and EXEMPT.keys() <= PUBLIC.keys() and not SHOWN_BY.keys() & EXEMPT.keys()


@pytest.mark.parametrize("name", MODULES)
def test_examples_run_quickly_and_print_what_they_say(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # an example that leaves a file where it runs is found out
    monkeypatch.setattr("hdr_helpers.lab.carry.RESULTS", tmp_path / "results")
    monkeypatch.setattr("hdr_helpers.lab.checks._asked", {})
    module, told = load(name), []
    for test in doctest.DocTestFinder(exclude_empty=True).find(module, name):
        runner = doctest.DocTestRunner(optionflags=FLAGS, verbose=False)
        start = process_time()
        assert runner.run(test, out=told.append).failed == 0, "".join(told)
        assert process_time() - start < SLOW, test.name
    assert [path.name for path in tmp_path.iterdir()] == (["results"] if name == "lab.carry" else [])


@pytest.mark.parametrize("full", PUBLIC)
def test_an_example_has_few_lines(full):
    examples = doctest.DocTestParser().get_examples(PUBLIC[full].__doc__ or "")
    assert sum(len((e.source + e.want).splitlines()) for e in examples) <= MOST_LINES


@pytest.mark.parametrize("name", MODULES)
def test_a_room_is_small(name):
    assert len(Path(load(name).__file__).read_text(encoding="utf-8").splitlines()) <= 260
