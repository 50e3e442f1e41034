"""Figures of which a few parts change while a slider moves: axes, texts and layout are drawn once."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg


class Live:
    """Pictures of one figure, filled with this and then with that.

    figure : Figure
    fill : function that puts what it is given into the figure's artists, and returns those that it changed, lowest
        first, always the same ones. Axes must keep their limits: they and their labels are not drawn again.
    """

    def __init__(self, figure, fill):
        self._figure, self._fill = figure, fill
        self._canvas = FigureCanvasAgg(figure)
        self._background = None

    def __call__(self, *values) -> np.ndarray:
        """What the figure shows of these values, as (H, W, 3) uint8."""
        changed = self._fill(*values)
        if self._background is None:
            self._background = self._all_but(changed)
        self._canvas.restore_region(self._background)
        for artist in changed:
            artist.draw(self._canvas.get_renderer())
        return np.array(self._canvas.buffer_rgba())[..., :3]

    def _all_but(self, changed):
        self._canvas.draw()  # with everything in it, as the layout makes room for what it sees
        self._figure.set_layout_engine("none")
        for artist in changed:
            artist.set_animated(True)  # left out of what the canvas draws
        self._canvas.draw()
        return self._canvas.copy_from_bbox(self._figure.bbox)
