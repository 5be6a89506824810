"""Visual adaptation (Section 4.4): how far the cones' response lags where brightness changes.

The luminance of each frame is kept at a few blocks of pixels while the video streams past. The table and the
histogram are those of the paper, with constant dimming beside them: a picture that moves makes cones lag too.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from evenlight.analysis.figure_style import BASELINE, LIMIT, OURS, PERCENT, drawable, look, panels
from evenlight.analysis.published import PublishedValue, published_values
from evenlight.analysis.report import Cell, Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.reproduction.published_beside import LAG, LAG_RATIO, beside_table, marked
from evenlight.analysis.results import Analysis, Drawing
from evenlight.analysis.rows import Plot, Rows
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin, PlottedPoint, Statistic
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.method.adaptation import adapting
from evenlight.method.choices import SolverName
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS, dimmed_luminance, linear_channels
from evenlight.method.optimizer.optimize import Problem, optimize
from evenlight.method.optimizer.splitting import make_solver

TABLE = "adaptation"
BINS_PER_DECADE = 5
SHOWN = (-5, -1)  # powers of ten between which the bars are; what is beyond counts in the last ones
LARGE = 0.01  # a difference to count; the static response to a display lies between 0.02 and 0.12
NO_LIMIT = 1e9  # [cd/m^2/s] the sun's luminance within a second: no step of a display comes near
METHOD = "cones after Pattanaik et al. 2000; updated exactly, integrated within frames"
UNIT_UNKNOWN = "the paper prints no unit: not comparable in size"
LARGEST_RESPONSE = 1.0  # so that no average of differences of responses can be larger
BEYOND = f"beyond what two responses from 0 to {LARGEST_RESPONSE:g} can differ by"
DIFFERENCE = "average difference"  # as printed
LARGER = "sequences with a larger difference without a rate limit"
INTEGRAL = LAG.partition(":")[0]
MEAN = "mean of |static - dynamic response| over time"
ROOT_MEAN_SQUARE = "root mean square of the difference"
# In the order of `lag`.
NUMBERS = (
    (INTEGRAL, "s"),
    (MEAN, "1"),
    (ROOT_MEAN_SQUARE, "1"),
    ("largest difference", "1"),
    (f"share of the time with a difference above {LARGE:g}", "1"),
)
Map = NDArray[np.float32]
Key = tuple[str, "Cones", "Dimming"]  # of a sequence


class Dimming(enum.Enum):
    """How a sequence is dimmed to its mean brightness factor."""

    CONSTANT = "constant dimming"
    CONSTRAINED = "within the rate limit"
    UNCONSTRAINED = "without a rate limit"


class Cones(enum.Enum):
    """Where the cones are."""

    PIXEL = "per pixel"  # the eye rests on the display: each pixel keeps its cones
    FRAME_MEAN = "frame mean"  # the eye wanders: all cones see the mean


PUBLISHED = {Dimming.CONSTRAINED: "constrained", Dimming.UNCONSTRAINED: "unconstrained"}
PLACES = {
    Cones.PIXEL: "each block of pixels by itself: the eye rests",
    Cones.FRAME_MEAN: "mean of the frame: the eye wanders",
}
STYLES: dict[Dimming, dict[str, Any]] = {
    Dimming.CONSTANT: {"color": BASELINE, "linewidth": 3.0, "alpha": 0.75},
    Dimming.CONSTRAINED: {"color": OURS, "linewidth": 1.3},
    Dimming.UNCONSTRAINED: {"color": LIMIT, "linewidth": 1.5, "linestyle": (0, (3, 1.2))},
}


@dataclass(slots=True)
class LuminanceMaps:
    """Means of the luminance at factor 1 over blocks of pixels, frame by frame.

    >>> maps = LuminanceMaps(Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0), width=2)
    >>> white = Frame(0.0, 0.04, np.full((9, 18, 3), 255, np.uint8))
    >>> _ = list(maps.watch([white]))
    >>> maps.emitted[0].round(4).tolist()
    [[100.0, 100.0]]
    """

    display: Display  # which shows the video
    width: int = 48  # blocks across; as many down as make them nearly square, at most one for each pixel
    durations: list[float] = field(default_factory=list)  # how long each frame is shown [s]
    emitted: list[Map] = field(default_factory=list)  # I of each, reflected light excluded, (h, w) [cd/m^2]
    _table: NDArray[Any] = field(default_factory=lambda: np.empty(0), repr=False)

    def watch(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Yield the frames unchanged, keeping the luminance of each."""
        for frame in frames:
            self.durations.append(frame.duration)
            self.emitted.append(self._reduced(frame.pixel_values))
            yield frame

    def _reduced(self, pixel_values: NDArray[Any]) -> Map:
        """Return the means of a frame's blocks; blocks of linear values, so that the mean is the light's."""
        height, width = pixel_values.shape[:2]
        across = min(self.width, width)
        down = min(max(round(across * height / width), 1), height)
        blocks = block_means(self._linear(pixel_values) @ np.array(LUMINANCE_WEIGHTS), (down, across))
        span = self.display.peak_luminance - self.display.black_level
        return (blocks * span + self.display.black_level).astype(np.float32)

    def _linear(self, pixel_values: NDArray[Any]) -> NDArray[Any]:
        """Return linear channels in [0, 1]; of integers by a table, which takes a tenth of the time."""
        if not np.issubdtype(pixel_values.dtype, np.integer):
            return linear_channels(pixel_values, self.display.gamma)
        codes = np.iinfo(pixel_values.dtype).max + 1
        if len(self._table) != codes:
            self._table = linear_channels(np.arange(codes, dtype=pixel_values.dtype), self.display.gamma)
        return np.asarray(self._table[pixel_values])

    def seen(self, factors: Array, cones: Cones) -> Map:
        """Return L = b · I + L_refl of each frame and place, (N, h, w) [cd/m^2], at factors b, (N,)."""
        emitted = np.stack(self.emitted).astype(np.float64)
        if len(factors) != len(emitted):
            raise InputError(f"expected a factor for each of {len(emitted)} frames, got {len(factors)}")
        blocks = block_means(emitted, (1, 1)) if cones is Cones.FRAME_MEAN else emitted
        return dimmed_luminance(blocks, factors.reshape(-1, 1, 1), self.display).astype(np.float32)


def block_means(values: NDArray[Any], shape: tuple[int, int]) -> NDArray[Any]:
    """Return the means of images, (..., height, width), over h x w blocks of nearly the same size.

    >>> block_means(np.arange(6.0).reshape(2, 3), (1, 3)).tolist()
    [[1.5, 2.5, 3.5]]
    """
    for axis, count in ((-2, shape[0]), (-1, shape[1])):
        edges = np.arange(count + 1) * values.shape[axis] // count
        sums = np.add.reduceat(values, edges[:-1], axis=axis, dtype=np.float64)
        values = sums / np.expand_dims(np.diff(edges), -1 if axis == -2 else 0)
    return values


def unconstrained_factors(problem: Problem) -> Array:
    """Return the factors of the same problem without a rate limit, (N,)."""
    free = replace(problem, rate_limit=lambda luminance: np.full_like(luminance, NO_LIMIT))
    solver = make_solver(SolverName.SPLITTING, np.random.default_rng(0))  # which draws nothing
    return optimize(free, solver).factors


def bar_edges() -> Array:
    """Return the edges of the histogram's bars, (bars + 1,).

    >>> edges = bar_edges()
    >>> edges.size, round(float(edges[0]), 9), round(float(edges[-1]), 9)
    (21, 1e-05, 0.1)
    """
    return np.logspace(*SHOWN, (SHOWN[1] - SHOWN[0]) * BINS_PER_DECADE + 1)


def lag(luminance: NDArray[np.floating], durations: Sequence[float]) -> tuple[dict[str, float], Array]:
    """Return how much static and dynamic response to a video differ, integrated exactly over time.

    Of luminance L, (N, h, w) [cd/m^2], of frames that are shown so long [s]: `NUMBERS`, means of the places;
    and the share of time and places in each bar, (bars,), 1 in all.

    >>> lag(np.full((2, 1, 1), 50.0), [0.04, 0.04])[0][INTEGRAL]
    0.0
    """
    bars = len(bar_edges()) - 1
    time_in_bar = np.zeros(bars)
    first = second = large = largest = 0.0
    for parts, weights in adapting(luminance, np.asarray(durations, dtype=np.float64)):
        flat = parts.reshape(len(weights), -1)
        share = weights / flat.shape[1]
        first += float(share @ flat.sum(axis=1))
        second += float(share @ (flat**2).sum(axis=1))
        large += float(share @ (flat > LARGE).sum(axis=1))
        largest = max(largest, float(flat.max()))
        logs = np.log10(np.maximum(flat, 10.0 ** SHOWN[0]))
        at = np.minimum(((logs - SHOWN[0]) * BINS_PER_DECADE).astype(np.intp), bars - 1)
        time_in_bar += np.bincount(at.ravel(), np.repeat(share, flat.shape[1]), minlength=bars)
    whole = float(np.sum(durations))
    numbers = (first, first / whole, math.sqrt(second / whole), largest, large / whole)
    return {what: own for (what, _), own in zip(NUMBERS, numbers, strict=True)}, time_in_bar / whole


def adaptation_findings(
    sequences: Mapping[str, tuple[LuminanceMaps, Mapping[Dimming, Array]]], *, drawn: bool = True
) -> Analysis:
    """Return how far the cones' adaptation lags: constant dimming, and tracks with and without a rate limit.

    Parameters
    ----------
    sequences : mapping of str to (LuminanceMaps, mapping of Dimming to array (N,))
        By name: luminance at factor 1, and the factors of each way to dim it.
    drawn : bool
        Whether the rate limit is that of participants drawn around the published one.

    Raises
    ------
    InputError
        If factors do not fit the frames.
    """
    rows, lags = Rows(Origin.COMPUTED), dict[Key, tuple[dict[str, float], Array]]()
    for name, (maps, dimmings) in sequences.items():
        for cones in Cones:
            for dimming, factors in dimmings.items():
                seen = maps.seen(factors, cones)
                lags[name, cones, dimming] = numbers, _ = lag(seen, maps.durations)
                method = f"{METHOD}; n frames, {seen[0].size} places"
                for what, unit in NUMBERS:
                    where = f"{what}: {cones.value}, {dimming.value}"
                    rows.add(TABLE, name, where, unit, method, numbers[what], len(seen))
            constant, *others = (lags[name, cones, way][0][MEAN] for way in Dimming)
            still = "" if constant > 0 else "nothing changes under constant dimming: there is no ratio"
            for dimming, own in zip(PUBLISHED, others, strict=True):
                what = f"excess over constant dimming: {cones.value}, {dimming.value}"
                method = "mean difference, relative to that of constant dimming of the same mean factor"
                excess = own / constant - 1 if constant > 0 else None
                rows.add(TABLE, name, what, "1", method, excess, len(maps.emitted), flag=still)
        own_lags = [lags[name, Cones.PIXEL, way][0][INTEGRAL] for way in PUBLISHED]
        _add_published(rows, name, own_lags, drawn=drawn)
    larger = _add_orderings(rows, lags, list(sequences))
    drawing = _histogram(sequences, lags)
    durations = [seconds for maps, _ in sequences.values() for seconds in maps.durations]

    def excess_in_words(cones: str, dimming: str) -> str:
        """Return by how much the lag of all sequences exceeds that of constant dimming."""
        own, constant = (
            sum(lags[name, Cones[cones], way][0][INTEGRAL] for name in sequences)
            for way in (Dimming[dimming], Dimming.CONSTANT)
        )
        return f"{100 * (own / constant - 1):+.0f} %" if constant > 0 else "no ratio"

    about = section(
        "reproduction/adaptation",
        tuple(_tables(rows, list(sequences), drawn=drawn)),
        (drawing.picture,),
        larger=larger,
        count=len(sequences),
        excess=excess_in_words,
        beyond=[f"{row.value:g}" for row in rows if row.origin is Origin.PUBLISHED and BEYOND in row.flag],
        why_beyond=BEYOND,
        frames=len(durations),
        held_ms=1000 * sum(durations) / len(durations),
    )
    return Analysis(TABLE, about.paragraphs[0], tuple(rows), (drawing,), (about,))


def _printed(name: str) -> list[PublishedValue]:
    """Return what Table 2 prints of a sequence: within the rate limit, and without one; or nothing."""
    return [value for key in PUBLISHED.values() for value in published_values(f"{TABLE}.{name}.{key}")]


def _add_published(rows: Rows, name: str, lags: Sequence[float], *, drawn: bool) -> None:
    """Add what Table 2 prints of a sequence, and the ratio of its two numbers beside ours."""
    printed = _printed(name)
    for dimming, value in zip(PUBLISHED, printed, strict=False):
        flag = f"{UNIT_UNKNOWN}; {BEYOND}" if value.number > LARGEST_RESPONSE else UNIT_UNKNOWN
        what, origin = f"{DIFFERENCE}, {dimming.value}", Origin.PUBLISHED
        rows.add(TABLE, name, what, value.unit, value.place, value.number, flag=flag, origin=origin)
    if not printed:
        return
    ratio = printed[1].number / printed[0].number
    rows.add(TABLE, name, LAG_RATIO, "1", printed[0].place, ratio, origin=Origin.PUBLISHED)
    own = rows.find(TABLE, name, f"{LAG}, {Dimming.UNCONSTRAINED.value}")
    assert own is not None
    held, free = lags
    ours = replace(own, what=LAG_RATIO, unit="1", value=free / held if held > 0 else None)
    rows.append(marked(ours, drawn=drawn))


def _add_orderings(rows: Rows, lags: Mapping[Key, tuple[dict[str, float], Array]], names: list[str]) -> int:
    """Add in how many sequences the difference is larger without a rate limit: what can be compared."""
    found = {
        f"{LARGER}: {cones.value}": [[lags[name, cones, way][0][MEAN] for way in PUBLISHED] for name in names]
        for cones in Cones
    }
    printed = [[value.number for value in _printed(name)] for name in names if _printed(name)]
    for what, values in (found | {LARGER: printed}).items():
        if values:
            origin = Origin.PUBLISHED if what == LARGER else Origin.COMPUTED
            larger = sum(free > held for held, free in values)
            rows.add("ordering", "all", what, "1", "n sequences", larger, len(values), origin=origin)
    return sum(free > held for held, free in found[f"{LARGER}: {Cones.PIXEL.value}"])


def _thousandths(row: Statistic | None) -> tuple[Cell]:
    return (None if row is None or row.value is None else 1000 * row.value,)


def _tables(rows: Rows, names: Sequence[str], *, drawn: bool) -> Iterator[Table]:
    """Yield the paper's table beside ours, and for each place of the cones how far they lag."""
    ways = [way.value for way in Dimming]
    yield beside_table(
        "Table 2: difference of static and dynamic cone response, per pixel. The paper prints no unit: what "
        "can be compared is the ratio.",
        rows,
        drawn=drawn,
    )
    whats = (MEAN, ROOT_MEAN_SQUARE)
    for cones in Cones:
        yield rows.view(
            f"Average over time and root mean square (RMS) of the difference, x 1000 [1]: {PLACES[cones]}.",
            {name: in_words(name) for name in names},
            [(TABLE, f"{what}: {cones.value}, {way}", _thousandths) for what in whats for way in ways],
            ("sequence", *(f"average, {way}" for way in ways), *(f"RMS, {way}" for way in ways)),
        )


def _histogram(
    sequences: Mapping[str, tuple[LuminanceMaps, Mapping[Dimming, Array]]],
    lags: Mapping[Key, tuple[dict[str, float], Array]],
) -> Drawing:
    """Draw the histogram of the differences; further to the right are larger ones."""
    points: list[PlottedPoint] = []
    frames = sum(len(maps.emitted) for maps, _ in sequences.values())
    high, wide = next(iter(sequences.values()))[0].emitted[0].shape
    mosaic = [[f"{name}, {cones.value}" for cones in Cones] for name in sequences]
    about = (
        f"{len(sequences)} rendered sequences, {frames} frames, {wide} × {high} blocks each. Further "
        "right is more lag. ▼ and numbers: means."
    )
    with look():
        title, heights = "How far the response of the cones lags behind the picture", [7.6] * len(sequences)
        figure, axes = panels(title, about, mosaic, heights, apart=2.6, sharex=True)
        for name, (maps, dimmings) in sequences.items():
            highest = max(shares.max() for key, (_, shares) in lags.items() if key[0] == name)
            for cones in Cones:
                panel = f"{name}, {cones.value}"
                units = ("difference of the responses", "1", "share of time", "1")
                plot = Plot(axes[panel], panel, Origin.COMPUTED, units)
                for place, dimming in enumerate(Dimming):
                    numbers, shares = lags[name, cones, dimming]
                    _draw_bars(plot, dimming, shares, (numbers[MEAN], place))
                points += [replace(point, n=len(maps.emitted)) for point in plot.points]
                plot.axes.set_ylim(0, 1.32 * highest)
                plot.axes.yaxis.set_major_formatter(PERCENT)
                words = f"{name.replace('_', ' ')} ({dimmings[Dimming.CONSTANT][0]:g}), {cones.value}"
                plot.axes.set_title(drawable(words), loc="left")
        for own in mosaic[-1]:
            axes[own].set(xscale="log", xlim=bar_edges()[[0, -1]], xlabel="|static − dynamic| response [1]")
            axes[own].xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.5f}".rstrip("0")))
        for row in mosaic:
            axes[row[0]].set_ylabel("share of time")
        figure.legend(*axes[mosaic[0][0]].get_legend_handles_labels(), ncols=3, loc="lower center")
    (caption,) = prose("reproduction/adaptation_caption")
    return Drawing("adaptation_histogram", figure, caption, tuple(points))


def _draw_bars(plot: Plot, dimming: Dimming, shares: Array, mean: tuple[float, int]) -> None:
    """Draw a histogram and its mean (with its place in the list of means); note each bar at its middle."""
    edges, (value, place) = bar_edges(), mean
    for middle, share in zip(np.sqrt(edges[:-1] * edges[1:]), shares, strict=True):
        plot.note(dimming.value, float(middle), min(float(share), 1.0))
    plot.note(f"{dimming.value}, mean", value, None)
    axes, colour = plot.axes, STYLES[dimming]["color"]
    if dimming is Dimming.UNCONSTRAINED:
        axes.stairs(shares, edges, fill=True, color=colour, alpha=0.13, linewidth=0)
    axes.stairs(shares, edges, label=dimming.value, **STYLES[dimming])
    at = min(max(value, edges[0]), edges[-1])
    axes.plot([at], [0.03], "v", transform=axes.get_xaxis_transform(), color=colour, clip_on=False, zorder=5)
    top, style = 0.98 - 0.17 * place, {"color": colour, "ha": "right", "va": "top"}
    axes.text(0.99, top, f"{value:.5f}", transform=axes.transAxes, **style)
