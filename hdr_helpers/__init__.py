"""Helpers of the HDR imaging course: one module for each stage, one stage for each notebook.

load      a folder or zip of exposures  ->  Bracket
align     Bracket.images                ->  images that lie on each other
crf       Bracket                       ->  Response: the camera's log inverse response, (3, 256), and its errors
merge     images, times, crf            ->  radiance map, (H, W, 3) float32
tonemap   radiance map                  ->  a picture in 0..1, (H, W, 3) float32
"""

import cv2

from hdr_helpers.align import Alignment, Ghosts, Match, align_mtb, crop_bracket, crop_common, remove_ghosts
from hdr_helpers.crf import (
    Response,
    fitted_weights,
    gaussian_weights,
    gsolve,
    hat_weights,
    noise_weights,
    recover_crf,
    sample_pixels,
    uniform_weights,
)
from hdr_helpers.load import Bracket, BracketError, Truth, load_bracket
from hdr_helpers.merge import Merged, clipping, merge_debevec, write_hdr
from hdr_helpers.tonemap import dynamic_range_stops, tonemap, write_picture

# OpenCV prints notes for its own developers to stderr, when it tone-maps and when it can't read a file; a student
# would take them for mistakes. What it can't do it still raises.
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_FATAL)

__all__ = [
    "Alignment",
    "Bracket",
    "BracketError",
    "Ghosts",
    "Match",
    "Merged",
    "Response",
    "Truth",
    "align_mtb",
    "clipping",
    "crop_bracket",
    "crop_common",
    "dynamic_range_stops",
    "fitted_weights",
    "gaussian_weights",
    "gsolve",
    "hat_weights",
    "load_bracket",
    "merge_debevec",
    "noise_weights",
    "recover_crf",
    "remove_ghosts",
    "sample_pixels",
    "tonemap",
    "uniform_weights",
    "write_hdr",
    "write_picture",
]
