"""An examiner outside of the notebook judges every answer as the check in the notebook does."""

import importlib
import re
import sys
import tempfile
from pathlib import Path

from hdr_helpers.grading._running.examiner import Examiner
from hdr_helpers.lab.checks import TODOS, check

sys.path.insert(0, str(Path(__file__).parent))
corpus = importlib.import_module("mistakes.corpus")
for stage in ("load", "align", "crf", "system", "curves", "merge", "tonemap"):
    importlib.import_module(f"mistakes.{stage}")

ANSWERS = corpus.RIGHT + corpus.WRONG
ODD = ("return ", "sparse", "list", "dtype", "shown", "imdecode", "precision")  # where other types come back
SOME = [answer for k, answer in enumerate(ANSWERS) if k % 3 == 0 or any(word in answer.what for word in ODD)]
CARRIED = ("a_default_matrix", "one_object_for_all")  # what one call leaves for the next shows in their numbers
ENDLESS = ("never_ends", "while True")


def test_every_answer_gets_the_verdict_that_it_gets_in_the_notebook(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", None)  # the examiner sets this; here it is put back
    examiner, others = Examiner(str(tmp_path / "line"), 0, 20.0, tmp_path), []
    assert {answer.number for answer in SOME} == set(TODOS) and len(ANSWERS) / 3 < len(SOME) < len(ANSWERS) / 2
    for answer in SOME:
        endless = any(word in answer.what for word in ENDLESS)
        examiner.limit = 0.5 if endless else 20.0
        monkeypatch.delenv("HDR_EXAMINER", raising=False)
        here = check(answer.number, answer.function, limit=examiner.limit)
        monkeypatch.setenv("HDR_EXAMINER", examiner.address)
        examiner.expect(answer.number)
        there = check(answer.number, answer.function)
        verdicts = [str(result) for result in (here, there, examiner.results[answer.number])]
        if endless or answer.what in CARRIED:
            verdicts = [re.sub(r"\d+(\.\d+)?(e[+-]\d+)?", "", said) for said in verdicts]
        if len(set(verdicts)) > 1 or here.points != there.points or (here.function is answer.function) != there.own:
            others.append(verdicts)
    examiner.close()
    assert not others
