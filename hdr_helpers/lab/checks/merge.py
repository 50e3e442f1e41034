"""Check of TODO 4.1, one channel merged. The rest of notebook 4 is in maps.py."""

from functools import cache

import numpy as np

from hdr_helpers.crf import hat_weights
from hdr_helpers.lab.camera import Camera
from hdr_helpers.lab.checks._running import Wrong
from hdr_helpers.lab.checks._todos import Todo
from hdr_helpers.lab.checks._words import array, close, finite, recognised
from hdr_helpers.merge import merge_debevec

LEVELS, TOLERANCE = 256, 1e-4


def _course_merge_channel(Z, B, g, w):
    """By merge_debevec, which looks everything up in tables of a channel; three equal channels are one."""
    images = [np.repeat(z[..., None], 3, axis=2) for z in np.asarray(Z)]
    return merge_debevec(images, np.exp(B), np.tile(g, (3, 1)), w).radiance[..., 0].astype(np.float64)


merge_channel = Todo(
    "4.1",
    "merge_channel",
    _course_merge_channel,
    barred=("merge",),
    hints=(
        "What does one photograph say of ln E? Which three of the arguments stand in it? g[Z] looks up all at once.",
        "Which axis of Z counts the photographs? Sums go along that one. What shape must B have to be subtracted?",
        "The mean is of logarithms. What is asked for in the end?",
        "Where are all the weights 0? Which photograph has the nearest bound for a pixel white in all, and which for "
        "one black in all?",
    ),
    praise="Every pixel has a finite irradiance, the sun included. Now look at three channels.",
)


@cache
def _curves():
    return Camera().crf()


class _Pile:
    """One channel of P photographs of known light; some pixels white, and some black, in all of them."""

    def __init__(self, trial, key, P=5, shape=(14, 19)):
        rng, camera = trial.rng(41, key), Camera()
        self.g, self.B = _curves()[key % 3], np.log(0.02) + np.cumsum(rng.uniform(0.8, 1.5, P))
        middle = np.exp(-self.B.mean())
        E = middle * np.exp(rng.uniform(-5, 0, shape))
        self.white, self.black = np.zeros(shape, bool), np.zeros(shape, bool)
        self.white[2:4, 3:6], self.black[9:11, 12:16] = True, True
        E[self.white] = 1e4 * middle
        E[self.black] = 1e-9 * middle
        values = [camera.respond(E * np.exp(b), key % 3) * 255 + 0.4 * rng.standard_normal(shape) for b in self.B]
        self.Z = np.clip(np.rint(values), 0, 255).astype(np.uint8)
        self.Z[:, self.white], self.Z[:, self.black] = 255, 0
        self.w = hat_weights()
        self.w[:5] = self.w[250:] = 0
        self.measured = self.w[self.Z].sum(axis=0) > 0

    def mean(self, w=None, said=None):
        """Equation 6 in logarithms, NaN where it is 0/0."""
        w = (self.w if w is None else w)[self.Z]
        said = self.g[self.Z] - self.B[:, None, None] if said is None else said
        with np.errstate(all="ignore"):
            return (w * said).sum(axis=0) / w.sum(axis=0)

    @property
    def bound(self):
        said = self.g[self.Z] - self.B[:, None, None]
        return np.exp(np.where(self.Z[0] >= 128, said[0], said[-1]))


@merge_channel.part(1, "E is (H, W), floats.")
def _(trial):
    p = _Pile(trial, 1)
    E = array(trial.run(p.Z, p.B, p.g, p.w), "E", p.Z.shape[1:], "f")
    if np.isnan(E[p.measured]).any():
        raise Wrong("Some pixels are NaN although a photograph has a usable value there.")


@merge_channel.part(2, "Where a value is usable, E is what equation 6 says.")
def _(trial):
    for key, add in ((1, 0), (2, 1)):
        p = _Pile(trial, key)
        w = p.w + add * np.linspace(0.5, 2, LEVELS)  # a second weight, without symmetry and nowhere 0
        E, m = trial.run(p.Z, p.B, p.g, w), p.measured
        said, spec = p.g[p.Z] - p.B[:, None, None], np.exp(p.mean(w))
        trial.compare("ln E of a pixel", np.log(np.abs(E[m]) + 1e-300), np.log(spec[m]))
        if close(E[m] / spec[m], np.ones(m.sum()), TOLERANCE):
            continue
        ones, seconds = np.ones(LEVELS), np.exp(p.B)[:, None, None]
        suspects = {
            "What comes back is ln E: take its exponential, so that it is an irradiance.": np.log(spec),
            "ln t is added; it is to be taken away: the same value in a longer exposure means less light.": np.exp(
                p.mean(w, p.g[p.Z] + p.B[:, None, None])
            ),
            "The times are missing: g(Z) alone is the exposure, not the irradiance.": np.exp(p.mean(w, p.g[p.Z])),
            "The weights are not used: clipped and black values count like all others.": np.exp(p.mean(ones)),
            "The weights are squared; in equation 6 they are not.": np.exp(p.mean(w**2)),
            "The weights are those of a hat, not those in w: use the argument.": np.exp(p.mean(hat_weights())),
            "The weights are the hat plus 1, not those in w: a clipped pixel counts.": np.exp(
                p.mean(hat_weights() + 1)
            ),
            "The weights wrap round: 127 - abs(Z - 127) in uint8, which has no negative numbers.": np.exp(
                p.mean((127 - np.abs(np.arange(256, dtype=np.uint8) - np.uint8(127))).astype(float))
            ),
            "Seconds are subtracted; it is their logarithm, B, that belongs there.": np.exp(
                p.mean(w, p.g[p.Z] - seconds)
            ),
            "The logarithm of B is taken, but B is a logarithm already.": np.exp(
                p.mean(w, p.g[p.Z] - np.log(np.abs(p.B))[:, None, None])
            ),
            "The irradiances are averaged, not their logarithms.": p.mean(w, np.exp(said)),
            "g is taken as an exposure, without its exponential: the mean is of g / t.": p.mean(w, p.g[p.Z] / seconds),
            "It is divided by the number of photographs; equation 6 divides by the sum of the weights.": np.exp(
                (w[p.Z] * said).mean(axis=0)
            ),
            "Nothing divides by the sum of the weights.": np.exp((w[p.Z] * said).sum(axis=0)),
            "The way back is a power of 2, but the curve is one of natural logarithms.": np.exp2(np.log(spec)),
            "The curve is taken upside down: the exponential of minus ln E.": 1 / spec,
        }
        suspects = {sentence: value[m] for sentence, value in suspects.items()}
        if np.array_equal(E, np.rint(E)):
            raise Wrong("E holds whole numbers only: somewhere an integer type cut off what stands behind the point.")
        # Relative, because light has many sizes.
        for sentence, value in suspects.items():
            if np.allclose(E[m], value, rtol=1e-3, atol=0):
                raise Wrong(sentence)
        if not np.all(E[m] > 0):
            raise Wrong("Some E are not above 0; the exponential of a logarithm always is.")
        ratio = E[m] / spec[m]
        if np.ptp(ratio) < 1e-3 * abs(ratio.mean()):
            raise Wrong(f"E is {ratio.mean():.4g} times what equation 6 says, everywhere: was it scaled afterwards?")
        if np.mean(np.abs(ratio - 1) < 1e-3) > 0.25:
            raise Wrong(
                f"{np.mean(np.abs(ratio - 1) > 1e-3):.0%} of the pixels differ from equation 6, the others are right."
            )
        raise Wrong("E is not the weighted mean of g(Z) - ln t.")


@merge_channel.part(2, "Where all weights are 0, E is the nearest bound: the brightest stays brightest.")
def _(trial):
    p = _Pile(trial, 3)
    E, spec = trial.run(p.Z, p.B, p.g, p.w), p.bound
    said = np.exp(p.g[p.Z] - p.B[:, None, None])
    for where, name in ((p.white, "white"), (p.black, "black")):
        trial.compare(f"E where it is {name} in all", E[where], spec[where])
        if close(E[where] / spec[where], np.ones(where.sum()), TOLERANCE):
            continue
        value, one = E[where], np.ones(where.sum())
        start = f"Where a pixel is {name} in every photograph E is"
        hole = " the sun becomes a dark hole." if name == "white" else " an unknown is given out as a measurement."
        raise Wrong(
            recognised(
                value,
                {
                    f"{start} NaN, 0/0: no weight is above 0 there.": np.nan * one,
                    f"{start} infinite, for it is divided by 0 there.": np.inf * one,
                    f"{start} 0, which is finite, but{hole}": 0 * one,
                    f"{start} 1, the exponential of 0: 0/0 was papered over, and{hole}": one,
                    f"{start} the median of the others, and{hole}": np.median(E[p.measured]) * one,
                    f"{start} the mean of the others, and{hole}": np.mean(E[p.measured]) * one,
                    f"{start} the least of the others, and{hole}": np.min(E[p.measured]) * one,
                    f"{start} what the longest says, far below the nearest bound: take the shortest.": said[-1][where]
                    if name == "white"
                    else None,
                    f"{start} what the shortest says, far above the nearest bound: take the longest.": said[0][where]
                    if name == "black"
                    else None,
                    f"{start} the plain mean of what all say; the nearest bound is what one of them says.": np.exp(
                        np.log(said).mean(axis=0)
                    )[where],
                    f"{start} what the middle photograph says; the nearest bound is that of an end.": said[
                        len(said) // 2
                    ][where],
                },
                f"{start} {value[0]:.4g}, and the nearest bound is {spec[where][0]:.4g}.",
                1e-5,
            )
        )


@merge_channel.part(1, "Twice the times halve E.")
def _(trial):
    p = _Pile(trial, 4)
    E, half = (trial.run(p.Z, B, p.g, p.w) for B in (p.B, p.B + np.log(2)))
    finite(E[p.measured], "E")
    trial.compare("E, times doubled, over E", half[p.measured] / E[p.measured], np.full(p.measured.sum(), 0.5))
    if not close(half[p.measured] / E[p.measured], np.full(p.measured.sum(), 0.5), TOLERANCE):
        raise Wrong("Twice the times should halve E: the same values, from half of the light.")
