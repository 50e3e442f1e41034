"""Checks of notebook 4 behind the first: three channels merged, and the map in stops."""

from functools import cache

import numpy as np

from hdr_helpers.crf import hat_weights
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.checks._running import Wrong
from hdr_helpers.lab.checks._todos import Todo
from hdr_helpers.lab.checks._words import array, close, finite, recognised
from hdr_helpers.merge import merge_debevec
from hdr_helpers.tonemap import luminance


def _course_my_merge(images, B, crf, w):
    return merge_debevec(images, np.exp(B), crf, w).radiance


my_merge = Todo(
    "4.2",
    "my_merge",
    _course_my_merge,
    uses=("merge_channel",),
    barred=("merge",),
    hints=(
        "What does merge_channel want for Z, and how do you cut one channel out of all photographs at once?",
        "Which curve belongs to which channel?",
        "Three arrays (H, W) become one (H, W, 3): along which axis are they stacked?",
    ),
    praise="A radiance map. Look at it honestly now: what does imshow do to values above 1?",
)


@cache
def _shot(seed, key):
    """Photographs of a scene with an orange patch, taken by the virtual camera."""
    rng = np.random.default_rng((seed, 42, key))
    scene = np.exp2(rng.uniform(-4, 4, (24, 31, 1)) + rng.uniform(-1, 1, (24, 31, 3)))
    scene[4:9, 5:15] = (6.0, 2.0, 0.4)
    return Camera(seed=seed + key, jpeg_quality=None).shoot(scene, 0.01 * 3.0 ** np.arange(5))


@my_merge.part(1, "The map is (H, W, 3), floats, finite and above 0.")
def _(trial):
    shot, w = _shot(trial.seed, 1), hat_weights()
    radiance = trial.run(list(shot.images), shot.log_times, shot.truth.crf, w)
    shape = shot.images[0].shape
    if isinstance(radiance, np.ndarray) and radiance.shape == (3, *shape[:2]):
        raise Wrong(f"The map has shape {radiance.shape}: the channels come first; they should be the last axis.")
    if isinstance(radiance, np.ndarray) and radiance.dtype == np.uint8:
        raise Wrong("The map is uint8: a radiance map is floats, or all that is above 255 is lost.")
    array(radiance, "The map", shape, "f")
    finite(radiance, "the map")


@my_merge.part(2, "Each channel is merged with its own curve, in the order RGB.")
def _(trial):
    for key, w in ((1, hat_weights()), (2, hat_weights() + 1)):
        shot = _shot(trial.seed, key)
        images, B, crf = list(shot.images), shot.log_times, shot.truth.crf
        radiance, spec = (f(images, B, crf, w) for f in (trial.run, _course_my_merge))
        radiance = radiance.astype(np.float64)
        one = (radiance / spec).mean()
        if np.ptp(radiance / spec) < 1e-3 * abs(one) and one > 0:
            if abs(one - 1) > 1e-3:
                trial.note("Your map is the course's times a constant; radiance is relative, so that is well.")
            trial.compare("radiance", radiance / one, spec)
            continue
        trial.compare("radiance", radiance, spec)
        stretched = (spec - spec.min(axis=(0, 1))) / np.ptp(spec, axis=(0, 1))
        scaled = spec / spec.max(axis=(0, 1))
        suspects = {
            "Red and blue are swapped in the map: it is RGB, as the photographs are.": spec[..., ::-1],
            "The curves of red and blue are swapped: crf[0] belongs to channel 0.": _course_my_merge(
                images, B, crf[::-1], w
            ),
            "What comes back is the logarithm of the radiance.": np.log(spec),
            "It is log10 of the radiance; the map holds the light itself.": np.log10(spec),
            "Each channel was stretched from its least to its greatest value, and that changes the colours.": stretched,
            "Each channel was divided by its own maximum, and that changes the colours.": scaled,
            "The map was stretched from its least to its greatest value, which changes all ratios.": (spec - spec.min())
            / np.ptp(spec),
            "All channels hold the light of channel 0.": np.repeat(spec[..., :1], 3, axis=2),
            "All channels hold the light of channel 1.": np.repeat(spec[..., 1:2], 3, axis=2),
            "The weights are always the hat; use those that are given.": _course_my_merge(
                images, B, crf, hat_weights()
            ),
            "The photographs are in reverse order, so each has the time of another.": _course_my_merge(
                images[::-1], B, crf, w
            ),
        }
        for c, name in enumerate(("red", "green", "blue")):
            suspects[f"The curve of {name} was used for all channels; each has its own."] = _course_my_merge(
                images, B, np.tile(crf[c], (3, 1)), w
            )
        for sentence, value in suspects.items():
            if value is not None and np.allclose(radiance, value, rtol=1e-3, atol=1e-6):
                raise Wrong(sentence)
        raise Wrong("The map is not what merge_channel gives for each channel with its own curve.")


@my_merge.part(1, "Without the last photograph E stays where it was.")
def _(trial):
    shot, w = _shot(trial.seed, 3), hat_weights()
    w[:20] = w[235:] = 0
    images, B, crf = list(shot.images), shot.log_times, shot.truth.crf
    every, few = (trial.run(images[:n], B[:n], crf, w) for n in (5, 4))
    stack = np.array(images[:4])
    seen = ((stack > 30) & (stack < 225)).any(axis=0)
    apart = np.abs(np.log2(few[seen] / every[seen]))
    trial.compare("stops without the last", np.median(apart), 0)
    if not np.median(apart) < 0.1:
        raise Wrong(
            f"Without the last photograph the light changes by {np.median(apart):.2f} stops in the middle of the map; "
            "it should stay where it was."
        )


stops_above_median = Todo(
    "4.3",
    "stops_above_median",
    lambda radiance: np.log2(luminance(radiance)) - np.log2(np.median(luminance(radiance))),
    barred=("merge",),
    hints=(
        "What is one stop: a difference or a ratio of light?",
        "Of which numbers is the median taken: of three channels, or of the luminance?",
        "Which logarithm counts doublings?",
    ),
    praise="Now the map can be read as numbers. How many stops are there between its 0.1th and 99.9th percentile?",
)


def _light(trial, key):
    rng = trial.rng(43, key)
    return np.exp(rng.normal(1, 2, (15, 21, 1)) + rng.normal(0, 0.7, (15, 21, 3)) + [0.5, 0, -0.9]).astype(np.float32)


@stops_above_median.part(1, "It returns (H, W) finite floats.")
def _(trial):
    radiance = _light(trial, 1)
    finite(array(trial.run(radiance), "The map in stops", radiance.shape[:2], "f"), "the map in stops")


@stops_above_median.part(1, "They are the doublings from the median luminance.")
def _(trial):
    for key in (1, 2):
        radiance = _light(trial, key)
        stops, light = trial.run(radiance), luminance(radiance).astype(np.float64)
        spec = np.log2(light / np.median(light))
        trial.compare("stops", stops, spec)
        if close(stops, spec, 1e-3):
            continue
        raise Wrong(
            recognised(
                stops,
                {
                    "It is a natural logarithm; a stop is a doubling, so the logarithm is that of base 2.": np.log(
                        light / np.median(light)
                    ),
                    "It is a logarithm of base 10; a stop is a doubling.": np.log10(light / np.median(light)),
                    "It is the ratio itself, without a logarithm.": light / np.median(light),
                    "It is the difference from the median; a stop is a ratio.": light - np.median(light),
                    "The sign is turned round: what is brighter than the median lies above 0.": -spec,
                    "It is compared with the mean; a few lamps move the mean, and not the median.": np.log2(
                        light / light.mean()
                    ),
                    "The median is that of all three channels, not of the luminance.": np.log2(
                        light / np.median(radiance)
                    ),
                    "It is the luminance's logarithm alone; the median is missing.": np.log2(light),
                    "It is compared with the brightest pixel, not with the median.": np.log2(light / light.max()),
                    "Luminance is not the plain mean of the channels: use luminance(radiance).": np.log2(
                        radiance.mean(axis=2) / np.median(radiance.mean(axis=2))
                    ),
                },
                "It is not log2 of luminance over its median.",
                1e-3,
            )
        )
