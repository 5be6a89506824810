"""The results of measuring a played video: table, energies, figure and the report that explains them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
    MUTED,
    OURS,
    PAGE,
    FigureFormat,
    axes_at,
    heading_lines,
    legend_above,
    lines_at,
    look,
    new_figure,
    png_bytes,
    text_size,
)
from evenlight.analysis.measurement.played_power.pass_power import EQUAL_SHARE, VERSIONS
from evenlight.analysis.measurement.played_power.power_recording import load_recording
from evenlight.analysis.measurement.played_power.power_table import (
    NAMES,
    MeasuredPower,
    clock_in_words,
    closing_lines,
    heading_in_words,
    main_findings,
    measure_power,
)
from evenlight.analysis.report import Cell, Picture, Report, Section, Table, write_report
from evenlight.analysis.report_prose import prose
from evenlight.analysis.report_sections import files_section, provenance_section
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.provenance import Provenance, provenance_now, sha256_of_file
from evenlight.data_schema.recordings.dataset_layout import (
    CLOCK_PINGS,
    FLASHES,
    FLIPS,
    POWER_LOG,
    POWER_SAMPLES,
)
from evenlight.data_schema.recordings.played_power import FrameEnergy, FrameFlag, PlayedPower, VersionPower
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.storage.whole_files import results_folder, write_whole

PLAYED_POWER, POWER_TABLE, FRAME_ENERGIES = "played_power.json", "power_table.csv", "frame_energy.csv"
FIGURE, REPORT = "power.png", "report.html"
FILES = {
    PLAYED_POWER: "all of it, for programs",
    POWER_TABLE: "the table of this page: a row for each version",
    FRAME_ENERGIES: "energy of each frame shown",
    FIGURE: "the figure of this page",
}
STYLES: dict[str, dict[str, Any]] = {
    "baseline": {"color": BASELINE, "linestyle": "--"},
    "ours": {"color": OURS},
    "full": {"color": MUTED},
}
MOST_POINTS = 1000  # of a line: more do not show


def write_power_results(folder: Path, out: Path, power_model: PowerModel | None = None) -> list[str]:
    """Write table, energies, figure and report of a played video's power, and return lines that sum it up.

    Parameters
    ----------
    folder, out : Path
        The recording, as `evenlight play --measure-power` writes it, and where to; it may be the same.
    power_model : PowerModel, optional
        Whose prediction is shown beside what was measured.

    Raises
    ------
    InputError
        If the recording cannot be used; it names the file and what is wrong.
    """
    measured = measure_power(load_recording(folder), power_model, _origin(folder, power_model))
    with results_folder(out) as staging:
        write_json_record(staging / PLAYED_POWER, measured.power)
        write_rows(staging / POWER_TABLE, VersionPower, measured.power.versions)
        write_rows(staging / FRAME_ENERGIES, FrameEnergy, measured.energies)
        png = png_bytes(power_figure(measured))
        write_whole(staging / FIGURE, png)
        write_report(staging / REPORT, power_report(measured, png))
    return [*closing_lines(measured.power), f"power of the video: {out / REPORT}"]


def _origin(folder: Path, power_model: PowerModel | None) -> Provenance:
    """Return software and the SHA-256 of the recording's files."""
    names = (POWER_LOG, POWER_SAMPLES, CLOCK_PINGS, FLIPS, FLASHES)
    inputs = {name: sha256_of_file(folder / name) for name in names if (folder / name).exists()}
    if power_model is not None:
        inputs[f"power model {power_model.name}"] = sha256_of_record(power_model)
    return provenance_now(inputs=inputs)


def power_report(measured: MeasuredPower, png: bytes) -> Report:
    """Return the report.

    Parameters
    ----------
    measured : MeasuredPower
        What was measured.
    png : bytes
        Its `power_figure`.
    """
    power = measured.power
    return Report(
        f"{'Simulated power' if power.simulated else 'Power'} of {power.video}",
        main_findings(power),
        (
            _power_section(power, png),
            _timing_section(measured),
            provenance_section({"power": power.provenance}),
            files_section(FILES),
        ),
        simulated_note=prose("power_simulated")[0],
    )


def _power_section(power: PlayedPower, png: bytes) -> Section:
    """Return average powers of versions and passes."""
    hours = (power.passes[-1].begun - power.passes[0].begun) / 3600
    text = prose("power_average", power=power, hours=hours, equal_percent=100 * EQUAL_SHARE)
    caption = " ".join(prose("power_caption", power=power))
    return Section(
        "Average power",
        text,
        (_version_table(power), _saving_table(power), _pass_table(power)),
        (Picture(png, caption),),
        power.notes,
        power.simulated,
    )


def _version_table(power: PlayedPower) -> Table:
    """Return the paper's table, with intervals."""
    rows: list[tuple[Cell, ...]] = [
        (
            NAMES[one.version],
            one.n_passes,
            f"{one.mean_power:.4f}",
            None if one.sd_power is None else f"{1000 * one.sd_power:.2g}",
            None if one.ci_low is None else f"{one.ci_low:.4f} to {one.ci_high:.4f}",
            *(() if one.predicted_power is None else (f"{one.predicted_power:.4f}",)),
        )
        for one in power.versions
    ]
    columns = ("version", "passes", "power [W]", "SD of passes [mW]", "95 % confidence interval [W]")
    predicted = any(one.predicted_power is not None for one in power.versions)
    model = f" Predicted: by the model {power.power_model}, from the mean of b." if predicted else ""
    return Table(
        f"Average power of {power.video}.{model}",
        (*columns, "predicted [W]") if predicted else columns,
        tuple(rows),
    )


def _saving_table(power: PlayedPower) -> Table:
    """Return what each version saves, and the energies of its frames."""
    rows: list[tuple[Cell, ...]] = [
        (
            NAMES[one.version],
            None if one.saving is None else f"{one.saving:.4f}",
            None if one.saving_percent is None else f"{one.saving_percent:.2f}",
            None
            if one.saving_percent_ci_low is None
            else f"{one.saving_percent_ci_low:.2f} to {one.saving_percent_ci_high:.2f}",
            f"{1000 * one.frame_energy_min:.3g} to {1000 * one.frame_energy_max:.3g}",
            f"{one.mean_factor:.4f}",
        )
        for one in power.versions
    ]
    return Table(
        "What is saved against full brightness, freed from drift; least and greatest energy of a frame; mean "
        "of the brightness factor b that was achieved.",
        ("version", "saves [W]", "saves [%]", "95 % confidence interval [%]", "frames [mJ]", "mean b"),
        tuple(rows),
    )


def _pass_table(power: PlayedPower) -> Table:
    """Return the passes in the order in which they were played."""
    rows: list[tuple[Cell, ...]] = [
        (
            one.pass_index + 1, NAMES[one.version], f"{one.begun - power.passes[0].begun:.1f}",
            None if one.mean_power is None else f"{one.mean_power:.4f}", f"{one.mean_factor:.4f}",
            f"{100 * one.measured_share:.1f} %", f"{100 * one.bridged_share:.2g} %", one.n_frames,
            one.n_left_out, one.n_dropped, "yes" if one.used else "no",
        )
        for one in power.passes
    ]  # fmt: skip
    return Table(
        "Passes in the order in which they were played. Bridged: time without a sample, where power was "
        "interpolated. Left out: frames without an energy.",
        ("pass", "version", "begun [s]", "power [W]", "mean b", "measured", "bridged", "frames", "left out",
         "refreshes dropped", "counts"),
        tuple(rows),
    )  # fmt: skip


def _timing_section(measured: MeasuredPower) -> Section:
    """Return how samples and frames were brought onto one clock, and how well."""
    power, count = measured.power, measured.power.samples
    flags = [frame.flag for frame in measured.energies]
    rows: tuple[tuple[Cell, ...], ...] = (
        ("samples that came", count.n_samples, "1"),
        ("samples lost", count.n_lost, "1"),
        ("samples that came again", count.n_duplicated, "1"),
        ("time without a sample", f"{100 * count.bridged_share:.2g}", "%"),
        ("longest time without a sample", f"{1000 * count.longest_gap:.3g}", "ms"),
        ("rate of the samples", power.sample_rate, "Hz"),
        ("rate of the display", power.refresh_rate, "Hz"),
        ("frames with an energy of their own", flags.count(FrameFlag.OK), "1"),
        ("frames shorter than the time between samples", flags.count(FrameFlag.UNRESOLVED), "1"),
        ("frames left out", flags.count(FrameFlag.GAP) + flags.count(FrameFlag.OUTSIDE), "1"),
    )
    table = Table("Samples and frames.", ("quantity", "value", "unit"), rows)
    text = prose("power_time", clock=clock_in_words(power.clock))
    return Section("Time", text, (table,), (), (), power.simulated)


def power_figure(measured: MeasuredPower, medium: FigureFormat = PAGE) -> Figure:
    """Draw power over time for each version, and beside it the means of the passes.

    Parameters
    ----------
    measured : MeasuredPower
        What was measured.
    medium : FigureFormat
        Where it is shown.
    """
    power = measured.power
    with look(medium):
        em = medium.em
        left, gap, beside = 5.0 * em, 2.2 * em, 17.0 * em
        width = medium.width - left - gap - beside - 1.2 * em
        title = f"{'SIMULATED power' if power.simulated else 'Measured power'} of {power.video}"
        lines, above = heading_lines(title, heading_in_words(power), medium.width - left - em, em)
        top, height = above + 2.4 * em, min(24 * em, 0.55 * medium.height)
        figure = new_figure(medium, top + height + 3.8 * em)
        lines_at(figure, left, lines)
        over_time = axes_at(figure, left, top, width, height)
        means = axes_at(figure, left + width + gap, top, beside, height)
        _draw_over_time(over_time, measured)
        _draw_means(means, power)
        highest = max(over_time.get_ylim()[1], means.get_ylim()[1])
        for axes in (over_time, means):
            axes.set_ylim(0.0, highest)
        _draw_model(means, power, highest)
        means.tick_params(labelleft=False)
    return figure


def _draw_over_time(axes: Axes, measured: MeasuredPower) -> None:
    """Draw the mean over passes, and their range, over the time since each pass began."""
    power = measured.power
    handles: list[Line2D | Patch] = []
    for version in VERSIONS:
        begins = {one.pass_index: one.begun for one in power.passes if one.used and one.version == version}
        if not begins:
            continue
        edges = np.linspace(0, power.duration, _points(measured.energies, power) + 1)
        curves = np.array(
            [_binned(measured.energies, index, begun, edges) for index, begun in begins.items()]
        )
        style = STYLES[version]
        middle = (edges[1:] + edges[:-1]) / 2
        if len(edges) == 2:  # a video of one frame
            middle, curves = edges, np.repeat(curves, 2, axis=1)
        if len(curves) > 1:
            band = {"color": style["color"], "alpha": 0.25, "linewidth": 0}
            axes.fill_between(middle, curves.min(axis=0), curves.max(axis=0), **band)
        axes.plot(middle, curves.mean(axis=0), **style)
        mean = next(one.mean_power for one in power.versions if one.version == version)
        axes.axhline(mean, color=style["color"], linewidth=text_size() / 14, linestyle=":")
        handles.append(Line2D([], [], label=version, **style))
    handles.append(Line2D([], [], color=MUTED, linestyle=":", linewidth=text_size() / 14, label="mean"))
    if any(one.n_passes > 1 for one in power.versions):
        handles.append(Patch(facecolor=FAINT, label="passes' range"))
    legend_above(axes, handles=handles)
    axes.set(xlim=(0, power.duration), xlabel="time in the video [s]", ylabel="power [W]")
    axes.set_ylim(0, 1.08 * axes.get_ylim()[1])


def _points(energies: Sequence[FrameEnergy], power: PlayedPower) -> int:
    """Return how many points a line gets: one for each frame, as far as they show."""
    typical = float(np.median([frame.duration for frame in energies]))
    return max(min(MOST_POINTS, round(power.duration / typical)), 1)


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
    return np.where(
        (np.diff(np.interp(edges, times, lost)) > 0) | (lasted < np.diff(edges) / 2), np.nan, mean
    )


def _draw_means(axes: Axes, power: PlayedPower) -> None:
    """Draw each pass as a dot, and the version's mean with its interval."""
    size = text_size()
    for place, one in enumerate(power.versions):
        colour = STYLES[one.version]["color"]
        means = np.array([p.mean_power for p in power.passes if p.used and p.version == one.version])
        spread = 0.25 * (np.arange(len(means)) - (len(means) - 1) / 2) / max(len(means) - 1, 1)
        axes.plot(
            place - 0.2 + spread, means, "o", color=colour, ms=0.35 * size, alpha=0.6, markeredgewidth=0
        )
        if one.ci_low is not None and one.ci_high is not None:
            axes.plot([place + 0.1] * 2, [one.ci_low, one.ci_high], color=colour, linewidth=size / 5)
        axes.plot([place + 0.1], [one.mean_power], "D", color=colour, ms=0.45 * size)
    axes.set_xlim(-0.6, len(power.versions) - 0.4)
    names = [f"{one.version}\n{one.mean_power:.3f} W" for one in power.versions]
    axes.set_xticks(range(len(power.versions)), names)
    axes.tick_params(axis="x", length=0)
    axes.set_ylim(0, 1.08 * axes.get_ylim()[1])


def _draw_model(axes: Axes, power: PlayedPower, highest: float) -> None:
    """Draw what a model predicts, as far as it is on the scale of what was measured, and the legend."""
    size = text_size()
    dash: dict[str, Any] = {"marker": "_", "linestyle": "", "color": INK, "ms": 0.8 * size}
    dash["markeredgewidth"] = size / 8
    predicted = [(k, one.predicted_power) for k, one in enumerate(power.versions)]
    shown = [(k, watts) for k, watts in predicted if watts is not None and watts <= highest]
    for place, watts in shown:
        axes.plot([place + 0.35], [watts], **dash)
    handles = [
        Line2D([], [], marker="o", linestyle="", color=MUTED, ms=0.35 * size, label="pass"),
        Line2D([], [], marker="D", color=MUTED, ms=0.45 * size, label="mean"),
        Line2D([], [], label="model", **dash),
    ]
    legend_above(axes, handles=handles[: 3 if shown else 2], handlelength=1.0, columnspacing=1.0)
