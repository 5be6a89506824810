"""What is told of the measured power of a played video: lines, cards, tables, figure, report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from evenlight.analysis import figure_style as style
from evenlight.analysis.report import Cell, KeyFigure, Picture, Report, Section, Table, write_report
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.report_sections import files_section, provenance_section
from evenlight.analysis.results import Result
from evenlight.analysis.wording import sentence
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.recordings.played_power import FrameEnergy, FrameFlag, PlayedPower
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json_record

if TYPE_CHECKING:
    import pandas as pd

COLOURS = {"baseline": style.BASELINE, "ours": style.OURS, "full": style.MUTED}
PLAYED_POWER, FRAME_ENERGIES = "played_power.json", "frame_energy.csv"
FIGURE, REPORT = "power.png", "report.html"
FILES = {
    PLAYED_POWER: "all of it, for programs: the tables of this page, passes, clock",
    FRAME_ENERGIES: "energy of each frame shown",
    FIGURE: "the figure of this page",
}
EQUAL_SHARE = 0.01  # of full brightness: powers closer than this count as equal
MANY_LOST = 0.05  # share of the time that had to be bridged
NAMES = {"ours": "the track", "baseline": "baseline", "full": "full brightness"}
MOST_POINTS = 1000  # of a line: more do not show


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class MeasuredPower(Result):
    """What was measured of a played video.

    Attributes
    ----------
    power, energies : PlayedPower, sequence of FrameEnergy
        Passes, versions and clock; and the frames.
    """

    made_by: ClassVar = "fit"
    power: PlayedPower
    energies: Sequence[FrameEnergy]

    @property
    def heading(self) -> str:
        """What was measured of which video."""
        return f"{'Simulated power' if self.power.simulated else 'Power'} of {self.power.video}"

    @property
    def first_lines(self) -> tuple[str, tuple[KeyFigure, ...]]:
        """What the track saves, and whether it takes as much as constant dimming."""
        words = _comparisons(self.power)
        if not words:
            words = tuple(f"{NAMES[one.version]} takes {one.mean_power:.4g} W" for one in self.power.versions)
        lead = " ".join(f"{sentence(part)}." for part in words).replace(" %", "\u00a0%")
        return lead, tuple(_key_figures(self.power))

    @property
    def figures(self) -> Mapping[str, Figure]:
        """Power over time and the means of the passes, by name."""
        words = "; ".join(_comparisons(self.power)) or "one version was measured, and compared with no other"
        return {"power": _figure(self.power, self.energies, sentence(words))}

    @property
    def lines(self) -> tuple[str, ...]:
        """What came out, line by line, as a terminal shows it."""
        clock = _clock_words(self.power)
        return prose("power_lines", power=self.power, clock=clock, names=NAMES, mw=_mw)

    def to_frame(self) -> pd.DataFrame:
        """Return what was measured of each version: `versions` in `played_power.json`."""
        import pandas as pd

        return pd.DataFrame([mapping_from_record(one) for one in self.power.versions])

    def write(self, folder: Path) -> None:
        """Write numbers, energies of frames, figure and report."""
        write_json_record(folder / PLAYED_POWER, self.power)
        write_rows(folder / FRAME_ENERGIES, FrameEnergy, self.energies)
        caption = prose("power_caption", power=self.power)[0]
        picture = Picture(style.write_figure(folder / FIGURE, self.figures["power"]), caption)
        sections = (
            _average_section(self.power, picture),
            _time_section(self.power, self.energies),
            provenance_section({"power": self.power.provenance}),
            files_section(FILES),
        )
        (lead, cards), simulated = self.first_lines, prose("power_simulated")[0]
        page = Report(self.heading, lead, sections, simulated, key_figures=cards)
        write_report(folder / REPORT, page)


def _key_figures(power: PlayedPower) -> Iterator[KeyFigure]:
    ours = next((one for one in power.versions if one.version == "ours"), None)
    if ours:
        others = (one for one in power.versions if one is not ours)
        beside = ", ".join(f"{NAMES[one.version]} {one.mean_power:.3f} W" for one in others)
        yield KeyFigure(f"{ours.mean_power:.3f} W", "the track", beside)
    if ours and ours.saving_percent is not None:
        low, high = ours.saving_percent_ci_low, ours.saving_percent_ci_high
        interval = "" if low is None else f"{low:.2f} to {high:.2f} %"
        yield KeyFigure(f"{ours.saving_percent:.2f} %", "saved against full brightness", interval)
    if (equal := power.equal_power) is not None:
        low, high = equal.ci_low, equal.ci_high
        interval = "" if low is None or high is None else f"{_mw(low)} to {_mw(high)} mW"
        yield KeyFigure(f"{_mw(equal.difference)} mW", "the track less constant dimming", interval)
    used, bridged = sum(one.used for one in power.passes), power.samples.bridged_share
    yield KeyFigure(
        f"{used} of {len(power.passes)}",
        "passes count",
        f"{100 * bridged:.2g} % of the time without samples",
        warns=used < len(power.passes) or bridged > MANY_LOST,
    )


def _comparisons(power: PlayedPower) -> tuple[str, ...]:
    return prose("power_comparisons", power=power, mw=_mw)


def _average_section(power: PlayedPower, picture: Picture) -> Section:
    begun = power.passes[0].begun
    predicted = any(one.predicted_power is not None for one in power.versions)
    versions = _table(
        f"Average power of {power.video}, what is saved against full brightness, freed from drift, and the "
        "mean of the brightness factor b that was achieved, with 95 % confidence intervals."
        + f" Predicted: by the model {power.power_model}, from the mean of b."
        * predicted,
        power.versions,
        {
            "version": lambda one: NAMES[one.version],
            "passes": lambda one: one.n_passes,
            "power [W]": lambda one: f"{one.mean_power:.4f}",
            "SD of passes [mW]": lambda one: None if one.sd_power is None else f"{1000 * one.sd_power:.2g}",
            "interval [W]": lambda one: _interval(one.ci_low, one.ci_high, 4),
            **({"predicted [W]": lambda one: _fixed(one.predicted_power, 4)} if predicted else {}),
            "saves [%]": lambda one: _fixed(one.saving_percent, 2),
            "interval [%]": lambda one: _interval(one.saving_percent_ci_low, one.saving_percent_ci_high, 2),
            "mean b": lambda one: f"{one.mean_factor:.4f}",
        },
    )
    passes = _table(
        "Passes in the order in which they were played. Bridged: time without a sample, where power was "
        "interpolated. Left out: frames without an energy.",
        power.passes,
        {
            "pass": lambda one: one.pass_index + 1,
            "version": lambda one: NAMES[one.version],
            "begun [s]": lambda one: f"{one.begun - begun:.1f}",
            "power [W]": lambda one: _fixed(one.mean_power, 4),
            "mean b": lambda one: f"{one.mean_factor:.4f}",
            "measured": lambda one: f"{100 * one.measured_share:.1f} %",
            "bridged": lambda one: f"{100 * one.bridged_share:.2g} %",
            "frames": lambda one: one.n_frames,
            "left out": lambda one: one.n_left_out,
            "refreshes dropped": lambda one: one.n_dropped,
            "counts": lambda one: "yes" if one.used else "no",
        },
    )
    return section(
        "power_average",
        (versions, passes),
        (picture,),
        simulated=power.simulated,
        power=power,
        hours=(power.passes[-1].begun - begun) / 3600,
        equal_percent=100 * EQUAL_SHARE,
    )


def _table(caption: str, records: Sequence[Any], columns: Mapping[str, Callable[[Any], Cell]]) -> Table:
    rows = (tuple(cell(one) for cell in columns.values()) for one in records)
    return Table(caption, tuple(columns), tuple(rows))


def _fixed(value: float | None, digits: int) -> str | None:
    return None if value is None else f"{value:.{digits}f}"


def _interval(low: float | None, high: float | None, digits: int) -> str | None:
    return None if low is None or high is None else f"{low:.{digits}f} to {high:.{digits}f}"


def _time_section(power: PlayedPower, energies: Sequence[FrameEnergy]) -> Section:
    count, flags = power.samples, Counter(frame.flag for frame in energies)
    rows: tuple[tuple[Cell, ...], ...] = (
        ("samples that came", count.n_samples, "1"),
        ("samples lost", count.n_lost, "1"),
        ("samples that came again", count.n_duplicated, "1"),
        ("time without a sample", f"{100 * count.bridged_share:.2g}", "%"),
        ("longest time without a sample", f"{1000 * count.longest_gap:.3g}", "ms"),
        ("rate of the samples", power.sample_rate, "Hz"),
        ("rate of the display", power.refresh_rate, "Hz"),
        ("frames with an energy of their own", flags[FrameFlag.OK], "1"),
        ("frames shorter than the time between samples", flags[FrameFlag.UNRESOLVED], "1"),
        ("frames left out", flags[FrameFlag.GAP] + flags[FrameFlag.OUTSIDE], "1"),
    )
    table = Table("Samples and frames.", ("quantity", "value", "unit"), rows)
    return section("power_time", (table,), simulated=power.simulated, clock=_clock_words(power))


def _clock_words(power: PlayedPower) -> str:
    return prose("power_clock", clock=power.clock)[0]


def _mw(power: float) -> str:
    """Return a power in mW, with two decimals where it is small.

    >>> _mw(-0.000236), _mw(0.01718), _mw(0.1718), _mw(-0.000001)
    ('-0.24', '17.2', '172', '0.00')
    """
    value = 1000 * power
    decimals = 2 if abs(value) < 10 else 1 if abs(value) < 100 else 0
    return f"{value:z.{decimals}f}"


def _figure(power: PlayedPower, energies: Sequence[FrameEnergy], words: str) -> Figure:
    title = f"{'SIMULATED power' if power.simulated else 'Measured power'} of {power.video}"
    with style.look():
        shape: dict[str, Any] = {"width_ratios": [7, 3], "sharey": True}
        figure, axes = style.panels(title, words, [["time", "means"]], [24.0], **shape)
        _draw_over_time(axes["time"], power, energies)
        _draw_means(axes["means"], power)
        highest = 1.08 * axes["time"].get_ylim()[1]
        axes["time"].set_ylim(0.0, highest)
        _draw_model(axes["means"], power, highest)
    return figure


def _draw_over_time(axes: Axes, power: PlayedPower, energies: Sequence[FrameEnergy]) -> None:
    thin = style.text_size() / 14
    typical = float(np.median([frame.duration for frame in energies]))
    n_points = max(min(MOST_POINTS, round(power.duration / typical)), 1)
    edges = np.linspace(0, power.duration, n_points + 1)
    for one in power.versions:
        colour = COLOURS[one.version]
        passes = [each for each in power.passes if each.used and each.version == one.version]
        curves = np.array([_binned(energies, each.pass_index, each.begun, edges) for each in passes])
        middle = (edges[1:] + edges[:-1]) / 2
        if len(edges) == 2:  # a video of one frame
            middle, curves = edges, np.repeat(curves, 2, axis=1)
        if len(curves) > 1:
            ends = curves.min(axis=0), curves.max(axis=0)
            axes.fill_between(middle, *ends, color=colour, alpha=0.25, linewidth=0)
        dashes = "--" if one.version == "baseline" else "-"
        axes.plot(middle, curves.mean(axis=0), dashes, color=colour, label=NAMES[one.version])
        axes.axhline(one.mean_power, color=colour, linewidth=thin, linestyle=":")
    axes.plot([], [], ":", color=style.MUTED, linewidth=thin, label="mean")
    if any(one.n_passes > 1 for one in power.versions):
        axes.add_patch(Rectangle((0, 0), 0, 0, facecolor=style.FAINT, label="passes' range"))
    style.legend_above(axes)
    axes.set(xlim=(0, power.duration), xlabel="time in the video [s]", ylabel="power [W]")


def _binned(energies: Sequence[FrameEnergy], index: int, begun: float, edges: Array) -> Array:
    """Return the mean power of a pass between some times; NaN where a frame was left out, or none shown."""
    frames = [frame for frame in energies if frame.pass_index == index]
    ends = np.array([frame.begun + frame.duration - begun for frame in frames])
    spent = np.array([np.nan if frame.energy is None else frame.energy for frame in frames])
    total = np.concatenate([[0.0], np.cumsum(np.nan_to_num(spent))])
    lost = np.concatenate([[0.0], np.cumsum(np.isnan(spent))])
    times = np.concatenate([[0.0], ends])
    lasted = np.diff(np.minimum(edges, ends[-1]))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.diff(np.interp(edges, times, total)) / lasted
    unknown = (np.diff(np.interp(edges, times, lost)) > 0) | (lasted < np.diff(edges) / 2)
    return np.where(unknown, np.nan, mean)


def _draw_means(axes: Axes, power: PlayedPower) -> None:
    size = style.text_size()
    for place, one in enumerate(power.versions):
        colour = COLOURS[one.version]
        means = np.array([p.mean_power for p in power.passes if p.used and p.version == one.version])
        spread = 0.25 * (np.arange(len(means)) - (len(means) - 1) / 2) / max(len(means) - 1, 1)
        axes.plot(
            place - 0.2 + spread, means, "o", color=colour, ms=0.35 * size, alpha=0.6, markeredgewidth=0
        )
        if one.ci_low is not None and one.ci_high is not None:
            axes.plot([place + 0.1] * 2, [one.ci_low, one.ci_high], color=colour, linewidth=size / 5)
        axes.plot([place + 0.1], [one.mean_power], "D", color=colour, ms=0.45 * size)
    axes.set_xlim(-0.6, len(power.versions) - 0.4)
    names = [f"{NAMES[one.version]}\n{one.mean_power:.3f} W" for one in power.versions]
    axes.set_xticks(range(len(power.versions)), names)
    axes.tick_params(axis="x", length=0)


def _draw_model(axes: Axes, power: PlayedPower, highest: float) -> None:
    """Draw what a model predicts, as far as it is on the scale of what was measured, and the legend."""
    size, predicted = style.text_size(), [one.predicted_power for one in power.versions]
    shown = [(k + 0.35, watts) for k, watts in enumerate(predicted) if watts is not None and watts <= highest]
    axes.plot([], [], "o", color=style.MUTED, ms=0.35 * size, label="pass")
    axes.plot([], [], "D", color=style.MUTED, ms=0.45 * size, label="mean")
    if shown:
        dash: dict[str, Any] = {"color": style.INK, "ms": 0.8 * size, "markeredgewidth": size / 8}
        axes.plot(*zip(*shown, strict=True), "_", label="model", **dash)
    style.legend_above(axes, handlelength=1.0, columnspacing=1.0)
