"""Fast bilateral filtering for the display of high-dynamic-range images.

F. Durand and J. Dorsey, SIGGRAPH 2002. Log luminance is split into a base layer, smoothed by a bilateral
filter that stops at edges, and the detail that is left. Only the base is compressed, so the contrast
between window and wall shrinks and the grain of the wood does not. OpenCV once had this operator
(createTonemapDurand); the packages of today no longer do.

One thing is done otherwise than in the paper. A lens draws an edge a few pixels wide; the bilateral base is
steeper. What lies between the two would pass for detail: left uncompressed it draws a dark line inside a lamp's
outline and a bright one outside. The paper makes the lines fainter by blurring the base where few neighbours
resemble a pixel; here a guided filter lends the base the edges of the picture itself, and there are none.
"""

import cv2
import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)  # Rec. 709
LEAST = np.float32(1e-6)  # luminance below this, where white is 1, counts as this: a logarithm needs a floor
EDGE = 0.004  # of the picture's longer side: an edge as the lens draws it is not wider
GRAIN = 0.01  # in log10: what varies less is grain, not an edge


def tonemap_durand(radiance, contrast=30.0, detail=1.0, saturation=0.8, gamma=2.2) -> np.ndarray:
    """Tone-map by compressing the bilateral base layer.

    radiance : (H, W, 3) float32, linear RGB, finite, not negative, white at 1
    contrast : 1..1e6; ratio of brightest to darkest that is left of the base; less lifts the dark parts
    detail : 0..5; factor on the detail layer, in log; 1 keeps it as it was, more exaggerates it
    saturation : 0..2; 0 is grey, 1 keeps colour ratios, which look too strong once luminance is compressed
    gamma : 0.1..10; display gamma; above 1 brightens
    Returns (H, W, 3) float32, not clipped.

    >>> scene = np.ones((20, 40, 3), np.float32)
    >>> scene[:, :20] = 1e-4  # a dark room beside a window
    >>> light = tonemap_durand(scene, contrast=30, saturation=1, gamma=1)
    >>> round(float(light[10, 35, 0] / light[10, 5, 0]))  # of 10,000
    30
    """
    light = np.maximum(radiance @ LUMINANCE, LEAST)
    log_light = np.log10(light)
    base = fast_bilateral(log_light, sigma_space=0.02 * max(light.shape))
    base = follow_edges(base, log_light, max(2, round(EDGE * max(light.shape))))
    darkest, brightest = np.percentile(where_lit(base, light), [0.5, 99.8])
    factor = np.log10(contrast) / max(brightest - darkest, np.log10(contrast), 1e-6)
    compressed = 10 ** (factor * (base - brightest) + detail * (log_light - base))
    return in_colour(radiance, light, compressed, saturation, gamma)


def where_lit(values, light) -> np.ndarray:
    """(N,), the values of all pixels but the black ones; where all are black, of all.

    values, light : (H, W) float; a pixel whose light is at most LEAST is black
    Black pixels, a border or where a merge knew nothing, say nothing of the range of the scene.

    >>> where_lit(np.array([[3, 5]]), light=np.array([[0, 1]])).tolist()
    [5]
    """
    lit = light > LEAST
    return values[lit] if lit.any() else values.ravel()


def in_colour(radiance, light, shown, saturation, gamma) -> np.ndarray:
    """A picture of new luminance in the colours of the old: ((radiance / light) ^ saturation * shown) ^ (1 / gamma).

    radiance : (H, W, 3) float32, linear RGB; light : (H, W), its luminance, above 0
    shown : (H, W), the luminance that the picture is to have, linear
    saturation, gamma : as for tonemap_durand
    Returns (H, W, 3) float32, not clipped.

    >>> radiance = np.float32([[[0.4, 0.2, 0.2]]])
    >>> light = radiance @ LUMINANCE
    >>> (in_colour(radiance, light, 2 * light, saturation=1, gamma=1) / radiance).round(3).tolist()
    [[[2.0, 2.0, 2.0]]]
    """
    # By logarithms, which OpenCV takes and undoes faster than numpy raises to a power.
    picture = np.maximum(radiance, LEAST**2)
    cv2.log(picture, picture)
    change = cv2.log(np.maximum(shown, LEAST**2)) - np.float32(saturation) * cv2.log(light)
    picture *= np.float32(saturation)
    picture += change.reshape(*light.shape, 1)
    picture *= np.float32(1 / gamma)
    return cv2.exp(picture, picture).reshape(radiance.shape)


def fast_bilateral(values, sigma_space: float, sigma_range: float = 0.4) -> np.ndarray:
    """Edge-preserving blur in the time of a few Gaussian ones (section 5 of the paper).

    values : (H, W) float32
    sigma_space : pixels; the paper takes 2% of the picture's width
    sigma_range : in the units of values; 0.4 in log10 is the paper's

    For a fixed centre value the bilateral filter is a ratio of two Gaussian blurs. It is computed for
    centre values half a sigma_range apart and interpolated to each pixel's own value. Blurs that wide lose
    little when they are made on a smaller picture, and of a very large one blocks of pixels will do.
    Returns (H, W) float32.

    >>> step = np.float32([[0] * 20 + [2] * 20] * 20)
    >>> bool(np.abs(fast_bilateral(step, sigma_space=4) - step).max() < 0.01)  # the edge stays
    True
    >>> bool(np.abs(cv2.GaussianBlur(step, (0, 0), 4) - step).max() > 0.8)  # and would not
    True
    """
    height, width = values.shape
    shrink = max(1.0, sigma_space / 4)
    small = (max(1, round(width / shrink)), max(1, round(height / shrink)))
    low, high = float(values.min()), float(values.max())
    if high - low < 1e-6 * sigma_range:
        return values.copy()

    def blur(picture):
        picture = cv2.resize(picture, small, interpolation=cv2.INTER_AREA)
        return cv2.GaussianBlur(picture, (0, 0), sigma_space / shrink)

    centres = np.linspace(low, high, max(2, int(np.ceil((high - low) / (0.5 * sigma_range))) + 1), dtype=np.float32)
    step = centres[1] - centres[0]
    block = max(1, int(shrink / 4))
    coarse = cv2.resize(values, (-(-width // block), -(-height // block)), interpolation=cv2.INTER_AREA)
    result, share, blurred = np.zeros_like(values), np.empty_like(values), np.empty_like(values)
    for centre in centres:
        offset = coarse - centre
        near = cv2.exp(offset**2 * np.float32(-0.5 / sigma_range**2)).reshape(offset.shape)
        average = centre + blur(near * offset) / np.maximum(blur(near), np.float32(1e-12))
        cv2.resize(average, (width, height), dst=blurred, interpolation=cv2.INTER_LINEAR)
        # In place: at twelve megapixels new arrays would take longer than the arithmetic.
        np.abs(np.subtract(values, centre, out=share), out=share)
        np.maximum(np.subtract(1, np.divide(share, step, out=share), out=share), 0, out=share)
        share *= blurred
        result += share
    return result


def follow_edges(base, values, radius: int) -> np.ndarray:
    """A base layer whose edges have the shape that they have in the values it was made from.

    base, values : (H, W) float32; radius : pixels, at least half as wide as an edge
    In each window of 2 radius + 1 pixels the base is replaced by the line a * values + b that is nearest to it: at an
    edge a is 1 and the base takes the edge over; where the values are grain round a smooth base, a is 0 and it stays.
    K. He, J. Sun and X. Tang, Guided Image Filtering, ECCV 2010. Returns (H, W) float32.

    >>> soft = np.float32([[0] * 20 + [0.5, 1, 1.5] + [2] * 20] * 20)
    >>> steep = np.round(soft / 2) * 2
    >>> bool(np.abs(follow_edges(steep, soft, 4) - soft).max() < np.abs(steep - soft).max() / 2)
    True
    """

    def mean(picture):
        return cv2.blur(picture, (2 * radius + 1, 2 * radius + 1), borderType=cv2.BORDER_REFLECT)

    mean_values, mean_base = mean(values), mean(base)
    variance = np.maximum(mean(values * values) - mean_values**2, 0)
    a = (mean(values * base) - mean_values * mean_base) / (variance + np.float32(GRAIN**2))
    return mean(a) * values + mean(mean_base - a * mean_values)
