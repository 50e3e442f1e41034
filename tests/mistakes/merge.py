"""Answers to the TODOs of notebook 4."""

import cv2
import numpy as np
from mistakes.corpus import answer, right, slip, wrong

from hdr_helpers.tonemap import luminance

answer(
    "4.1",
    """
    def merge_channel(Z, B, g, w):
        P, H, W = Z.shape
        top = np.zeros((H, W))
        total = np.zeros((H, W))
        for j in range(P):
            wj = w[Z[j]]
            top += wj * (g[Z[j]] - B[j])
            total += wj
        nearest = np.where(Z[0] >= 128, g[Z[0]] - B[0], g[Z[-1]] - B[-1])
        ln_E = np.where(total > 0, top / np.where(total > 0, total, 1), nearest)
        return np.exp(ln_E)
    """,
)
LN_E = "ln_E = np.where(total > 0, top / np.where(total > 0, total, 1), nearest)"
slip("4.1", "comes back is ln E", "return np.exp(ln_E)", "return ln_E")
slip("4.1", "power of 2", "return np.exp(ln_E)", "return 2 ** ln_E")
slip("4.1", "ln t is added", "(g[Z[j]] - B[j])", "(g[Z[j]] + B[j])")
slip("4.1", "times are missing", "(g[Z[j]] - B[j])", "g[Z[j]]")
slip("4.1", "Seconds", "(g[Z[j]] - B[j])", "(g[Z[j]] - np.exp(B[j]))")
slip("4.1", "weights are not used", "wj = w[Z[j]]", "wj = 1.0")
slip("4.1", "squared", "wj = w[Z[j]]", "wj = w[Z[j]] ** 2")
slip("4.1", "hat, not those", "wj = w[Z[j]]", "wj = np.minimum(Z[j], 255 - Z[j]).astype(float)")
slip("4.1", "hat plus 1", "wj = w[Z[j]]", "wj = np.minimum(Z[j], 255 - Z[j]) + 1.0")
slip(
    "4.1",
    "averaged",
    "wj * (g[Z[j]] - B[j])",
    "wj * np.exp(g[Z[j]] - B[j])",
    "np.exp(ln_E)",
    "np.where(total > 0, ln_E, np.exp(nearest))",
)
slip("4.1", "number of photographs", "top / np.where(total > 0, total, 1)", "top / P")
slip("4.1", "Nothing divides", "top / np.where(total > 0, total, 1)", "top")
slip("4.1", "NaN", LN_E, "ln_E = top / total")
slip("4.1", "is 0", LN_E, "ln_E = top / total", "return np.exp(ln_E)", "return np.nan_to_num(np.exp(ln_E))")
slip("4.1", "is 1", LN_E, "ln_E = np.nan_to_num(top / total)")
slip("4.1", "is 1", LN_E, "ln_E = top / (total + 1e-8)")
slip("4.1", "is 1", LN_E, "total[total <= 0] = 1; ln_E = top / total")
slip("4.1", "far below", ", nearest)", ", g[Z[-1]] - B[-1])")
slip("4.1", "far above", ", nearest)", ", g[Z[0]] - B[0])")
slip("4.1", "plain mean", ", nearest)", ", (g[Z] - B[:, None, None]).mean(axis=0))")
slip(
    "4.1",
    "median of the others",
    "return np.exp(ln_E)",
    "E = np.exp(ln_E); E[total == 0] = np.median(E[total > 0]); return E",
)
slip("4.1", "middle photograph", ", nearest)", ", g[Z[P // 2]] - B[P // 2])")
slip("4.1", "integer", "return np.exp(ln_E)", "return np.exp(ln_E).astype(int)")
slip("4.1", "integer", "return np.exp(ln_E)", "return (np.exp(ln_E)).astype(np.uint8)")
slip("4.1", "whole numbers", "return np.exp(ln_E)", "return np.rint(np.exp(ln_E))")
slip("4.1", "UFuncTypeError", "top = np.zeros((H, W))", "top = np.zeros((H, W), dtype=int)")
slip("4.1", "upside down", "return np.exp(ln_E)", "return np.exp(-ln_E)")
slip("4.1", "logarithm already", "(g[Z[j]] - B[j])", "(g[Z[j]] - np.log(abs(B[j])))")
slip("4.1", "times what equation 6", "return np.exp(ln_E)", "return np.exp(ln_E) / np.exp(ln_E).max()")
slip("4.1", "shape", "return np.exp(ln_E)", "return np.exp(ln_E).ravel()")
slip("4.1", "changes the arrays", "P, H, W = Z.shape", "w[0] = w[255] = 1e-3; P, H, W = Z.shape")


@wrong("4.1", says="does a loop")
def never_ends(Z, B, g, w):
    while True:
        try:
            print(Z)
        except Exception:
            continue


@wrong("4.1", says="wrap round")
def hat_of_uint8(Z, B, g, w):
    weights = (127 - np.abs(Z - np.uint8(127))).astype(float)
    said = g[Z] - B[:, None, None]
    return np.exp((weights * said).sum(axis=0) / (weights.sum(axis=0) + 1e-8))


@wrong("4.1", says="calls merge_debevec,")
def the_courses_merge(Z, B, g, w):
    from hdr_helpers.merge import merge_debevec

    return merge_debevec([np.dstack([z] * 3) for z in Z], np.exp(B), np.stack([g] * 3), w).radiance[..., 0]


@right("4.1")
def by_average_in_single_precision(Z, B, g, w):
    said = (g[Z] - B.reshape(-1, 1, 1)).astype(np.float32)
    dead = ~w[Z].any(axis=0)
    weights = np.where(dead, 1, w[Z]).astype(np.float32)
    E = np.exp(np.average(said, axis=0, weights=weights))
    white = dead & (Z[0] > 127)
    E[white], E[dead & ~white] = np.exp(said[0])[white], np.exp(said[-1])[dead & ~white]
    return E


@right("4.1")
def pixel_by_pixel(Z, B, g, w):
    E = np.zeros(Z.shape[1:])
    for y, x in np.ndindex(E.shape):
        z = Z[:, y, x]
        if w[z].sum() > 0:
            E[y, x] = np.exp(np.dot(w[z], g[z] - B) / w[z].sum())
        else:
            j = 0 if z[0] >= 128 else -1
            E[y, x] = np.exp(g[z[j]]) / np.exp(B[j])
    return E


answer(
    "4.2",
    """
    def my_merge(images, B, crf, w):
        radiance = np.zeros(images[0].shape, dtype=np.float32)
        for c in range(3):
            Z = np.array([image[:, :, c] for image in images])
            radiance[:, :, c] = merge_channel(Z, B, crf[c], w)
        return radiance
    """,
)
slip("4.2", "curve of red", "crf[c]", "crf[0]")
slip("4.2", "curves of red and blue", "crf[c]", "crf[2 - c]")
slip("4.2", "Red and blue are swapped in the map", "return radiance", "return radiance[..., ::-1]")
slip("4.2", "channel 0", "image[:, :, c]", "image[:, :, 0]", "crf[c]", "crf[0]")
slip("4.2", "channels come first", "return radiance", "return radiance.transpose(2, 0, 1)")
slip("4.2", "logarithm of the radiance", "return radiance", "return np.log(radiance)")
slip("4.2", "log10", "return radiance", "return np.log10(radiance)")
slip(
    "4.2",
    "least to its greatest",
    "return radiance",
    "low, high = radiance.min((0, 1)), radiance.max((0, 1)); return (radiance - low) / (high - low)",
)
slip(
    "4.2", "stretched from its least", "return radiance", "return cv2.normalize(radiance, None, 0, 1, cv2.NORM_MINMAX)"
)
slip("4.2", "own maximum", "return radiance", "return radiance / radiance.max(axis=(0, 1))")
slip("4.2", "uint8", "dtype=np.float32", "dtype=np.uint8")
slip("4.2", "uint8", "return radiance", "return np.clip(255 * radiance / radiance.max(), 0, 255).astype(np.uint8)")
slip("4.2", "always the hat", "crf[c], w", "crf[c], np.minimum(np.arange(256.0), 255 - np.arange(256.0))")
slip("4.2", "reverse order", "in images])", "in images[::-1]])")
slip("4.2", "IndexError", "range(3)", "range(4)")
slip("4.2", None, "return radiance", "return radiance / radiance.max()", fine=True)
slip("4.2", None, "dtype=np.float32", "dtype=np.float64", fine=True)


@wrong("4.2", says="calls createMergeDebevec,")
def opencv_merges(images, B, crf, w):
    return cv2.createMergeDebevec().process(images, np.exp(B).astype(np.float32))


@right("4.2")
def one_expression(images, B, crf, w):
    Z = np.stack(images)
    weights = w[Z]
    said = np.stack([crf[c][Z[..., c]] for c in range(3)], axis=-1) - B[:, None, None, None]
    total = weights.sum(axis=0)
    bound = np.where(Z[0] >= 128, said[0], said[-1])
    return np.exp(np.where(total > 0, (weights * said).sum(axis=0) / np.where(total > 0, total, 1), bound))


answer(
    "4.3",
    """
    def stops_above_median(radiance):
        L = luminance(radiance)
        return np.log2(L / np.median(L))
    """,
)
slip("4.3", "natural logarithm", "np.log2", "np.log")
slip("4.3", "base 10", "np.log2", "np.log10")
slip("4.3", "mean", "np.median(L)", "np.mean(L)")
slip("4.3", "all three channels", "np.median(L)", "np.median(radiance)")
slip("4.3", "median is missing", "np.log2(L / np.median(L))", "np.log2(L)")
slip("4.3", "without a logarithm", "np.log2(L / np.median(L))", "L / np.median(L)")
slip("4.3", "a stop is a ratio", "np.log2(L / np.median(L))", "L - np.median(L)")
slip("4.3", "sign", "np.log2(L / np.median(L))", "np.log2(np.median(L) / L)")
slip("4.3", "brightest", "np.median(L)", "L.max()")
slip("4.3", "plain mean", "luminance(radiance)", "radiance.mean(axis=2)")
slip("4.3", "shape", "L = luminance(radiance)", "L = radiance")


@right("4.3")
def by_differences_of_logarithms(radiance):
    ln = np.log(np.float64(luminance(radiance)))
    return (ln - np.log(np.median(luminance(radiance)))) / np.log(2)
