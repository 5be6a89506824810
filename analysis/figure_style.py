"""One look for every figure: media, colours, type, and files that are the same on every run."""

from __future__ import annotations

import io
import itertools
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from threading import RLock
from typing import Any

from matplotlib import rc_context, rc_params_from_file, rcParams, rcParamsDefault
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import Collection
from matplotlib.colors import get_named_colors_mapping, to_rgba
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter

from evenlight.data_schema.arguments import must_be_one_of
from evenlight.data_schema.errors import ArgumentError
from evenlight.data_schema.mapping import unknown_key
from evenlight.data_schema.storage.text_files import read_text
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
KINDS = ("svg", "pdf")  # of files that a figure can have beside its PNG
LOOKED_UP = ("color", "markerfacecolor", "markeredgecolor", "facecolor", "edgecolor")
_BEGUN: list[Figure] = []  # in the look in force
_DRAWING = RLock()  # matplotlib's settings are those of the process
# A `matplotlibrc` of the current folder may say others, and run LaTeX. DejaVu Sans comes with Matplotlib.
_DEFAULTS: dict[Any, Any] = {key: value for key, value in rcParamsDefault.items() if key != "backend"}
_DEFAULTS |= {"savefig.dpi": "figure", "pdf.fonttype": 42}
_DEFAULTS |= {"agg.path.chunksize": 5000}  # points of a line at a time: 90 000 at once take 60 MB and more
_DEFAULTS |= {"svg.fonttype": "none", "svg.hashsalt": "evenlight", "font.sans-serif": ["DejaVu Sans"]}
# What a file would otherwise say of the time and the software.
UNSAID = {"png": "Software", "svg": "Date Creator", "pdf": "CreationDate Creator Producer"}
OURS_ALONE = re.compile(r"backend|figure\.(?!facecolor|dpi)|text\.(usetex|parse_math)")  # "50 %$.mp4"


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


@dataclass(frozen=True, slots=True)
class FiguresAsked:
    """How figures are drawn and written, and in other processes for the same result."""

    mark: str = ""  # across each
    kinds: tuple[str, ...] = ()  # of files beside the PNG
    style: dict[Any, Any] = field(default_factory=dict)  # settings of a style sheet


ASKED: ContextVar[FiguresAsked] = ContextVar("asked", default=FiguresAsked())  # noqa: B039 - frozen
PAGE = FigureFormat(width=8.0, height=8.2, font_size=9.0, dots_per_inch=200.0)  # the report, a supplement


@contextmanager
def look(medium: FigureFormat = PAGE) -> Iterator[None]:
    """Draw for a medium, one thread at a time: `with look(): ...`."""
    style = ASKED.get().style
    size = style.get("font.size", medium.font_size)
    hair = size / 11
    settings: dict[Any, Any] = {
        "font.size": size,
        "mathtext.fontset": "dejavusans",
        "axes.titlesize": size,
        "axes.labelsize": size,
        "legend.fontsize": size * 0.95,
        "text.color": INK,
        "axes.labelcolor": INK,
        "axes.edgecolor": MUTED,
        "axes.linewidth": hair,
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
        "path.simplify": True,
        "text.parse_math": False,  # a "$" in the name of a video is a dollar
    }
    for ticks in ("xtick", "ytick"):
        settings |= {f"{ticks}.labelsize": size * 0.92, f"{ticks}.color": MUTED, f"{ticks}.labelcolor": INK}
        settings |= {f"{ticks}.major.width": hair, f"{ticks}.minor.width": hair * 0.6}
        settings |= {f"{ticks}.major.size": size * 0.35, f"{ticks}.minor.size": size * 0.2}
    with _DRAWING, rc_context(_DEFAULTS | settings | style), _colours_of(style):
        yield


@contextmanager
def _colours_of(style: Mapping[str, Any]) -> Iterator[None]:
    """Have the colours of a style sheet in place of ours: those of its lines, of words, axes and grid."""
    cycle = style["axes.prop_cycle"].by_key().get("color", ()) if "axes.prop_cycle" in style else ()
    theirs = dict(zip((OURS, BASELINE, LIMIT, LOST, PARTICIPANT), cycle, strict=False))
    words = {INK: "text.color", MUTED: "axes.edgecolor", FAINT: "grid.color"}
    theirs |= {ours: style[key] for ours, key in words.items() if key in style}
    named = get_named_colors_mapping()  # Matplotlib looks there first, whatever a colour is called
    _BEGUN.clear()
    try:
        for ours, own in theirs.items():
            named[ours] = to_rgba(own)
        yield
        drawn = (one for figure in _BEGUN if theirs for one in figure.findobj())
        for one, part in itertools.product(drawn, LOOKED_UP):  # else Matplotlib looks it up when it draws
            if isinstance(one, Line2D | Text | Collection) and hasattr(one, f"get_{part}"):
                colour = getattr(one, f"get_{part}")()
                one.set(**{part: to_rgba(colour) if isinstance(colour, str) else colour})
    finally:
        for ours in theirs:
            del named[ours]


def new_figure(height: float | None = None, medium: FigureFormat = PAGE) -> Figure:
    """Return an empty figure as wide as a medium and so high [inch], or as high; no window knows it."""
    figure = Figure(figsize=(medium.width, height or medium.height))
    FigureCanvasAgg(figure)
    figure._repr_png_ = partial(png_bytes, figure)  # type: ignore[attr-defined] # what a notebook shows
    _BEGUN.append(figure)
    return figure


def axes_at(figure: Figure, left: float, top: float, width: float, height: float) -> Axes:
    """Return new axes with their upper left corner at so many inches from that of the figure."""
    full_width, full_height = figure.get_size_inches()
    bottom = full_height - top - height
    place = (left / full_width, bottom / full_height, width / full_width, height / full_height)
    return figure.add_axes(place)


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
    lines, step = textwrap.wrap(words, max(int(width / letter), 10), break_on_hyphens=False), 1.45 * size
    return [(part, top + k * step, style) for k, part in enumerate(lines)], top + len(lines) * step


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


def png_bytes(figure: Figure, kind: str = "png") -> bytes:
    """Return a figure as a PNG, SVG or PDF without date or versions: equal figures give equal bytes."""
    stream = io.BytesIO()
    asked = ASKED.get()
    size = 90 * figure.get_figwidth() / max(len(asked.mark), 1)  # letters are about 0.6 of it wide
    middle: dict[str, Any] = {"ha": "center", "va": "center", "rotation": 20, "alpha": 0.25}
    with _DRAWING, rc_context(_DEFAULTS | asked.style):
        mark = figure.text(0.5, 0.5, asked.mark, size=size, color=LIMIT, **middle)
        figure.savefig(stream, format=kind, metadata=dict.fromkeys(UNSAID[kind].split()))
    mark.remove()
    return stream.getvalue()


def write_figure(path: Path, figure: Figure) -> bytes:
    """Write a figure as a PNG file, whole, and beside it as what else is asked for; return the PNG."""
    files = {kind: png_bytes(figure, kind) for kind in ("png", *ASKED.get().kinds)}
    for kind, content in files.items():
        write_whole(path.with_suffix(f".{kind}"), content)
    return files["png"]


@contextmanager
def figures_like(asked: FiguresAsked) -> Iterator[None]:
    """Draw and write figures meanwhile as is asked."""
    token = ASKED.set(asked)
    try:
        yield
    finally:
        ASKED.reset(token)


def marked_figures(words: str) -> AbstractContextManager[None]:
    """Write words across every figure that is made meanwhile; nothing where they are empty."""
    return figures_like(replace(ASKED.get(), mark=words))


def figures_as(*kinds: str, style: str | Path | None = None) -> AbstractContextManager[None]:
    """Write figures for a paper: in the block, each PNG that is written has an SVG or a PDF beside it.

    Text in an SVG stays text, and a PDF holds its fonts. A style sheet counts for what is drawn in the block:
    its first five colours are those of track, constant dimming, limits, losses and participants.

    Parameters
    ----------
    *kinds : str
        "svg", "pdf", or both.
    style : str or path, optional
        A style sheet of Matplotlib (`.mplstyle`).

    Raises
    ------
    InputError
        If there is no such kind, or the style sheet cannot be used.
    """
    for kind in kinds:
        if kind not in KINDS:
            raise must_be_one_of("figures", kind, KINDS)
    settings = {} if style is None else _settings_of(str(style))
    return figures_like(replace(ASKED.get(), kinds=kinds, style=settings))


def _settings_of(style: str) -> dict[Any, Any]:
    text = read_text(Path(style), "a style sheet of Matplotlib")
    try:
        settings = rc_params_from_file(style, fail_on_error=True, use_default_template=False)
    except ValueError as error:
        raise ArgumentError("figure_style", f"{style}: {error}") from None
    for key in re.findall(r"^[ \t]*([^#\s:]+)", text, re.MULTILINE):
        if key not in settings:
            raise ArgumentError("figure_style", f"{style}: {unknown_key(key, rcParamsDefault)}")
    kept: dict[Any, Any] = {key: value for key, value in settings.items() if not OURS_ALONE.match(key)}
    families = [own for of in kept.get("font.family", ["sans-serif"]) for own in kept.get(f"font.{of}", [of])]
    return kept | {"font.family": [*families, "DejaVu Sans"]}  # for letters that theirs lack
