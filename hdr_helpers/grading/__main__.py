"""The instructor's commands: python -m hdr_helpers.grading release | grade SUBMISSIONS | stage"""

import argparse
import sys
from pathlib import Path

from hdr_helpers.__main__ import forgive_the_console
from hdr_helpers.grading.course import BUILD, ROOT, SEED, InstructorError, require_nbgrader, source_notebooks, stage
from hdr_helpers.grading.release import TOP, release


def main(arguments=None) -> int:
    """Run the command line. Returns the exit code: 0 done, 1 it can't be done (2 is argparse's)."""
    forgive_the_console()
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except (InstructorError, ValueError, OSError) as problem:
        print(f"hdr_helpers.grading: {problem}", file=sys.stderr)
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m hdr_helpers.grading",
        description="For the instructor of the course. Needs the extra 'instructor', which brings nbgrader: "
        'python -m pip install -e ".[instructor]" in the course folder.',
        epilog="Exit code: 0 done, 1 it can't be done (the reason is said), 2 wrong usage.",
    )
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    _add_release(commands)
    _add_grade(commands)
    _add_stage(commands)
    _add_pages(commands)
    return parser


def _add_out(command, name: str, what: str) -> None:
    said = f"{what} (default: {BUILD}/{name} in the course folder)"
    command.add_argument("-o", "--out", type=Path, default=ROOT / BUILD / name, metavar="DIR", help=said)


def _add_release(commands) -> None:
    command = commands.add_parser(
        "release",
        help="make the student edition: a folder and a zip",
        description="Make the student edition: notebooks with stubs in place of the solutions and without outputs, "
        "hdr_helpers without grading, data, environment.txt, and a README for students. nbgrader makes the notebooks "
        "from the metadata in notebooks/. Before anything is put into its place it is searched for solutions.",
        epilog="The zip is written beside DIR, as DIR.zip; from the same source it has the same bytes. "
        "Exit code: 0 done, 1 it can't be done, 2 wrong usage.",
    )
    _add_out(command, TOP, "folder to make")
    command.add_argument("--overwrite", action="store_true", help="replace an earlier student edition in DIR")
    command.set_defaults(run=_release)


def _release(options) -> None:
    folder, archive = release(options.out, options.overwrite)
    print(f"The student edition is {folder}")
    print(f"and, to hand out, {archive} ({archive.stat().st_size / 1e6:.1f} MB).")


def _add_grade(commands) -> None:
    command = commands.add_parser(
        "grade",
        help="grade submissions: a table, a report, feedback and a gradebook",
        description="Grade what a learning platform gives: a folder or a zip of submissions. Student code runs in a "
        "sandbox, without network, bounded in time, memory, processes and output; checks use other data than in the "
        "notebooks. Written to DIR: grades.csv, report.html, feedback/ with a page for each student, and nbgrader's "
        "gradebook, in which answers in words are marked. Run again, it grades what is new and keeps what was marked.",
        epilog="Exit code: 0 done, 1 it can't be done, 2 wrong usage.",
    )
    command.add_argument("submissions", type=Path, metavar="SUBMISSIONS", help="a folder or a zip")
    _add_out(command, "grading", "folder of the results")
    command.add_argument("--workers", type=int, default=2, metavar="N", help="students at one time (default: 2)")
    command.add_argument("--scheduler", metavar="ADDRESS", help="grade on the workers of this Dask scheduler")
    command.add_argument("--seed", type=int, default=SEED, metavar="N", help=f"of the checks' data (default: {SEED})")
    command.add_argument("--memory", type=int, metavar="MB", help="that a notebook may use (default: 4096)")
    command.add_argument("--minutes", type=float, metavar="M", help="that a notebook may take (default: 15)")
    command.add_argument("--no-sandbox", action="store_true", help="run student code as you, with all your rights")
    command.add_argument("--again", action="store_true", help="grade also what has been graded before")
    command.set_defaults(run=_grade)


def _grade(options) -> None:
    require_nbgrader()
    from hdr_helpers.grading._running.sandbox import Bounds
    from hdr_helpers.grading.grade import Options, grade

    if options.workers < 1:
        raise InstructorError(f"--workers {options.workers}: at least 1 is needed.")
    asked = {"memory": options.memory, "notebook": options.minutes and 60 * options.minutes}
    bounds = Bounds(**{name: value for name, value in asked.items() if value is not None})
    sandboxed = not options.no_sandbox
    how = Options(options.workers, options.scheduler, options.seed, bounds, sandboxed, options.again)
    grade(options.submissions, options.out, how)


def _add_stage(commands) -> None:
    command = commands.add_parser(
        "stage",
        help=f"lay the notebooks out in {BUILD}/source for nbgrader's own commands",
        description=f"Write each notebook to {BUILD}/source/NAME/NAME.ipynb in the course folder, where "
        "nbgrader_config.py tells nbgrader and its formgrader to look. What an earlier run wrote there is replaced.",
    )
    command.set_defaults(run=_stage)


def _stage(options) -> None:
    for name in stage(source_notebooks()):
        print(f"{BUILD}/source/{name}/{name}.ipynb")


def _add_pages(commands) -> None:
    command = commands.add_parser(
        "pages",
        help="make the course's web pages, without solutions",
        description="Write the README and the notebooks with their outputs, but without solutions, as static web pages "
        "that need no network. Needs the extra 'pages'.",
    )
    _add_out(command, "pages", "folder to write to")
    command.set_defaults(run=_pages)


def _pages(options) -> None:
    from hdr_helpers.grading.web import write_pages

    print(f"The first page is {write_pages(options.out)[0]}")


if __name__ == "__main__":
    sys.exit(main())
