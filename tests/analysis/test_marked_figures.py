"""Figures of a quick run: words lie across every picture, and on none that is made afterwards."""

import io

import numpy as np
from matplotlib.image import imread

from evenlight.analysis.figure_style import QUICK_MARK, marked_figures, new_figure, png_bytes


def ink(png: bytes) -> float:
    """The share of a picture that is not white."""
    return float(np.mean(imread(io.BytesIO(png))[..., :3].min(axis=2) < 0.99))


def test_words_lie_across_a_figure_only_while_it_is_asked_for() -> None:
    blank = png_bytes(new_figure(height=2.0))
    with marked_figures(QUICK_MARK):
        figure = new_figure(height=2.0)
        marked = png_bytes(figure)
        assert png_bytes(figure) == marked  # the mark is not laid twice
    assert ink(blank) == 0
    assert ink(marked) > 0.02
    assert png_bytes(new_figure(height=2.0)) == blank
    with marked_figures(""):
        assert png_bytes(new_figure(height=2.0)) == blank
