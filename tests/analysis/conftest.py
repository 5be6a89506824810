"""What tests of figures share: the words on a figure, and whether they can be read."""

import itertools
from collections.abc import Callable
from typing import Any

import pytest
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from evenlight.analysis.figure_style import FigureFormat


def boxes_of(figure: Figure) -> list[tuple[str, Any]]:
    """What is written on the figure and its axes, with where it is drawn [pixels]."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    shown = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]
    hidden = {t for axes in figure.axes if not axes.axison for axis in (axes.xaxis, axes.yaxis)
              for t in axis.findobj(Text)}  # fmt: skip
    ticks = {t for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for t in outside(axis)}
    return [(t.get_text(), t.get_window_extent(renderer)) for t in shown if t not in hidden | ticks]


def outside(axis: Axis) -> set[Text]:
    """The numbers of ticks that lie beyond the ends of an axis, and so are not drawn."""
    low, high = sorted(axis.get_view_interval())
    every = axis.get_major_ticks() + axis.get_minor_ticks()
    far = [tick for tick in every if not low <= tick.get_loc() <= high]
    return {label for tick in far for label in (tick.label1, tick.label2)}


def assert_legible(figure: Figure, medium: FigureFormat) -> None:
    """Nothing written leaves the figure, and no two words lie on each other."""
    boxes = boxes_of(figure)
    width, height = figure.bbox.width, figure.bbox.height
    for words, box in boxes:
        inside = box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height
        assert inside, f"{words!r} leaves the figure"
    touching = 0.15 * medium.em * medium.dots_per_inch  # boxes are higher than the letters in them
    for (one, a), (other, b) in itertools.combinations(boxes, 2):
        across = min(a.x1, b.x1) - max(a.x0, b.x0)
        down = min(a.y1, b.y1) - max(a.y0, b.y0)
        assert min(across, down) < touching, f"{one!r} and {other!r} overlap"


@pytest.fixture(scope="session")
def texts_on() -> Callable[[Figure], list[str]]:
    """Return all that is written on a figure, piece by piece."""
    return lambda figure: [words for words, _ in boxes_of(figure)]


@pytest.fixture(scope="session")
def require_legible() -> Callable[[Figure, FigureFormat], None]:
    """Assert that nothing written on a figure leaves it or lies on something else."""
    return assert_legible
