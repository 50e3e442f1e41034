"""Photographic tone reproduction for digital images: the global operator.

E. Reinhard, M. Stark, P. Shirley and J. Ferwerda, SIGGRAPH 2002, section 3. As a photographer would, first choose how
bright the scene's middle is shown, then bend the curve where film would burn out: dark values pass nearly unchanged,
bright ones are pressed together. One curve for all pixels, so what is brighter never becomes darker.

Not to be confused with OpenCV's createTonemapReinhard, which is Reinhard and Devlin 2005, a model of photoreceptors.
"""

import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)  # Rec. 709
BRIGHTEST = 99.9  # percentile of luminance that counts as the brightest: one bright pixel must not decide
LEAST = np.float32(1e-6)  # of the brightest: what is darker counts as black, and has no say in the average


def tonemap_reinhard_global(radiance, key=0.18, white=None, saturation=0.8, gamma=2.2) -> np.ndarray:
    """Tone-map by one curve, L (1 + L / white^2) / (1 + L).

    radiance : (H, W, 3) float32, linear RGB, finite, not negative; its scale does not matter
    key : 0.01..10; the grey at which the scene's average is shown before compression; 0.18 is a grey card's, 0.09
        suits a night scene, 0.36 or 0.72 snow; more is brighter
    white : 0.01 or more; luminance, in units in which the scene's average is key, that becomes white: what is
        brighter burns out. None takes the scene's brightest, so that nothing does; infinity reaches no white
    saturation : 0..2; 0 is grey, 1 keeps the ratios of colours, which look too strong once luminance is compressed
        and may drive a channel out of range; it is cut there
    gamma : 0.1..10; display gamma; above 1 brightens
    Returns (H, W, 3) float32 in 0..1.
    Raises ValueError where the radiance map has another form, or key, white or gamma is not positive.

    >>> radiance = np.geomspace(0.01, 10, 12).reshape(2, 2, 3)
    >>> np.allclose(tonemap_reinhard_global(radiance), tonemap_reinhard_global(7 * radiance), atol=1e-4)  # no scale
    True
    """
    radiance = np.asarray(radiance, dtype=np.float32)
    if radiance.ndim != 3 or radiance.shape[2] != 3:
        raise ValueError(f"A radiance map must be (H, W, 3); got {radiance.shape}.")
    for name, value in (("key", key), ("white", white), ("gamma", gamma)):
        if value is not None and not value > 0:
            raise ValueError(f"{name} must be above 0; got {value}.")
    light = radiance @ LUMINANCE
    brightest = np.percentile(light, BRIGHTEST) or light.max()
    if not brightest > 0:
        return np.zeros_like(radiance)
    light = np.maximum(light / brightest, LEAST)
    exposure = key / log_average(light[light > LEAST])
    shown = compress(exposure * light, exposure if white is None else white)
    colour = (radiance / brightest / light[..., None]) ** np.float32(saturation)
    return np.clip(colour * shown[..., None], 0, 1) ** np.float32(1 / gamma)


def log_average(light) -> float:
    """The scene's log-average luminance (equation 1): the exponential of the mean of logarithms.

    light : luminance, any shape, all above 0. The paper's equation divides by the number of pixels in the wrong place;
    the text makes clear what is meant.

    >>> round(log_average([1, 100]), 6)  # half way in stops
    10.0
    """
    return float(np.exp(np.mean(np.log(light), dtype=np.float64)))


def compress(light, white=np.inf) -> np.ndarray:
    """The curve: L / (1 + L) without white (equation 3), else the one that is 1 at white (equation 4).

    light : luminance, any shape, of which the average has been brought to the key (equation 2)
    white : luminance that becomes 1; infinity for none
    Returns float32 of the same shape.

    >>> compress([1, 3]).tolist(), compress([4], white=4).tolist()  # 1 / 2, 3 / 4; and white is white
    ([0.5, 0.75], [1.0])
    """
    light = np.asarray(light, dtype=np.float32)
    return light * (1 + light * np.float32(1 / white**2)) / (1 + light)
