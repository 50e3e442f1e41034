"""The whole way without a notebook: python -m hdr_helpers BRACKET [-o OUT]"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from hdr_helpers.align import align_mtb, crop_bracket, remove_ghosts, unaligned
from hdr_helpers.crf import recover_crf
from hdr_helpers.load import Bracket, load_bracket
from hdr_helpers.merge import clipping, merge_debevec, write_hdr, write_whole
from hdr_helpers.tonemap import OPERATORS, dynamic_range_stops, tonemap, write_picture

RADIANCE, CURVE, PLOT, PICTURE = "radiance.hdr", "crf.csv", "crf.png", "picture.png"


def forgive_the_console() -> None:
    """See to it that a name which the console can't print does not end the run."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def main(arguments=None) -> int:
    """Run the command line. Returns the exit code: 0 done, 1 input or output can't be used (2 is argparse's)."""
    forgive_the_console()
    options = _parser().parse_args(arguments)
    place = options.bracket.resolve()
    out = options.out or Path(f"{place.name if place.is_dir() else place.stem}_hdr")
    try:
        _check_output(out, options.bracket, options.overwrite)
        started = time.perf_counter()
        bracket = load_bracket(options.bracket)
        _run(bracket, out, options)
    except (ValueError, OSError) as problem:
        print(f"hdr_helpers: {problem}", file=sys.stderr)
        return 1
    except MemoryError:
        print("hdr_helpers: Not enough memory for photographs of this size; scale them down first.", file=sys.stderr)
        return 1
    print(f"\nDone in {time.perf_counter() - started:.1f} s. The picture is {out / PICTURE}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m hdr_helpers",
        description="Merge photographs of one scene, taken with different exposure times, into a radiance "
        "map; recover the camera's response curve; tone-map a picture.",
        epilog=f"Written to OUT: {RADIANCE} (Radiance RGBE), {CURVE} and {PLOT} (log exposure of each pixel "
        f"value), {PICTURE} (tone-mapped). Exposure times are taken from a text file beside the "
        "photographs, from the file names or from EXIF, in this order. "
        "Exit code: 0 done, 1 the input or the output can't be used, 2 wrong usage.",
    )
    parser.add_argument("bracket", type=Path, metavar="BRACKET", help="folder or zip with the photographs")
    parser.add_argument("-o", "--out", type=Path, help="folder to write to (default: BRACKET's name and _hdr)")
    parser.add_argument("--overwrite", action="store_true", help="replace results of an earlier run in OUT")
    parser.add_argument("--no-align", action="store_true", help="the photographs lie on each other already")
    parser.add_argument("--keep-ghosts", action="store_true", help="merge all photographs even where something moved")
    parser.add_argument("--lam", type=_positive, default=1.0, help="smoothness of the curve (default: %(default)g)")
    parser.add_argument(
        "--tonemap", choices=sorted(OPERATORS), default="durand", help="operator (default: %(default)s)"
    )
    return parser


def _positive(text: str) -> float:
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value


def _check_output(out: Path, bracket: Path, overwrite: bool) -> None:
    if out.exists() and not out.is_dir():
        raise FileExistsError(f"{out} is a file; give a folder to write to with -o.")
    if out.resolve() == bracket.resolve():
        # The next run would take the picture for a photograph.
        raise FileExistsError(f"{out} holds the photographs; give another folder for the results with -o.")
    there = [name for name in (RADIANCE, CURVE, PLOT, PICTURE) if (out / name).exists()]
    if there and not overwrite:
        raise FileExistsError(f"{out} already holds {', '.join(there)}; give another folder with -o, or --overwrite.")


def _spelled(dx, dy, degrees) -> str:
    return f"{dx:+.1f} {dy:+.1f} {degrees:+.2f}" if degrees else f"{dx:+.0f} {dy:+.0f}"


def _run(bracket: Bracket, out: Path, options) -> None:
    # Only now: drawing is slow to import, and a typing error should not wait for it.
    from hdr_helpers.lab.data import with_truth
    from hdr_helpers.lab.figures import crf_figure, png_bytes
    from hdr_helpers.lab.metrics import radiance_error

    height, width = bracket.images[0].shape[:2]
    print(f"{len(bracket)} photographs of {width} x {height} pixels; exposure times from {bracket.source}.")
    for note in bracket.notes:
        print(f"Note: {note}")

    bracket = with_truth(bracket, options.bracket)
    alignment = unaligned(bracket.images) if options.no_align else align_mtb(bracket.images, valid=bracket.valid)
    aligned = crop_bracket(bracket, alignment)
    shares = clipping(aligned.images, aligned.valid)
    print(f"\n{'photograph':24} {'time (s)':>10} {'moved by (px, degrees)':>23} {'too dark':>9} {'too bright':>11}")
    motions = [_spelled(*s, r) for s, r in zip(alignment.shifts, alignment.rotations, strict=True)]
    doubts = [alignment.doubt(k) for k in range(len(bracket))]
    rows = zip(bracket.names, bracket.times, motions, shares.too_dark, shares.too_bright, doubts, strict=True)
    for name, seconds, motion, dark, bright, doubt in rows:
        print(f"{name:24} {seconds:10.6g} {motion:>23} {dark:9.2%} {bright:11.2%}{'  ' * bool(doubt)}{doubt}")
    print(
        f"Clipped in every exposure: {shares.everywhere_bright:.3%} of the pixels are too bright in all of "
        f"them, {shares.everywhere_dark:.3%} too dark."
    )

    if not options.keep_ghosts:
        ghosts = remove_ghosts(aligned)
        if ghosts.moved.any():
            who, share = bracket.names[ghosts.reference], ghosts.moved.mean()
            print(
                f"In {share:.2%} of the frame the photographs disagree, as where something moved; there {who} decides."
            )
        aligned = ghosts.bracket

    print("\nRecovering the response, merging, tone-mapping ...", flush=True)
    response = recover_crf(aligned, lam=options.lam)
    crf, errors = response.crf, response.errors
    print(f"The response is recovered by {response.method}.")
    merged = merge_debevec(aligned.images, aligned.times, crf, valid=aligned.valid)
    radiance = merged.radiance
    print(f"Photographs are weighted by {merged.weighting}.")
    print(f"Dynamic range of the scene: {dynamic_range_stops(radiance):.1f} stops (99.9th over 0.1th percentile).")
    picture = tonemap(radiance, options.tonemap)

    if aligned.truth is not None:
        error = radiance_error(radiance, aligned.truth.radiance)
        print(f"The truth is known here: median error {error.median:.3f} stops, 95% below {error.p95:.3f}.")

    names = ["red", "green", "blue"]
    lines = [",".join(["value", *names, *(f"{name}_error" for name in names)])]
    lines += [f"{z}," + ",".join(f"{x:.6f}" for x in row) for z, row in enumerate(np.vstack([crf, errors]).T)]
    out.mkdir(parents=True, exist_ok=True)
    write_hdr(out / RADIANCE, radiance)
    write_whole(out / CURVE, ("\n".join(lines) + "\n").encode())
    write_whole(out / PLOT, png_bytes(crf_figure(crf)))
    write_picture(out / PICTURE, picture)
    print(f"\nWritten to {out}: {RADIANCE}, {CURVE}, {PLOT}, {PICTURE}.")


if __name__ == "__main__":
    sys.exit(main())
