"""Answers to the TODOs of notebook 5."""

import cv2
import numpy as np
from mistakes.corpus import answer, right, slip, wrong

answer(
    "5.1",
    """
    def reinhard_by_opencv(radiance):
        tonemapper = cv2.createTonemapReinhard(1.5, 0, 0, 0)
        ldr = tonemapper.process(radiance)
        ldr = np.nan_to_num(ldr)
        return np.clip(ldr, 0, 1)
    """,
)
slip("5.1", "defaults", "createTonemapReinhard(1.5, 0, 0, 0)", "createTonemapReinhard()")
slip("5.1", "light_adapt", "createTonemapReinhard(1.5, 0, 0, 0)", "createTonemapReinhard(1.5)")
slip("5.1", "gamma is 2.2", "1.5, 0, 0, 0", "2.2, 0, 0, 0")
slip("5.1", "another order", "1.5, 0, 0, 0", "1.0, 1.5, 0, 0")
slip("5.1", "color_adapt", "1.5, 0, 0, 0", "1.5, 0, 0, 1")
slip("5.1", "Red and blue", "return np.clip(ldr, 0, 1)", "return np.clip(ldr, 0, 1)[..., ::-1]")
slip("5.1", "not back", "process(radiance)", "process(cv2.cvtColor(radiance, cv2.COLOR_RGB2BGR))")
slip("5.1", "NaN", "ldr = np.nan_to_num(ldr)", "pass")
slip("5.1", "uint8", "return np.clip(ldr, 0, 1)", "return (255 * np.clip(ldr, 0, 1)).astype(np.uint8)")
slip("5.1", "0..1", "return np.clip(ldr, 0, 1)", "return 255 * ldr")
slip("5.1", "clipped before", "process(radiance)", "process(np.clip(radiance, 0, 1))")
slip("5.1", "logarithm", "process(radiance)", "process(np.log(np.maximum(radiance, 1e-9)))")
slip("5.1", "None", "return np.clip(ldr, 0, 1)", "np.clip(ldr, 0, 1, out=ldr)")
slip("5.1", "stops with error", "process(radiance)", "process(radiance.astype(np.uint8))")

ONE = cv2.createTonemapReinhard(1.5, 0, 0, 0)


@wrong("5.1", says="state")
def one_object_for_all(radiance):
    return np.clip(np.nan_to_num(ONE.process(radiance)), 0, 1)


@wrong("5.1", says="calls tonemap,")
def the_courses_tonemap(radiance):
    from hdr_helpers import tonemap

    return tonemap(radiance, "reinhard", gamma=1.5, intensity=0, light_adapt=0)


@right("5.1")
def named_and_in_place(radiance):
    operator = cv2.createTonemapReinhard(gamma=1.5, intensity=0.0, light_adapt=0.0, color_adapt=0.0)
    picture = operator.process(radiance.copy())
    picture[np.isnan(picture)] = 0
    return np.minimum(np.maximum(picture, 0), 1)


answer(
    "5.2",
    """
    def reinhard_global(radiance, key=0.18, white=50.0, gamma=2.2):
        L = luminance(radiance)
        average = np.exp(np.mean(np.log(L)))
        Ls = key / average * L
        Ld = Ls * (1 + Ls / white**2) / (1 + Ls)
        picture = radiance * (Ld / L)[:, :, None]
        return np.clip(picture, 0, 1) ** (1 / gamma)
    """,
)
AVERAGE = "np.exp(np.mean(np.log(L)))"
slip("5.2", "no logarithm", AVERAGE, "np.mean(L)")
slip("5.2", "lacks its exponential", AVERAGE, "np.mean(np.log(L))")
slip("5.2", "before the sum", AVERAGE, "np.exp(np.log(np.sum(L)) / L.size)")
slip("5.2", "misprint", AVERAGE, "np.exp(np.sum(np.log(L))) / L.size")
slip("5.2", "median", AVERAGE, "np.median(L)")
slip("5.2", "all channels", AVERAGE, "np.exp(np.mean(np.log(radiance)))")
slip("5.2", "log average is missing", "key / average * L", "key * L")
slip("5.2", "not squared", "white**2", "white")
slip("5.2", "own units", "white**2", "(white * key / average) ** 2")
slip("5.2", "white changes nothing", "Ls * (1 + Ls / white**2) / (1 + Ls)", "Ls / (1 + Ls)")
slip("5.2", "not bent", "Ls * (1 + Ls / white**2) / (1 + Ls)", "Ls")
slip("5.2", "upside down", "** (1 / gamma)", "** gamma")
slip("5.2", "still linear", "** (1 / gamma)", "** 1.0")
slip("5.2", "gamma changes nothing", "(1 / gamma)", "(1 / 2.2)")
slip("5.2", "key changes nothing", "key / average", "0.18 / average")
slip("5.2", "white changes nothing", "white**2", "2500")
slip("5.2", "Red and blue", "return np.clip(picture, 0, 1)", "return np.clip(picture, 0, 1)[..., ::-1]")
slip("5.2", "BGR", "luminance(radiance)", "luminance(radiance[..., ::-1])")
slip("5.2", "plain mean of the channels", "luminance(radiance)", "radiance.mean(axis=2)")
slip(
    "5.2",
    "bent alone",
    "radiance * (Ld / L)[:, :, None]",
    "key / average * radiance; picture = picture * (1 + picture / white**2) / (1 + picture)",
)
slip("5.2", "scaled luminance, not by its own", "(Ld / L)", "(Ld / Ls)")
slip(
    "5.2",
    "luminance alone",
    "return np.clip(picture, 0, 1) ** (1 / gamma)",
    "return np.clip(radiance * (Ld ** (1 / gamma) / L)[:, :, None], 0, 1)",
)
slip("5.2", "no colour", "radiance * (Ld / L)[:, :, None]", "Ld")
slip("5.2", "clip", "np.clip(picture, 0, 1)", "picture")
slip(
    "5.2",
    "uint8",
    "return np.clip(picture, 0, 1) ** (1 / gamma)",
    "return (255 * picture ** (1 / gamma)).astype(np.uint8)",
)
slip("5.2", "maximum", "np.clip(picture, 0, 1)", "(picture / picture.max())")
slip("5.2", "ValueError", "(Ld / L)[:, :, None]", "(Ld / L)")


@wrong("5.2", says="calls createTonemapReinhard,")
def opencvs_other_reinhard(radiance, key=0.18, white=50.0, gamma=2.2):
    return np.clip(cv2.createTonemapReinhard(gamma, 0, 0, 0).process(radiance), 0, 1)


@right("5.2")
def with_delta_in_double_precision(radiance, key=0.18, white=50.0, gamma=2.2):
    light = np.dot(radiance.astype(np.float64), [0.2126, 0.7152, 0.0722])
    x = key * light / np.exp(np.log(1e-6 + light).sum() / light.size)
    shown = (x + x**2 / white**2) / (x + 1)
    colours = [radiance[..., c] / light * shown for c in range(3)]
    return np.power(np.clip(np.dstack(colours), 0, 1), 1 / gamma).astype(np.float32)
