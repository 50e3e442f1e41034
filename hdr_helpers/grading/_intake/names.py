"""Who handed a file in, and which notebook it is, as far as names tell: of files, of folders and of zips."""

import re
import unicodedata
from dataclasses import dataclass, replace
from itertools import takewhile

# What learning platforms call a student's folder or file. Groups: student, name, late, when (of an attempt),
# version and upload (later is larger), rest and kind (the file as the student named it). The first that fits wins.
PLATFORMS = [
    re.compile(pattern, re.I | re.S)
    for pattern in (
        # Moodle, "Download all submissions", in folders or without; text that was typed online comes the same way
        r"(?P<name>.+?)_(?P<student>\d+)_assignsubmission_(?:file|onlinetext)(?:_(?P<rest>.*))?",
        # Blackboard, "Assignment File Download", and its receipt; an assignment may be called 01_load
        r"(?:\d+_[a-z]+|[^_]*)_(?P<student>.+)_attempt_(?P<when>\d{4}(?:-\d\d){5})(?:_(?P<rest>.+)|\.txt)?",
        # nbgrader, the exchange's inbound folder; on some systems a colon can't stand in a name
        r"(?P<student>[^+]+)\+[^+]+\+(?P<when>\d{4}-\d\d-\d\d \d\d\D\d\d\D\d\d)[^+]*(?:\+.*)?",
        # Canvas, "Download Submissions"; -1 says that a file of this name was there already
        r"(?P<name>[^_]+?)(?P<late>_late)?_(?P<student>\d+)_(?P<upload>\d{5,})_"
        r"(?P<rest>.+?)(?:-(?P<version>\d{1,3}))?(?P<kind>\.\w+)",
        # Brightspace, "Download" of an assignment's submissions; the second number is the assignment's
        r"(?P<student>\d+)-\d+ - (?P<name>.+?) - (?P<when>[^-]*\d{4}[^-]*?)(?: - (?P<rest>.+))?",
    )
]
MONTHS = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"]
# Folders of the course, of nbgrader and of tidy students: no person is called so.
NO_PERSON = re.compile(
    r"(?:notebooks?|hdr[_-]course|hdr[_-]helpers|data|results?|grading|submitted|submissions?|inbound|old|backup)"
    r"(?:[-_ ](?:main|master|copy|\d{1,2})|[ ]?\(\d+\))?",
    re.I,
)
GAP = r"[\s_\-.]*"
# What is added to the name of a later version: " (1)", "-Copy1", "_final", "_v2".
LATER = (
    rf"(?:{GAP}(?:\(\d{{1,3}}\)|(?<![^\W_])(?:copy|kopie|copie|副本|final|finished|done|new|last|latest|updated|fixed|"
    rf"submission|solution|v|version|rev)(?:{GAP}\d{{1,3}})?))+{GAP}$"
)
COPY_OF = r"^(?:copy of|copy|kopie von|copie de|final|my)[\s_\-]+"
RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{k}" for port in ("com", "lpt") for k in range(10))}
LONGEST = 60  # characters of an id: 240 bytes at most, and a path on Windows has 260 characters in all


@dataclass(frozen=True)
class Owner:
    """Who handed a file in. key : the same for everything of one person; student : not yet safe for a folder"""

    key: str
    student: str
    name: str = ""
    late: bool = False
    when: tuple[int, ...] = ()  # of the attempt, larger is later
    version: tuple[int, ...] = ()
    file: str = ""  # the file's own name, where an id stands beside it
    platform: bool = False
    doubt: str = ""  # a sentence where nothing tells whose it is


@dataclass(frozen=True)
class Told:
    """Which notebook a name says that it is. version : the number of a copy, or 0; rest : an id, or empty"""

    assignment: str
    as_asked: bool
    version: int = 0
    rest: str = ""


def people(entries, root: str, assignments: list[str]) -> list[tuple[Owner, list]]:
    """Everyone who handed something in: an Owner, and pairs of an entry and its own Owner.

    entries : with .parts, of the path from the place collected, .kind and .trouble; root : the name of that place
    """
    filled = {entry.parts[:k] for entry in entries for k in range(1, len(entry.parts))}
    entries = [entry for entry in entries if entry.parts not in filled]  # a folder speaks for itself where it is empty
    around = _around(entries, root, assignments)
    groups, nobodys = {}, []
    for entry in (entry for entry in entries if len(entry.parts) > around):
        who = _owner_of(entry, around, assignments)
        if who:
            groups.setdefault(who.key, []).append((entry, who))
        elif entry.kind == "notebook" or entry.trouble:
            nobodys.append(entry)
    if _are_of_one(nobodys, groups, _holders(entries, around, assignments), assignments):
        student, name = identity(root)
        who = Owner("root", student, name)
        return [(who, [(entry, who) for entry in entries])]
    for entry in nobodys:
        doubt = f"Nothing tells whose {entry.path} is; a folder or a file with an id in its name would."
        student = re.sub(r"\.\w+$", "", entry.parts[-1])
        groups[entry.parts] = [(entry, Owner(f"stray {entry.parts}", student, doubt=doubt))]
    # A note beside what a platform gives makes no person of the folder around both.
    shared = {entry.parts[: around + 1] for group in groups.values() for entry, who in group if who.platform}
    found = []
    for group in groups.values():
        notes = [entry.kind == "other" and entry.parts[: around + 1] in shared for entry, _ in group]
        if all(notes) and not group[0][1].platform:
            continue
        names, late = [who.name for _, who in group if who.name], any(who.late for _, who in group)
        found.append((replace(group[0][1], name=names[0] if names else "", late=late), group))
    return found


def _are_of_one(nobodys: list, groups: dict, holders: dict, assignments: list[str]) -> bool:
    """Are notebooks that lie about without an id one student's, and all the rest too? Not with signs of a class."""
    named = {told.assignment for entry in nobodys if (told := tell(entry.parts[-1], assignments))}
    if any(who.platform for group in groups.values() for _, who in group):
        return False
    if any(len(keys) > 1 for keys in holders.values()) and named != set(assignments):
        return False
    most = max((sum(entry.kind == "notebook" for entry, _ in group) for group in groups.values()), default=0)
    return len(nobodys) > most and (bool(named) or len(nobodys) == 1)


def _around(entries, root: str, assignments: list[str]) -> int:
    """How many folders are around everything and say nothing of a person.

    Two people below them have the same notebook, or a folder is called like the place itself, as in many a zip.
    """
    folders = [entry.parts if entry.kind == "folder" else entry.parts[:-1] for entry in entries] or [()]
    common = [
        pair[0] for pair in takewhile(lambda pair: pair[0] == pair[1], zip(min(folders), max(folders), strict=False))
    ]
    for around in range(1, len(common) + 1):
        if any(len(keys) > 1 for keys in _holders(entries, around, assignments).values()):
            return around
    return int(bool(common) and common[0].casefold() == root.casefold())


def _holders(entries, around: int, assignments: list[str]) -> dict[str, set[str]]:
    """Who has each notebook, when the outer folders are left aside."""
    holders = {}
    for entry in entries:
        who = entry.kind == "notebook" and len(entry.parts) > around and _owner_of(entry, around, assignments)
        if who:
            told = tell(entry.parts[-1], assignments)
            holders.setdefault(told.assignment if told else entry.parts[-1], set()).add(who.key)
    return holders


def _owner_of(entry, around: int, assignments: list[str]) -> Owner | None:
    return owner(entry.parts[around:] + (("",) if entry.kind == "folder" else ()), assignments)


def owner(parts: tuple[str, ...], assignments: list[str]) -> Owner | None:
    """Who handed in the file with this path, or None where no name in it says so.

    parts : folders and zips, outermost first, and the file's name; or "" there, where folders alone should tell
    """
    for k, part in enumerate(parts):
        for pattern in PLATFORMS:
            if found := pattern.fullmatch(part):
                return _of_platform(found.groupdict(), k == len(parts) - 1)
    for part in parts[:-1]:
        part = re.sub(r"(?:\.(?:zip|rar|7z|tar|t?gz|bz2|xz))+$", "", part, flags=re.I)
        told = tell(part, assignments)
        person = told.rest if told else part
        if person and not NO_PERSON.fullmatch(person):
            return _plain(person)
    told = tell(parts[-1], assignments) if parts[-1].lower().endswith(".ipynb") else None
    if told and told.rest and not NO_PERSON.fullmatch(told.rest):
        return _plain(told.rest, _without(parts[-1], told.rest))
    return None


def _of_platform(said: dict, is_file: bool) -> Owner:
    rest = (said.get("rest") or "") + (said.get("kind") or "")
    name = said.get("name") or ""
    return Owner(
        key=f"platform {said['student']}",
        student=said["student"],
        name="" if name.casefold() == "participant" else " ".join(name.split()),  # Moodle's word for the anonymous
        late=bool(said.get("late")),
        when=_moment(said.get("when") or ""),
        version=tuple(int(said.get(group) or 0) for group in ("version", "upload")),
        file=rest if is_file else "",
        platform=True,
    )


def _moment(text: str) -> tuple[int, ...]:
    """A date with a time as numbers that sort: "2026-11-03-10-15-00" or "3 November 2026 1013 AM"."""
    numbers = re.findall(r"\d+", text)
    if len(numbers) < 2 or len(numbers[0]) == 4:
        return tuple(map(int, numbers))
    day, year = map(int, numbers[:2])
    month = next((k for k, month in enumerate(MONTHS, 1) if re.search(rf"\b{month}", text, re.I)), 0)
    hour, minute = divmod(int("0" + "".join(numbers[2:])), 100)
    if half := re.search(r"\b([ap])m\b", text, re.I):
        hour = hour % 12 + 12 * (half[1] in "pP")
    return year, month, day, hour, minute


def _plain(text: str, file: str = "") -> Owner:
    student, name = identity(text)
    return Owner(key=f"plain {text}", student=student, name=name, file=file)


def identity(text: str) -> tuple[str, str]:
    """Id and name in the name of a folder: ("20231234", "张伟") in 张伟_20231234, else all of it and an empty name."""
    number = re.search(r"(?<![A-Za-z0-9])\d{5,}(?![A-Za-z0-9])", text)
    if not number or "@" in text:
        return text, ""
    name = re.sub(r"[\s_\-.,()\[\]]+", " ", text[: number.start()] + " " + text[number.end() :]).strip()
    if not name or not name.replace(" ", "").replace("'", "").isalpha():
        return text, ""
    return number[0], name


def tell(name: str, assignments: list[str]) -> Told | None:
    """Which notebook a name says that it is, or None where it says none, or two."""
    stem = re.sub(r"(?:\.ipynb)+$", "", name, flags=re.I).strip()
    found = [(assignment, match) for assignment in assignments if (match := _pattern(assignment).search(stem))]
    if len(found) != 1:
        return None
    assignment, match = found[0]
    before = re.sub(COPY_OF, "", stem[: match.start()], flags=re.I)
    after = re.sub(LATER, "", stem[match.end() :], flags=re.I)
    after = re.sub(rf"^{GAP}\d{{0,3}}$", "", after)
    numbers = re.findall(r"\d+", stem[match.end() + len(after) :])
    rest = "_".join(text for text in (before.strip(" _-."), after.strip(" _-.")) if text)
    return Told(assignment, stem.casefold() == assignment.casefold(), int(numbers[-1]) if numbers else 0, rest)


def _pattern(assignment: str) -> re.Pattern:
    """Fits 03_crf, 3-CRF and 03 crf for "03_crf", but neither 103_crf nor 03_crfs."""
    number, words = re.fullmatch(r"(\d*)(.*)", assignment, re.S).groups()
    begin = rf"(?<!\d)0*{int(number)}" if number else r"(?<![^\W_])"
    return re.compile(begin + GAP + GAP.join(map(re.escape, re.findall(r"[^\s_\-.]+", words))) + "(?![A-Za-z])", re.I)


def _without(name: str, rest: str) -> str:
    """A file's name without the id before or behind it."""
    return re.sub(r"[\s_\-]+(?=\.ipynb$)", "", name.replace(rest, "", 1).lstrip(" _-"), flags=re.I)


def number_of(assignment: str) -> int | None:
    """3 for "03_crf"."""
    number = re.match(r"\d+", assignment)
    return int(number[0]) if number else None


def safe(student: str) -> str:
    """An id that may be the name of a folder on every system: letters, digits and - _ . @, never empty."""
    text = unicodedata.normalize("NFC", student).strip()
    text = "".join(c if c.isalpha() or c.isdecimal() or c in "-_.@" else "_" for c in text)
    text = text.lstrip(".-")[:LONGEST].rstrip(".")
    if text.split(".")[0].casefold() in RESERVED:
        text = f"_{text}"  # Windows keeps these names to itself, whatever follows their dot
    return text or "student"
