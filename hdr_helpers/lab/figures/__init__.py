"""Figures of the course, one file for each stage and one for the style they share.

Functions named *_figure return a matplotlib Figure; show() puts one into a notebook with its alt text.
"""

from hdr_helpers.lab.figures.align import (
    bitmaps_figure,
    detail_figure,
    ghost_map_figure,
    hand_figure,
    percentiles_figure,
    shifts_figure,
    vote_figure,
)
from hdr_helpers.lab.figures.crf import (
    crf_error_figure,
    crf_figure,
    data_on_curve_figure,
    data_on_curve_frame,
    doubling_figure,
    edges_figure,
    joint_figure,
    matrix_figure,
    sampling_figure,
)
from hdr_helpers.lab.figures.live import Live
from hdr_helpers.lab.figures.load import (
    clipping_overlay,
    clipping_strip_figure,
    histogram_frame,
    iso_figure,
    one_photo_figure,
    pixel_figure,
    strip_figure,
    transfer_figure,
    unusable,
    usable_share,
)
from hdr_helpers.lab.figures.merge import (
    error_figure,
    false_colour_figure,
    held_out_figure,
    honest_figure,
    pixel_estimates_figure,
    viewed_at,
    weights_figure,
)
from hdr_helpers.lab.figures.style import jpeg_bytes, pictures_figure, png_bytes, seconds, show
from hdr_helpers.lab.figures.tonemap import (
    contact_sheet_figure,
    curve_figure,
    eight_bits_figure,
    parameter_strip_figure,
    pyramid_figure,
    quality_maps_figure,
)
from hdr_helpers.lab.figures.way import way_figure

__all__ = [
    "Live",
    "bitmaps_figure",
    "clipping_overlay",
    "clipping_strip_figure",
    "contact_sheet_figure",
    "crf_error_figure",
    "crf_figure",
    "curve_figure",
    "data_on_curve_figure",
    "data_on_curve_frame",
    "detail_figure",
    "doubling_figure",
    "edges_figure",
    "eight_bits_figure",
    "error_figure",
    "false_colour_figure",
    "ghost_map_figure",
    "hand_figure",
    "held_out_figure",
    "histogram_frame",
    "honest_figure",
    "iso_figure",
    "joint_figure",
    "jpeg_bytes",
    "matrix_figure",
    "one_photo_figure",
    "parameter_strip_figure",
    "percentiles_figure",
    "pictures_figure",
    "pixel_estimates_figure",
    "pixel_figure",
    "png_bytes",
    "pyramid_figure",
    "quality_maps_figure",
    "sampling_figure",
    "seconds",
    "shifts_figure",
    "show",
    "strip_figure",
    "transfer_figure",
    "unusable",
    "usable_share",
    "viewed_at",
    "vote_figure",
    "way_figure",
    "weights_figure",
]
