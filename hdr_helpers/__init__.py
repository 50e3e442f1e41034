"""Helpers of the HDR imaging course: one module for each stage, one stage for each notebook.

load      a folder or zip of exposures  ->  Bracket
align     Bracket.images                ->  images that lie on each other
crf       Bracket                       ->  the camera's log inverse response, (3, 256)
merge     images, times, crf            ->  radiance map, (H, W, 3) float32
tonemap   radiance map                  ->  a picture in 0..1, (H, W, 3) float32
"""

import cv2

from hdr_helpers.align import Alignment, align_mtb, crop_common
from hdr_helpers.crf import fitted_weights, gsolve, hat_weights, recover_crf, sample_pixels
from hdr_helpers.load import Bracket, BracketError, Truth, load_bracket
from hdr_helpers.merge import clipping, merge_debevec, write_hdr
from hdr_helpers.tonemap import dynamic_range_stops, tonemap, write_picture

# OpenCV's tone mapping prints a note for its own developers to stderr; a student would take it for a mistake.
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)

__all__ = [
    "Alignment",
    "Bracket",
    "BracketError",
    "Truth",
    "align_mtb",
    "clipping",
    "crop_common",
    "dynamic_range_stops",
    "fitted_weights",
    "gsolve",
    "hat_weights",
    "load_bracket",
    "merge_debevec",
    "recover_crf",
    "sample_pixels",
    "tonemap",
    "write_hdr",
    "write_picture",
]
