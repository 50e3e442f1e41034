"""The instructor's commands: python -m hdr_helpers.grading release [-o DIR]"""

import argparse
import sys
from pathlib import Path

from hdr_helpers.grading.course import BUILD, ROOT, InstructorError, source_notebooks, stage
from hdr_helpers.grading.release import TOP, release


def main(arguments=None) -> int:
    """Run the command line. Returns the exit code: 0 done, 1 it can't be done (2 is argparse's)."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a name that the console can't print must not end the run
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
    _add_stage(commands)
    return parser


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
    command.add_argument(
        "-o",
        "--out",
        type=Path,
        default=ROOT / BUILD / TOP,
        metavar="DIR",
        help=f"folder to make (default: {BUILD}/{TOP} in the course folder)",
    )
    command.add_argument("--overwrite", action="store_true", help="replace an earlier student edition in DIR")
    command.set_defaults(run=_release)


def _release(options) -> None:
    folder, archive = release(options.out, options.overwrite)
    print(f"The student edition is {folder}")
    print(f"and, to hand out, {archive} ({archive.stat().st_size / 1e6:.1f} MB).")


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


if __name__ == "__main__":
    sys.exit(main())
