"""What a learning platform gives, brought in: a folder or a zip of submissions in, one Submission a student out.

What is wrong with one submission becomes a flag of that submission, and the others go on.
"""

import json
import re
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from hdr_helpers.grading._intake.names import LONGEST, Owner, number_of, people, safe, tell
from hdr_helpers.grading._intake.unpack import ENTRIES, TOTAL, Entry, Trouble, entries_of, forget, is_passed_over, shown
from hdr_helpers.grading.course import InstructorError

NOTEBOOK = 50_000_000  # bytes of one notebook, at most
FLAGS = 20  # sentences about files that can't be used, of one submission; more tell nothing new
ACCEPTED = (
    "Accepted are a folder or a zip as Moodle, Canvas, Blackboard, Brightspace or nbgrader give it, one with a "
    "folder, a zip or named notebooks for each student, or one student's notebooks."
)
REASONS = ("of the last attempt", "with the better name", "the later version", "changed last", "chosen by its place")


@dataclass
class Submission:
    """What one student handed in. student : an id, safe as a folder's name, unique whatever the capitals"""

    student: str
    name: str  # of the person, where the platform gives it, else empty
    notebooks: dict[str, bytes]  # for each assignment, such as "03_crf", the file that is to be graded
    flags: list[str] = field(default_factory=list)  # sentences for the instructor
    late: bool = False


@dataclass
class _Register:
    """Gives every student an id of their own, also where systems don't tell capitals from small letters."""

    taken: dict[str, str] = field(default_factory=dict)  # an id without capitals, and who has it

    def enter(self, student: str) -> tuple[str, str]:
        """A safe id that nobody has yet, and a sentence where it is not the one that was asked for, else empty."""
        wanted, k = safe(student), 1
        given = wanted
        while given.casefold() in self.taken:
            k += 1
            given = f"{wanted[: LONGEST - 6]}-{k}"
        self.taken[given.casefold()] = student
        if given != wanted:
            other = self.taken[wanted.casefold()]
            return given, f"The id {shown(student)} is too like another's, {shown(other)}; here it is {shown(given)}."
        if given != "_".join(student.split()):  # a space that became a line is no news
            return (
                given,
                f"The id {shown(student)} can't be the name of a folder everywhere; here it is {shown(given)}.",
            )
        return given, ""


@dataclass(frozen=True)
class _Candidate:
    """A file that may be graded. rank : what makes it better than another one, in the order of REASONS"""

    rank: tuple
    entry: Entry
    data: bytes
    flag: str  # a sentence where its name is not as asked for


def collect(path, assignments: list[str]) -> list[Submission]:
    """The submissions in a folder or a zip, sorted by student. Nothing is written to disk.

    path : as a platform gives it, see ACCEPTED; assignments : the notebooks' names, such as "01_load"
    Raises InstructorError where path is not there, is neither folder nor zip, or holds no submission.
    """
    path = Path(path)
    try:
        place = _alone(path.resolve(strict=True))
        found = people(entries_of(place), place.name if place.is_dir() else place.stem, assignments)
        register = _Register()
        found.sort(key=lambda person: (safe(person[0].student) != person[0].student, person[0].student, person[0].key))
        submissions = [_submission(who, theirs, register, assignments) for who, theirs in found]
    except FileNotFoundError:
        raise InstructorError(f"{path} is not there. {ACCEPTED}") from None
    except Trouble as problem:
        raise InstructorError(f"{path} is neither a folder nor a zip: it {problem}. {ACCEPTED}") from None
    except OSError as problem:
        raise InstructorError(f"{path} can't be read ({problem.strerror}). {ACCEPTED}") from None
    finally:
        forget()
    if not submissions:
        raise InstructorError(f"{path} holds no submission. {ACCEPTED}")
    return sorted(submissions, key=lambda submission: submission.student)


def _alone(path: Path) -> Path:
    """A zip that is alone in its folder stands for the folder."""
    inside = [child for child in path.iterdir() if not is_passed_over(child.name)] if path.is_dir() else []
    if len(inside) == 1 and inside[0].suffix.lower() == ".zip" and inside[0].is_file() and not inside[0].is_symlink():
        return inside[0]
    return path


def _submission(who: Owner, theirs: list[tuple[Entry, Owner]], register: _Register, assignments) -> Submission:
    student, renamed = register.enter(who.student)
    flags = [sentence for sentence in (who.doubt, renamed) if sentence]
    candidates, unusable, spent = defaultdict(list), [], 0
    for entry, whose in theirs[:ENTRIES]:
        try:
            if entry.trouble:
                raise Trouble(entry.trouble)
            if entry.kind == "notebook":
                data = entry.read(min(NOTEBOOK, TOTAL - spent))
                spent += len(data)
                assignment, candidate = _candidate(entry, whose, data, assignments)
                candidates[assignment].append(candidate)
        except Trouble as problem:
            unusable.append(f"{entry.path} {problem}.")
    flags += unusable[:FLAGS]
    if len(unusable) > FLAGS:
        flags.append(f"And {len(unusable) - FLAGS} more files can't be used.")
    if len(theirs) > ENTRIES:
        flags.append(f"There are more than {ENTRIES} files; those after them were not looked at.")
    notebooks = {}
    for assignment in sorted(candidates):
        graded = max(reversed(candidates[assignment]), key=lambda candidate: candidate.rank)
        notebooks[assignment] = graded.data
        flags += [graded.flag] if graded.flag else []
        flags += _others(assignment, graded, candidates[assignment])
    if not notebooks:
        flags.append(_nothing([entry for entry, _ in theirs if entry.kind == "other"]))
    return Submission(student, who.name, notebooks, flags, who.late)


def _candidate(entry: Entry, whose: Owner, data: bytes, assignments) -> tuple[str, _Candidate]:
    """Which notebook a file is, by its name or else by the cells inside. Raises Trouble where neither tells."""
    name = whose.file or entry.parts[-1]
    told = tell(name, assignments)
    if told:
        assignment, version, goodness = told.assignment, told.version, 1 + told.as_asked
        flag = "" if told.as_asked else f"{shown(name)} was taken for {assignment}."
    else:
        assignment, version, goodness = _by_cells(data, assignments), 0, 0
        if assignment is None:
            raise Trouble("is none of the notebooks that can be graded, by its name and by the cells inside")
        flag = f"{shown(name)} was taken for {assignment}, by the cells inside."
    rank = (whose.when, goodness, (*whose.version, version), entry.modified, (-len(entry.parts), entry.parts))
    return assignment, _Candidate(rank, entry, data, flag)


def _by_cells(data: bytes, assignments: list[str]) -> str | None:
    """The assignment whose TODOs and checks are in a notebook, most of them where there are several's, or None."""
    try:
        cells = json.loads(data)["cells"]
        ids = [cell["metadata"].get("nbgrader", {}).get("grade_id", "") for cell in cells]
        numbers = Counter(int(found[1]) for name in ids if (found := re.match(r"(?:todo|check)-(\d+)-", name)))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    fitting = {number_of(assignment): assignment for assignment in assignments}
    return next((fitting[number] for number, _ in numbers.most_common() if number in fitting), None)


def _others(assignment: str, graded: _Candidate, all_of_it: list[_Candidate]) -> list[str]:
    """A sentence where several files are the same notebook, which says why one of them is graded."""
    others = [candidate for candidate in all_of_it if candidate is not graded]
    if not others:
        return []
    second = max(others, key=lambda candidate: candidate.rank)
    better = (reason for reason, a, b in zip(REASONS, graded.rank, second.rank, strict=True) if a != b)
    reason = next(better, REASONS[-1])  # a zip may hold one name twice
    times = "twice" if len(others) == 1 else f"{len(others) + 1} times"
    return [f"{assignment}.ipynb was handed in {times}; {graded.entry.path}, {reason}, is graded."]


def _nothing(others: list[Entry]) -> str:
    if not others:
        return "There is no notebook."
    some = ", ".join(shown(entry.parts[-1]) for entry in others[:3])
    return f"There is no notebook, only {some}{' and more' if len(others) > 3 else ''}."
