"""Figures of stage 5: why a screen needs a tone curve, operators side by side, exposure fusion from within."""

import cv2
import numpy as np

from hdr_helpers.lab.figures.style import ACCENT, INK, MUTED, THREE, headline, new_figure, pictures_figure, plain
from hdr_helpers.lab.judging import Judgement, judge
from hdr_helpers.papers.mertens2007 import fusion_weights, gaussian_pyramid, laplacian_pyramid, quality_maps
from hdr_helpers.tonemap import OPERATORS, luminance, tonemap

TILE = 640  # pixels across of a small picture in a figure: more would not be seen


def eight_bits_figure(radiance):
    """Histogram of a scene's luminance in stops, with the range that one 8-bit picture can show."""
    stops = np.log2(np.maximum(luminance(radiance), 1e-12) / np.median(luminance(radiance)))
    fig, ax = new_figure(1, 1, 3.0)
    ax.hist(stops.ravel(), bins=np.arange(-10, 16, 0.25), color=THREE[1][0], alpha=0.8, density=True)
    top = ax.get_ylim()[1]
    ax.set_ylim(0, 1.2 * top)
    ax.axvspan(-5.5, 2.5, color=THREE[0][0], alpha=0.3)
    ax.annotate("8 stops: a screen of 256 to 1", (-1.5, 1.08 * top), ha="center", color=INK)
    ax.set(xlabel="stops above the median luminance", ylabel="share of pixels per stop")
    plain(ax)
    headline(fig, "The scene is more than twice as wide as the screen")
    return fig


def curve_figure(operators, stops=(-10, 10)):
    """Tone curves: display value against scene luminance in stops. operators : name -> function of (n,) luminance"""
    fig, ax = new_figure(1, 1, 3.4)
    light = np.exp2(np.linspace(*stops, 400)) * 0.18
    looks = [*THREE, (ACCENT, "-.", "d"), (MUTED, "-", "v")]
    for (name, curve), (colour, style, marker) in zip(operators.items(), looks, strict=False):
        ax.plot(np.log2(light / 0.18), curve(light), style, color=colour, marker=marker, markevery=40, label=name)
    ax.set(
        xlabel="scene luminance (stops above middle grey)",
        ylabel="display value",
        ylim=(-0.03, 1.06),
        xticks=range(*stops, 2),
    )
    ax.legend(frameon=False)
    plain(ax)
    headline(fig, "Reinhard's curve bends where clipping breaks off")
    return fig


def contact_sheet_figure(pictures, judgements=None, cols=3, title="One radiance map, and no right picture of it"):
    """Pictures of one scene side by side, what can be measured of each under it.

    pictures : name -> ldr, (H, W, 3) in 0..1; or a radiance map, of which every operator makes one
    judgements : name -> Judgement, or None: of a radiance map they are then made, of pictures left out
    """
    if not isinstance(pictures, dict):
        radiance = pictures
        pictures = {name: tonemap(radiance, name) for name in OPERATORS}
        judgements = judgements or {name: judge(ldr, radiance) for name, ldr in pictures.items()}
    fig = pictures_figure([_small(ldr) for ldr in pictures.values()], list(pictures), cols, title)
    for ax, name in zip(fig.axes, pictures, strict=False):
        if judgements and name in judgements:
            ax.set_xlabel(_spelled(judgements[name]), fontsize=8, color=INK)
    # Room for the line under each picture.
    fig.set_figheight(fig.get_figheight() + (0.32 * -(-len(pictures) // cols) if judgements else 0))
    return fig


def _spelled(judgement: Judgement) -> str:
    kept, clipped = judgement.detail, judgement.clipped
    return (
        f"detail kept: dark {kept.dark:.2f}, bright {kept.bright:.2f}; TMQI {judgement.tmqi.quality:.2f}\n"
        f"black {clipped.black:.1%}, white {clipped.white:.1%}"
    )


def parameter_strip_figure(radiance, operator: str, parameter: str, values, title=None, **others):
    """One parameter of an operator at several values, as a strip of small pictures; others stay as they are given."""
    small = _small(radiance)
    pictures = [tonemap(small, operator, **others, **{parameter: value}) for value in values]
    titles = ["None" if value is None else f"{parameter} = {value:g}" for value in values]
    return pictures_figure(pictures, titles, title=title or f"{operator}: {parameter} alone is changed")


def quality_maps_figure(images, title="Each photograph is trusted where it is good", weights=None):
    """What exposure fusion sees: one column for each photograph, above its three qualities and its weight.

    images : (H, W, 3) uint8 or uint16, aligned; weights : (P, H, W), or None to compute them by the paper's powers
    Contrast and saturation are drawn up to their 99th percentile over all photographs, so that columns compare.
    """
    weights = fusion_weights(images) if weights is None else weights
    maps = list(zip(*(quality_maps(image) for image in images), strict=True))
    rows = [list(images)]
    for quality in maps:
        top = max(np.percentile(quality, 99), 1e-6)
        rows.append([np.clip(one / top, 0, 1) for one in quality])
    rows.append(list(weights))
    names = ("photograph", "contrast", "saturation", "well exposed", "weight")
    fig = pictures_figure(
        [_small(_unit(picture)) for row in rows for picture in row],
        [f"{name} {k}" for name in names for k in range(1, len(images) + 1)],
        len(images),
        title,
    )
    for ax in fig.axes:
        for shown in ax.images:
            shown.set_clim(0, 1)
    return fig


def pyramid_figure(
    image, weight, levels: int = 5, title="Fine parts are mixed by sharp weights, coarse by smooth ones"
):
    """One photograph in exposure fusion: its Laplacian levels, the Gaussian ones of its weight, and the products.

    image : (H, W, 3) uint8 or uint16; weight : (H, W), its weight in 0..1; levels : how many are drawn, the last of
        which is what is left of the picture. Detail is drawn round a middle grey, three times as strong as it is.
    """
    details = laplacian_pyramid(_unit(image), levels - 1)
    shares = gaussian_pyramid(np.asarray(weight, dtype=np.float32), levels - 1)
    products = [detail * share[..., None] for detail, share in zip(details, shares, strict=True)]

    def drawn(pyramid):
        return [np.clip(0.5 + 3 * detail, 0, 1) for detail in pyramid[:-1]] + [np.clip(pyramid[-1], 0, 1)]

    size = shares[0].shape[::-1]
    pictures = [cv2.resize(p, size, interpolation=cv2.INTER_NEAREST) for p in drawn(details) + shares + drawn(products)]
    titles = [f"{what}, level {k}" for what in ("detail", "weight", "product") for k in range(levels)]
    fig = pictures_figure([_small(picture) for picture in pictures], titles, levels, title)
    for ax in fig.axes:
        for shown in ax.images:
            shown.set_clim(0, 1)
        ax.title.set_fontsize(9)
    return fig


def _unit(image) -> np.ndarray:
    """A picture as float32 in 0..1."""
    image = np.asarray(image)
    return image.astype(np.float32) / (np.iinfo(image.dtype).max if image.dtype.kind == "u" else 1)


def _small(picture) -> np.ndarray:
    """A picture, or a radiance map, at most as large as a figure can show."""
    scale = TILE / max(picture.shape[:2])
    if scale >= 1:
        return picture
    return cv2.resize(np.asarray(picture, dtype=np.float32), None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
