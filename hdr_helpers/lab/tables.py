"""Tables that notebooks print, so that their cells show what is computed and not how it is laid out."""

from hdr_helpers.lab.figures import seconds
from hdr_helpers.lab.metrics import crf_rmse, psnr_l, psnr_mu, radiance_error


def print_crf_errors(curves: dict, truth) -> None:
    """Root mean square error of curves, name -> (3, 256), over the values 5..250 in stops, the gauge removed.

    curves : dictionary of log inverse responses; truth : (3, 256)

    >>> import numpy as np
    >>> print_crf_errors({"exact": np.zeros((3, 256))}, np.zeros((3, 256)))
             red  green   blue
    exact  0.000  0.000  0.000
    """
    width = max(map(len, curves))
    print(" " * width + "    red  green   blue")
    for name, curve in curves.items():
        print(f"{name:{width}} " + " ".join(f"{error:6.3f}" for error in crf_rmse(curve, truth)))


def print_merges(maps: dict, truth) -> None:
    """How far radiance maps, name -> (H, W, 3), are from the truth: error in stops, PSNR-mu and PSNR-L in dB.

    maps : dictionary of radiance maps; truth : (H, W, 3)

    >>> import numpy as np
    >>> truth = np.ones((2, 3, 3))
    >>> print_merges({"mine": truth * [[[1], [1], [2]]]}, truth)  # a third of it is a stop too bright
           median error   95% better than   PSNR-mu   PSNR-L
    mine     0.000 stops       1.000 stops ... dB   4.8 dB
    """
    width = max(map(len, maps))
    print(" " * width + "   median error   95% better than   PSNR-mu   PSNR-L")
    for name, radiance in maps.items():
        error = radiance_error(radiance, truth)
        stops = f"{error.median:9.3f} stops {error.p95:11.3f} stops"
        print(f"{name:{width}} {stops} {psnr_mu(radiance, truth):6.1f} dB {psnr_l(radiance, truth):5.1f} dB")


def print_motions(times, motions: dict, alignment) -> None:
    """How each photograph was moved, by several answers, and how sure align_mtb is of its own.

    times : (P,) seconds
    motions : from a name to (P, 2) shifts in pixels, or to (P, 3) shifts and degrees
    alignment : Alignment, whose percentiles, blocks and doubts stand in the last column

    >>> import numpy as np
    >>> from hdr_helpers.align import unaligned
    >>> print_motions([0.5, 1], {"mine": [(3, -1), (0, 0)]}, unaligned(np.zeros((2, 4, 6, 3))))
        time        mine   percentile, blocks that agree
       0.5 s    (+3, -1)   -
         1 s    (+0, +0)   the reference
    """
    width = 11 if all(len(rows[0]) == 2 for rows in motions.values()) else 23
    print(f"{'time':>8} " + "".join(f"{name:>{width}}" for name in motions) + "   percentile, blocks that agree")
    for k, time in enumerate(times):
        row = "".join(f"{_spelled(*rows[k]):>{width}}" for rows in motions.values())
        print(f"{seconds(time):>8} {row}   {_how(alignment, k)}")


def _spelled(dx, dy, degrees=None) -> str:
    if degrees is None:
        return f"({dx:+.0f}, {dy:+.0f})"
    return f"({dx + 0.0:+.2f}, {dy + 0.0:+.2f}) {degrees + 0.0:+.3f}°"


def _how(alignment, k) -> str:
    match, doubt = alignment.matches[k], alignment.doubt(k)
    if k == alignment.reference:
        return "the reference"
    how = "-"
    if match is not None:
        percentile = "-" if match.percentile is None else f"{match.percentile:g}"
        how = f"{percentile}, {match.agree}/{match.blocks}"
    return f"{how}   doubtful: {doubt}" if doubt else how
