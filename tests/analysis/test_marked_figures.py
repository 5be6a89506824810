"""Figures of a quick run: words lie across every picture, and on none that is made afterwards."""

import io

import numpy as np
from matplotlib import rc_context
from matplotlib.image import imread

from evenlight.analysis.figure_style import QUICK_MARK, look, marked_figures, new_figure, png_bytes


def ink(png: bytes) -> float:
    """The share of a picture that is not white."""
    return float(np.mean(imread(io.BytesIO(png))[..., :3].min(axis=2) < 0.99))


def test_settings_of_a_stranger_change_no_figure() -> None:
    """As a `matplotlibrc` in the current folder has them; LaTeX is another program."""

    def made() -> bytes:
        with look():
            return png_bytes(new_figure(height=2.0).text(0.1, 0.5, "words").figure)

    before = made()
    with rc_context({"font.size": 40, "text.usetex": True, "savefig.facecolor": "red"}):
        assert made() == before


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
