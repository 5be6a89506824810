"""One look for every figure: media, colours, type, and PNG files that are the same on every run."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import RLock
from typing import Any

from matplotlib import rc_context, rcParams, rcParamsDefault
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.ticker import FuncFormatter

from evenlight.data_schema.storage.whole_files import write_whole

# After Tol (2021), "Colour schemes": distinguishable with any colour vision, and in print without colour.
OURS = "#004488"  # the brightness track
BASELINE = "#CC8A00"  # constant dimming at the same power
LIMIT = "#882255"  # ΔL, and what lies beyond it
LOST = "#F0433A"  # visible contrast that dimming has lost
PARTICIPANT = "#7F8791"  # one participant among others
INK = "#22262B"
MUTED = "#5F6670"
FAINT = "#D9DDE2"

QUICK_MARK = "QUICK RUN"  # across figures that are no result
PERCENT = FuncFormatter(lambda share, _: f"{100 * share:.6g} %")  # an axis of shares
_MARK: ContextVar[str] = ContextVar("mark", default="")
_DRAWING = RLock()  # matplotlib's settings are those of the process
# A `matplotlibrc` of the current folder may say others, and run LaTeX.
_DEFAULTS: dict[Any, Any] = {key: value for key, value in rcParamsDefault.items() if key != "backend"}


@dataclass(frozen=True, slots=True)
class FigureFormat:
    """Where a figure is shown.

    Attributes
    ----------
    width, height : float
        Of a figure that fills it [inch].
    font_size : float
        Of the text [point].
    dots_per_inch : float
        Of the PNG.
    """

    width: float
    height: float
    font_size: float
    dots_per_inch: float

    @property
    def em(self) -> float:
        """The font size as a length [inch]: the unit in which margins are given."""
        return self.font_size / 72


PAGE = FigureFormat(width=8.0, height=8.2, font_size=9.0, dots_per_inch=200.0)  # the report, a supplement


@contextmanager
def look(medium: FigureFormat = PAGE) -> Iterator[None]:
    """Draw for a medium, one thread at a time: `with look(): ...`."""
    size = medium.font_size
    hair = size / 11
    settings: dict[Any, Any] = {
        "font.family": "DejaVu Sans",  # comes with matplotlib: the same on every computer
        "font.size": size,
        "mathtext.fontset": "dejavusans",
        "axes.titlesize": size,
        "axes.labelsize": size,
        "xtick.labelsize": size * 0.92,
        "ytick.labelsize": size * 0.92,
        "legend.fontsize": size * 0.95,
        "text.color": INK,
        "axes.labelcolor": INK,
        "axes.edgecolor": MUTED,
        "xtick.color": MUTED,
        "ytick.color": MUTED,
        "xtick.labelcolor": INK,
        "ytick.labelcolor": INK,
        "axes.linewidth": hair,
        "xtick.major.width": hair,
        "ytick.major.width": hair,
        "xtick.minor.width": hair * 0.6,
        "ytick.minor.width": hair * 0.6,
        "xtick.major.size": size * 0.35,
        "ytick.major.size": size * 0.35,
        "xtick.minor.size": size * 0.2,
        "ytick.minor.size": size * 0.2,
        "lines.linewidth": size / 5.5,
        "lines.markersize": size * 0.5,
        "hatch.linewidth": hair * 0.7,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.axisbelow": True,
        "legend.frameon": False,
        "legend.borderpad": 0.0,
        "legend.borderaxespad": 0.0,
        "legend.handlelength": 1.6,
        "legend.handletextpad": 0.5,
        "legend.columnspacing": 1.6,
        "figure.facecolor": "white",
        "figure.dpi": medium.dots_per_inch,
        "savefig.dpi": "figure",
        "path.simplify": True,
        "text.parse_math": False,  # a "$" in the name of a video is a dollar
    }
    with _DRAWING, rc_context(_DEFAULTS | settings):
        yield


def new_figure(height: float | None = None, medium: FigureFormat = PAGE) -> Figure:
    """Return an empty figure as wide as the medium, drawn by Agg and known to no window.

    Parameters
    ----------
    height : float, optional
        Of the figure [inch]; otherwise the medium's.
    medium : FigureFormat
        Where it is shown.
    """
    figure = Figure(figsize=(medium.width, height or medium.height))
    FigureCanvasAgg(figure)
    figure._repr_png_ = partial(png_bytes, figure)  # type: ignore[attr-defined] # what a notebook shows
    return figure


def axes_at(figure: Figure, left: float, top: float, width: float, height: float) -> Axes:
    """Return new axes with their upper left corner at so many inches from that of the figure."""
    full_width, full_height = figure.get_size_inches()
    bottom = full_height - top - height
    return figure.add_axes(
        (left / full_width, bottom / full_height, width / full_width, height / full_height)
    )


def text_at(figure: Figure, left: float, top: float, words: str, **style: Any) -> None:
    """Write a line of text with its upper left corner at so many inches from that of the figure."""
    full_width, full_height = figure.get_size_inches()
    settings = {"va": "top", "ha": "left", **style}
    figure.text(left / full_width, 1 - top / full_height, drawable(words), **settings)


def drawable(words: str) -> str:
    """Return words with a box for every character that the font lacks, as names of videos may hold any.

    >>> drawable("ΔL of 東京.mp4")
    'ΔL of □□.mp4'
    """
    font = get_font(findfont("DejaVu Sans"))
    return "".join(c if c == "\n" or font.get_char_index(ord(c)) else "□" for c in words)


Line = tuple[str, float, dict[str, Any]]  # words, distance from the top [inch], text properties


def heading_lines(title: str, subtitle: str, width: float, em: float) -> tuple[list[Line], float]:
    """Return a title and a line below it, broken to a width [inch], and the height that they take."""
    bold = {"fontsize": 1.25 * 72 * em, "fontweight": "bold"}
    lines, below = text_lines(title, 0.8 * em, width, bold)
    more, below = text_lines(subtitle, below + 0.1 * em, width, {"color": MUTED})
    return lines + more, below


def text_lines(words: str, top: float, width: float, style: dict[str, Any]) -> tuple[list[Line], float]:
    """Return words broken to a width [inch], from `top` down, and where they end."""
    size = style.get("fontsize", rcParams["font.size"]) / 72
    letter = (0.66 if "fontweight" in style else 0.52) * size  # mean advance of DejaVu Sans
    lines = textwrap.wrap(words, max(int(width / letter), 10), break_on_hyphens=False)
    return [(part, top + k * 1.45 * size, style) for k, part in enumerate(lines)], top + len(
        lines
    ) * 1.45 * size


def lines_at(figure: Figure, left: float, lines: Sequence[Line]) -> None:
    """Write lines one below the other, their left ends at so many inches from that of the figure."""
    for words, top, style in lines:
        text_at(figure, left, top, words, **style)


def panels(
    title: str, about: str, mosaic: list[Any], heights: list[float], apart: float = 3.4, **settings: Any
) -> tuple[Figure, dict[str, Axes]]:
    """Return a figure as wide as a page, with panels by name in a grid below its heading; within a look.

    Parameters
    ----------
    title, about : str
        The heading, and the line below it.
    mosaic, heights : list of lists of str, list of float
        Names of the panels, row by row, and the height of each row [em].
    apart : float
        Room between rows, for the labels of their axes [em].
    **settings
        Of `Figure.subplot_mosaic`.
    """
    em = PAGE.em
    left, right = 5.8 * em, 1.6 * em
    lines, above = heading_lines(title, about, PAGE.width - left - em, em)
    top, bottom = above + 2.4 * em, 5.2 * em
    mean = sum(heights) / len(heights)
    height = top + (sum(heights) + apart * (len(heights) - 1)) * em + bottom
    figure = new_figure(height)
    lines_at(figure, left, lines)
    grid = {
        "left": left / PAGE.width,
        "right": 1 - right / PAGE.width,
        "top": 1 - top / height,
        "bottom": bottom / height,
        "hspace": apart / mean,
        "wspace": 0.28,
        "height_ratios": heights,
    }
    return figure, figure.subplot_mosaic(mosaic, gridspec_kw=grid, **settings)


def text_size() -> float:
    """Return the size of the text in the look in force [point]."""
    return float(rcParams["font.size"])


def legend_above(axes: Axes, **settings: Any) -> None:
    """Put the legend of some axes above them, in one line from their left end: it covers no data."""
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=9, borderaxespad=0.4, **settings)


def short(value: float) -> str:
    """Return a number of at least 0 with three significant digits, in plain notation.

    >>> short(0.12345), short(1234.5), short(2e-7), short(0.0)
    ('0.123', '1234', '< 0.0001', '0')
    """
    if 0 < value < 1e-4:
        return "< 0.0001"
    if value >= 1000:
        return f"{value:.0f}"
    return f"{value:.3g}"


def png_bytes(figure: Figure) -> bytes:
    """Return a figure as a PNG without date or versions: equal figures give equal bytes."""
    stream = io.BytesIO()
    words = _MARK.get()
    size = 90 * figure.get_figwidth() / max(len(words), 1)  # letters are about 0.6 of it wide
    mark = figure.text(
        0.5, 0.5, words, rotation=20, size=size, color=LIMIT, alpha=0.25, ha="center", va="center"
    )
    with _DRAWING, rc_context(_DEFAULTS | {"savefig.dpi": "figure"}):
        figure.savefig(stream, format="png", metadata={"Software": None})
    mark.remove()
    return stream.getvalue()


@contextmanager
def marked_figures(words: str) -> Iterator[None]:
    """Write words across every figure that is made meanwhile; nothing where they are empty."""
    token = _MARK.set(words)
    try:
        yield
    finally:
        _MARK.reset(token)


def write_png(path: Path, figure: Figure) -> None:
    """Write a figure as a PNG file, whole."""
    write_whole(path, png_bytes(figure))
