"""Checks of notebook 5: Reinhard's operator by OpenCV, and the global one."""

import cv2
import numpy as np

from hdr_helpers.lab.checks._running import Wrong
from hdr_helpers.lab.checks._todos import Todo
from hdr_helpers.lab.checks._words import array, close, recognised
from hdr_helpers.tonemap import luminance


def _by_opencv(radiance, gamma=1.5, intensity=0.0, light_adapt=0.0, color_adapt=0.0):
    shown = cv2.createTonemapReinhard(gamma, intensity, light_adapt, color_adapt).process(
        np.asarray(radiance, np.float32)
    )
    return np.fmin(np.fmax(shown, 0), 1)  # of NaN and a number, the number


reinhard_by_opencv = Todo(
    "5.1",
    "reinhard_by_opencv",
    _by_opencv,
    barred=("tonemap",),
    hints=(
        "createTonemapReinhard takes four numbers. In which order? The table above this cell says.",
        "What happens if one object makes two pictures? Where, then, is it to be made?",
        "Which values may come out that are no colour, and which two functions of NumPy deal with them?",
    ),
    praise="Right. Now see what a single hot pixel does to it.",
)


def _map(trial, key, shape=(26, 33)):
    """A radiance map of eight stops or so, with an asymmetric colour and a bright lamp."""
    rng = trial.rng(51, key)
    scene = np.exp(rng.normal(0, 1.3, (*shape, 1)) + 0.4 * rng.standard_normal((*shape, 3)) + [0.7, 0, -0.8])
    scene[3:6, 4:9] = (9.0, 3.0, 0.5)
    return (scene * float(rng.uniform(0.3, 4))).astype(np.float32)


def _picture(value, shape, what="The picture"):
    if isinstance(value, np.ndarray) and value.dtype.kind in "iu":
        raise Wrong(
            f"{what} is {value.dtype}; it should be floats from 0 to 1, for 8 bits come last, when it is saved."
        )
    array(value, what, shape, "f")
    bad = int(np.sum(~np.isfinite(value)))
    if bad:
        raise Wrong(f"{bad} values of the picture are NaN or infinite: np.nan_to_num, and is there a 0 in a logarithm?")
    if value.max() > 2:
        raise Wrong(f"{what} reaches {value.max():.4g}; it should lie in 0..1.")
    if value.min() < 0 or value.max() > 1:
        raise Wrong(f"{what} runs from {value.min():.4g} to {value.max():.4g}: clip it to 0..1, or uint8 wraps round.")
    return value


@reinhard_by_opencv.part(1, "The picture is (H, W, 3), floats in 0..1.")
def _(trial):
    for key in (1, 2):
        radiance = _map(trial, key)
        _picture(trial.run(radiance), radiance.shape)
    holed = _map(trial, 3)
    holed[0, :4] = 0  # black, as an aligned bracket leaves it: OpenCV makes NaN of it
    if not np.isfinite(trial.run(holed)).all():
        raise Wrong("A pixel without light makes NaN of the picture: finish with np.nan_to_num and np.clip.")


@reinhard_by_opencv.part(1, "It is Reinhard's with gamma 1.5 and the rest 0.")
def _(trial):
    for key in (1, 2):
        radiance = _map(trial, key)
        picture, spec = trial.run(radiance), _by_opencv(radiance)
        trial.compare("picture", picture, spec)
        if close(picture, spec, 2e-3):
            continue
        bgr = np.ascontiguousarray(radiance[..., ::-1])
        raise Wrong(
            recognised(
                picture,
                {
                    "Red and blue are swapped in the picture: what goes in as RGB comes out as RGB.": spec[..., ::-1],
                    "The channels were swapped before, and not back after: red and blue change places.": _by_opencv(
                        bgr
                    ),
                    "Luminance was taken of BGR: this operator wants RGB, as the map is.": _by_opencv(bgr)[..., ::-1],
                    "light_adapt is left at its default, 1; it should be 0.": _by_opencv(radiance, light_adapt=1.0),
                    "gamma is 1, the default; it should be 1.5.": _by_opencv(radiance, 1.0),
                    "gamma and light_adapt are left at their defaults, 1.": _by_opencv(radiance, 1.0, 0, 1.0, 0),
                    "gamma is 2.2; it should be 1.5.": _by_opencv(radiance, 2.2),
                    "The parameters are in another order: gamma comes first, then intensity.": _by_opencv(
                        radiance, 1.0, 1.5, 0, 0
                    ),
                    "color_adapt is 1; it should be 0.": _by_opencv(radiance, 1.5, 0, 0, 1.0),
                    "The map was put through a logarithm first; the operator wants the light itself.": _by_opencv(
                        np.log(radiance)
                    ),
                    "The picture was stretched once more; leave OpenCV's values as they are.": spec / spec.max(),
                    "It is clipped before tone mapping; then all that is above 1 is lost.": _by_opencv(
                        np.clip(radiance, 0, 1)
                    ),
                },
                "The picture is not OpenCV's with gamma 1.5, intensity 0, light_adapt 0 and color_adapt 0.",
                2e-3,
            )
        )


@reinhard_by_opencv.part(1, "The same map gives the same picture, however often it is called.")
def _(trial):
    one, other = _map(trial, 1), _map(trial, 4)
    first = trial.run(one)
    trial.run(other)
    again = trial.run(one)
    trial.compare("the same map again", again, first)
    if not close(first, again, 1e-6):
        raise Wrong(
            "The same map gives another picture the second time: the object changes its own state; make one each time."
        )
    if not close(first, _by_opencv(one), 0.2):
        raise Wrong("The picture is the same each time, but far from OpenCV's.")


def _global(radiance, key=0.18, white=50.0, gamma=2.2, average=None, by=None, bend=None):
    """The operator with another average, another luminance or another curve, where these are given."""
    light = np.maximum(luminance(radiance) if by is None else by, 1e-30).astype(np.float64)
    average = np.exp(np.log(light).mean()) if average is None else average
    with np.errstate(all="ignore"):
        x = light * (key / average)
        shown = (x + (x / white) ** 2) / (1 + x) if bend is None else bend(x, white)
        ratio = shown / light
        return np.clip(np.moveaxis(np.moveaxis(radiance, 2, 0) * ratio, 0, 2), 0, 1) ** (1 / gamma)


reinhard_global = Todo(
    "5.2",
    "reinhard_global",
    lambda radiance, key=0.18, white=50.0, gamma=2.2: _global(radiance, key, white, gamma).astype(np.float32),
    barred=("tonemap", "opencv_tonemap"),
    hints=(
        "The log average has three steps: which one comes first, which last, and what is between them?",
        "After scaling, what is the luminance of a pixel that is as bright as the average?",
        "L_white is a luminance after scaling. What does equation 4 give for it, if you put it in?",
        "By how much is each pixel multiplied so that its luminance becomes L_d and its colour stays?",
    ),
    praise="Your own operator. Turn key: which part of the picture changes least?",
)


@reinhard_global.part(1, "The picture is (H, W, 3), floats in 0..1.")
def _(trial):
    for key in (1, 2):
        radiance = _map(trial, key)
        radiance[8, 9] = (4000, 900, 90)  # a lamp whose red is far above white
        value = trial.run(radiance)
        if isinstance(value, np.ndarray) and value.shape == radiance.shape[:2]:
            raise Wrong("The picture has no colour: it is the luminance alone; multiply each pixel by L_d / L.")
        _picture(value, radiance.shape)


@reinhard_global.part(2, "It is equation 4, and key, white and gamma do what they say.")
def _(trial):
    for key, given in (
        (1, {}),
        (2, {"key": 0.5}),
        (3, {"white": 1.7}),
        (4, {"gamma": 1.3}),
        (5, {"key": 0.3, "white": 3.0}),
    ):
        radiance = _map(trial, key, (9, 11))  # few pixels, so that their number can be told from 1
        picture, spec = trial.run(radiance, **given), _global(radiance, **given)
        trial.compare("picture", picture, spec)
        if close(picture, spec, 2e-3):
            continue
        names, default = " and ".join(given), _global(radiance)
        key_, white = given.get("key", 0.18), given.get("white", 50.0)
        light, gamma = luminance(radiance).astype(np.float64), given.get("gamma", 2.2)
        plain, bgr = radiance.mean(axis=2), luminance(radiance[..., ::-1])
        scale, sums = key_ / np.exp(np.log(light).mean()), np.log(light).sum()

        def changed(given=given, radiance=radiance, **how):
            return _global(radiance, **(given | how))

        each = radiance.astype(np.float64) * scale
        shown = radiance * (_bent(light * scale, white) / light)[..., None]
        with np.errstate(all="ignore"):
            suspects = {
                "The average has no logarithm in it: a few lamps move the plain mean.": changed(average=light.mean()),
                "The log average lacks its exponential: the mean of the logarithms was taken as it is.": changed(
                    average=np.log(light).mean()
                ),
                "The log average is exp(log(sum) / n): the logarithm belongs to each pixel, before the sum.": changed(
                    average=np.exp(np.log(light.sum()) / light.size)
                ),
                "The log average has 1/n outside of the exponential, the paper's misprint.": changed(
                    average=np.exp(sums) / light.size
                ),
                "The average is the median; equation 1 asks for the log average.": changed(average=np.median(light)),
                "The log average is taken over all channels, not over the luminance.": changed(
                    average=np.exp(np.log(radiance).mean())
                ),
                "The log average is missing: key multiplies the map as it is.": changed(average=1.0),
                "White is not squared; equation 4 has L' / L_white^2.": changed(
                    bend=lambda x, v: x * (1 + x / v) / (1 + x)
                ),
                "White is in the map's own units: it should be compared with the scaled luminance.": changed(
                    bend=lambda x, v, s=scale: x * (1 + x / (v * s) ** 2) / (1 + x)
                ),
                "White is never used: that is equation 3, L' / (1 + L').": changed(bend=lambda x, v: x / (1 + x)),
                "The scaled luminance was not bent: L' itself is shown.": changed(bend=lambda x, v: x),
                "Gamma is used upside down: a picture is raised to 1 / gamma.": np.clip(changed(gamma=1.0), 0, 1)
                ** gamma,
                "Gamma is missing: the picture is still linear.": changed(gamma=1.0),
                "Red and blue are swapped in the picture.": spec[..., ::-1],
                "Luminance was taken of BGR: use luminance(radiance).": changed(by=bgr),
                "Luminance is not the plain mean of the channels: use luminance(radiance).": changed(by=plain),
                "Each channel was bent alone, which changes the colours; bend the luminance.": np.clip(
                    each * (1 + each / white**2) / (1 + each), 0, 1
                )
                ** (1 / gamma),
                "Gamma was applied to the luminance alone; it belongs to the whole picture, last.": np.clip(
                    radiance * (_bent(light * scale, white) ** (1 / gamma) / light)[..., None], 0, 1
                ),
                "The pixel is divided by the scaled luminance, not by its own: colours become too weak.": np.clip(
                    shown / scale, 0, 1
                )
                ** (1 / gamma),
                "The picture was stretched to its maximum; then key has no say.": (shown / shown.max()) ** (1 / gamma),
            }
        if given and close(picture, default, 2e-3):
            raise Wrong(f"{names} changes nothing: it is read and never used.")
        for name, value in given.items():
            if len(given) == 1 and close(picture, _global(radiance, **{name: 1.0}), 2e-3):
                raise Wrong(f"{name} is 1 whatever is asked for; {value:g} was asked for.")
        other = f" with {names} = {', '.join(f'{v:g}' for v in given.values())}" if given else ""
        raise Wrong(recognised(picture, suspects, f"The picture is not what equation 4 gives{other}.", 2e-3))


def _bent(x, white):
    return (x + (x / white) ** 2) / (1 + x)


@reinhard_global.part(1, "Ten times the light gives the same picture, and an even grey becomes 0.4254.")
def _(trial):
    radiance = _map(trial, 6)
    once, ten = trial.run(radiance), trial.run(10 * radiance)
    trial.compare("the same scene, ten times the light", ten, once)
    if not close(once, ten, 2e-3):
        raise Wrong("Ten times the light gives another picture; the log average should take every scale out.")
    grey = trial.run(np.full((2, 3, 3), 5.0))
    trial.compare("an even grey", grey, np.full((2, 3, 3), 0.4254))
    if not close(grey, np.full((2, 3, 3), 0.42536), 1e-3):
        raise Wrong(
            f"An even grey becomes {float(np.mean(grey)):.4f}; it is brought to 0.18, bent, and raised to 1/2.2."
        )
