"""The response from a single photograph: at a soft edge between two colours, light lies on a straight line.

S. Lin, J. Gu, S. Yamazaki and H.-Y. Shum, Radiometric Calibration from a Single Image, CVPR 2004. A pixel on the edge
between two plain surfaces sees some of either, so that its light is a mixture of theirs: in the space of red, green
and blue it lies on the straight line between the two. A response bends that line. Wanted is the inverse response that
makes the bent lines of a photograph straight again, and is a likely one.

The paper knows what is likely from a database of 201 measured responses. Here a small family takes its place: the
slope of the inverse response, as a function of the pixel value M in 0..1, is M^(p-1) exp(a polynomial of third order),
which is positive whatever its numbers are. TYPICAL and SPREAD say which numbers are likely: the powers 1 to 2.2, sRGB,
and sRGB with more contrast lie within two spreads. Distances are counted in grey levels, not in light as in the paper.

What can't be known. A line stays straight when the light of a channel is scaled, and when a constant is added to it.
The scale is the gauge, g[128] = 0. The constant is fixed by no light at value 0, which no edge reaches, so that the
darkest values are left to what is likely. An edge between two greys says nothing where the channels are alike: the
line is the grey axis, however bent the response. And an edge between light and shade of one colour, whose line would
pass through black, says nothing of a power common to all channels. Only edges between different hues count.

How far off. From a picture of many plain colours with soft edges the curve is some 0.2 stops off, and 0.1 above value
20; the typical camera alone would be off by 0.5 and 0.4. Steep curves come out worst, drawn towards what is typical.
Photographs have few plain colours, and texture, sharpening, coarse JPEG colour and channels that a camera has mixed
bend lines too: half a stop is to be expected, hardly better than the typical camera and sometimes worse, and most
photographs are refused.
"""

import cv2
import numpy as np
from scipy.optimize import least_squares

LEVELS = 256
MIDDLE = 128  # g[MIDDLE] = 0
TALL = 7  # pixels along an edge over which the colours beside it must be plain; across it, 3
REACHES = (3, 4)  # pixels from a mixed pixel to the middle of the colours beside it
INSIDE = (8, 247)  # the colours beside an edge must be neither black nor clipped
CONTRAST = 30  # grey levels by which two of their channels must differ
PLAIN, UNEVEN = 4, 0.12  # grey levels, or share of the contrast, by which a plain colour may vary
BACKWARDS = 5  # grey levels by which noise may turn the way from one colour to the other
BEND = 3  # grey levels by which a response would bend the line: less would drown in noise
FEWEST, MOST = 30, 1000  # mixed pixels needed, and used
ALIKE = 20  # neighbours along one edge err together: that many count as one
TYPICAL = np.array([1.5, 1.0, 0.0, 0.1])  # p, and the Legendre polynomials of order 1 to 3 in 2 M - 1
SPREAD = np.array([0.4, 0.9, 0.4, 0.2])
CHANNELS_SPREAD = 0.3  # of SPREAD: a camera's three curves differ less than cameras do
ROUNDS = 5  # of fitting, each trusting less what lies far off the lines of the last one


def response_from_edges(image) -> np.ndarray:
    """Log inverse response from the edges of one photograph.

    image : (H, W, 3) uint8, RGB
    Returns crf, (3, 256) float64, natural logarithms, crf[:, 128] = 0, strictly rising.
    Raises ValueError where image is something else, and where it has too few edges between different hues.

    >>> light = np.float64([[(0.6, 0.1, 0.1), (0.1, 0.5, 0.2)], [(0.1, 0.2, 0.6), (0.6, 0.5, 0.1)]])
    >>> light = cv2.GaussianBlur(light.repeat(30, axis=0).repeat(30, axis=1), (0, 0), 1)  # four soft fields
    >>> crf = response_from_edges(np.uint8(255 * light ** (1 / 2)))
    >>> stops = (crf[:, 128] - crf[:, 64]) / np.log(2)  # a root: twice the value is four times the light
    >>> bool(np.all(np.abs(stops - 2) < 0.5))
    True
    """
    triples, _ = edge_triples(image)
    if len(triples) < FEWEST:
        raise ValueError(
            f"Pixels that mix two plain colours of different hue: {len(triples)}, at least {FEWEST} are needed; take "
            "a photograph with large plain areas of several colours, a little out of focus."
        )
    triples = triples[:: -(-len(triples) // MOST)]
    numbers, trust, sigma = np.tile(TYPICAL, (3, 1)), np.ones(len(triples)), 2.0
    for _ in range(ROUNDS):
        weight = np.sqrt(trust / ALIKE) / sigma
        fitted = least_squares(
            _misfit, numbers.ravel(), x_scale=np.tile(SPREAD, 3), args=(triples, weight), method="lm"
        )
        numbers = fitted.x.reshape(3, -1)
        off = np.linalg.norm(off_the_line(triples, inverse_responses(numbers)), axis=1)
        sigma = max(1.0, np.median(off) / 1.18)  # grey levels; 1.18 is the median of such a norm for sigma 1
        trust = 1 / (1 + (off / (2 * sigma)) ** 2)
    light = inverse_responses(numbers)
    light[:, 0] = light[:, 1] / 4  # value 0 stands for all light that rounds to it
    return np.log(light / light[:, MIDDLE : MIDDLE + 1])


def edge_triples(image) -> tuple[np.ndarray, np.ndarray]:
    """Pixels that mix two plain colours of different hue, and these colours.

    image : (H, W, 3) uint8, RGB
    Returns triples, (n, 3, 3) float64: the colour on one side, of the mixed pixel, and on the other side; and the row
    and column of each mixed pixel, (n, 2) integers.
    Raises ValueError where image is something else.

    >>> fields = np.uint8([[(200, 50, 50)] * 10 + [(120, 120, 60)] + [(50, 180, 70)] * 10] * 10)
    >>> triples, places = edge_triples(fields)
    >>> triples[0].tolist(), np.unique(places[:, 1]).tolist()
    ([[200.0, 50.0, 50.0], [120.0, 120.0, 60.0], [50.0, 180.0, 70.0]], [10])
    """
    image = np.asarray(image)
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise ValueError(f"image must be (H, W, 3) uint8, RGB; got {image.shape} {image.dtype}.")
    found = [_across(np.ascontiguousarray(image), reach) for reach in REACHES]
    turned = [_across(np.ascontiguousarray(image.transpose(1, 0, 2)), reach) for reach in REACHES]
    found += [(triples, places[:, ::-1]) for triples, places in turned]
    triples, places = (np.concatenate(parts) for parts in zip(*found, strict=True))
    places, first = np.unique(places, axis=0, return_index=True)
    triples = triples[first]
    bent = _bend(triples) >= BEND
    return triples[bent], places[bent]


def off_the_line(triples, light) -> np.ndarray:
    """How far mixed pixels lie from the straight line between their two colours: (n, 3) float64, grey levels.

    triples : (n, 3, 3) as edge_triples gives them
    light : (3, 256) float, inverse response of each channel

    A distance in light, as the paper has it, is small wherever the response is steep, whatever the noise. Divided by
    the slope of the inverse response it is counted in grey levels, as noise is.

    >>> triples = np.float64([[(60, 100, 80), (80, 80, 80), (100, 60, 80)]])  # half of each
    >>> linear = np.tile(np.arange(256), (3, 1))
    >>> np.abs(off_the_line(triples, linear)).max().item(), np.abs(off_the_line(triples, linear**2)).max().item() > 1
    (0.0, True)
    """
    values = np.arange(LEVELS)
    E = np.stack([np.interp(triples[..., c], values, light[c]) for c in range(3)], axis=-1)
    slope = np.stack([np.interp(triples[:, 1, c], values, np.gradient(light[c])) for c in range(3)], axis=-1)
    mixed, line = (E[:, 1] - E[:, 0]) / slope, (E[:, 2] - E[:, 0]) / slope
    share = np.sum(mixed * line, axis=1) / np.sum(line**2, axis=1)
    return mixed - share[:, None] * line


def inverse_responses(numbers) -> np.ndarray:
    """Light of each pixel value, (3, 256) float64, 0 at 0 and 1 at 255, for three members of the family.

    numbers : (3, 4) float, as in TYPICAL, one row a channel

    >>> light = inverse_responses(np.array([(1, 0, 0, 0), (2, 0, 0, 0), TYPICAL]))  # the powers 1 and 2
    >>> light[:2, 128].round(2).tolist()
    [0.5, 0.25]
    """
    M = (np.arange(LEVELS - 1) + 0.5) / (LEVELS - 1)
    basis = np.stack([np.log(M), *np.polynomial.legendre.legvander(2 * M - 1, 3).T[1:]])
    slope = np.exp((numbers - [1, 0, 0, 0]) @ basis)
    light = np.cumsum(np.pad(slope, ((0, 0), (1, 0))), axis=1)
    return light / light[:, -1:]


def _misfit(numbers, triples, weight) -> np.ndarray:
    """Residuals for least_squares: of the lines, of the typical camera, and between channels."""
    numbers = numbers.reshape(3, -1)
    common = numbers.mean(axis=0)
    off = weight[:, None] * off_the_line(triples, inverse_responses(numbers))
    return np.concatenate(
        [off.ravel(), (common - TYPICAL) / SPREAD, ((numbers - common) / (CHANNELS_SPREAD * SPREAD)).ravel()]
    )


def _across(image, reach) -> tuple[np.ndarray, np.ndarray]:
    """Triples and places, as edge_triples gives them, of edges that are crossed from left to right."""
    width = image.shape[1]
    if width <= 2 * reach:
        return np.empty((0, 3, 3)), np.empty((0, 2), dtype=np.intp)
    side = np.ones((TALL, 3), np.uint8)
    varies = _in_order(cv2.subtract(cv2.dilate(image, side), cv2.erode(image, side)))[2]
    colour = cv2.boxFilter(image, cv2.CV_32F, side.shape[::-1])
    darkest, _, brightest = _in_order(colour)
    inside = (darkest >= INSIDE[0]) & (brightest <= INSIDE[1])
    left, right = np.s_[:, : width - 2 * reach], np.s_[:, 2 * reach :]
    _, second, most = _in_order(cv2.absdiff(colour[left], colour[right]))
    plain = np.maximum(varies[left], varies[right]) <= np.maximum(PLAIN, UNEVEN * most)
    rows, cols = np.nonzero(plain & inside[left] & inside[right] & (second >= CONTRAST))
    one, other = colour[left][rows, cols], colour[right][rows, cols]
    way = image[rows[:, None], cols[:, None] + np.arange(2, 2 * reach - 1)].astype(np.float64)
    mixed = way[:, reach - 2]
    steps = np.diff(np.concatenate([one[:, None], way, other[:, None]], axis=1), axis=1)
    forth = np.all(steps * np.copysign(1, other - one)[:, None] >= -BACKWARDS, axis=(1, 2))
    share = np.sum((mixed - one) * (other - one), axis=1) / np.sum((other - one) ** 2, axis=1)
    good = forth & (share > 0.1) & (share < 0.9)
    return np.stack([one, mixed, other], axis=1)[good], np.stack([rows, cols + reach], axis=1)[good]


def _in_order(picture) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The smallest, the middle and the largest of three channels, (H, W) each; faster than sorting a short axis."""
    r, g, b = cv2.split(picture)
    less, more = cv2.min(r, g), cv2.max(r, g)
    return cv2.min(less, b), cv2.max(less, cv2.min(more, b)), cv2.max(more, b)


def _bend(triples) -> np.ndarray:
    """(n,) grey levels by which a response of power 2.2 would push the middle of the mixture off a straight line."""
    one, _, other = triples.transpose(1, 0, 2)
    middle = ((one**2.2 + other**2.2) / 2) ** (1 / 2.2) - one
    along = (other - one) / np.linalg.norm(other - one, axis=1, keepdims=True)
    return np.linalg.norm(middle - np.sum(middle * along, axis=1, keepdims=True) * along, axis=1)
