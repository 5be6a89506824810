"""The report on the power of a played video: a page to judge the measurement by."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.measurement.pass_power import EQUAL_SHARE
from evenlight.analysis.measurement.power_notes import NAMES
from evenlight.analysis.measurement.power_table import (
    FIGURE,
    FRAME_ENERGIES,
    PLAYED_POWER,
    POWER_TABLE,
    REPORT,
    MeasuredPower,
)
from evenlight.analysis.measurement.power_words import clock_in_words, difference_in_words, savings_in_words
from evenlight.analysis.report import Cell, Picture, Report, Section, Table, write_report
from evenlight.analysis.report_sections import files_section, provenance_section
from evenlight.data_schema.files import write_whole
from evenlight.data_schema.frame_energy import FrameFlag
from evenlight.data_schema.played_power import PlayedPower

SIMULATED_NOTE = (
    "Simulated: the power meter, the panel or both are simulated. The numbers show how the procedure works, "
    "and say nothing about any device."
)
FILES = {
    PLAYED_POWER: "all of it, for programs",
    POWER_TABLE: "the table of this page: a row for each version",
    FRAME_ENERGIES: "energy of each frame shown",
    FIGURE: "the figure of this page",
}


def write_power_report(folder: Path, measured: MeasuredPower, figure: Figure) -> None:
    """Write the figure, and the report with it inside."""
    png = png_bytes(figure)
    write_whole(folder / FIGURE, png)
    write_report(folder / REPORT, power_report(measured, png))


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
        _lead(power),
        (
            _power_section(power, png),
            _timing_section(measured),
            provenance_section({"power": power.provenance}),
            files_section(FILES),
        ),
        simulated_note=SIMULATED_NOTE,
    )


def _lead(power: PlayedPower) -> str:
    """Return what came out, in a sentence or two."""
    words = [
        savings_in_words(one) for one in power.versions if one.version == "ours" and one.saving is not None
    ]
    if power.equal_power is not None:
        words.append(difference_in_words(power.equal_power))
    if not words:
        words = [f"{NAMES[one.version]} takes {one.mean_power:.4g} W" for one in power.versions]
    return " ".join(f"{part[0].upper()}{part[1:]}." for part in words).replace(" %", "\u00a0%")


def _power_section(power: PlayedPower, png: bytes) -> Section:
    """Return average powers of versions and passes."""
    text = (
        "Average power is energy over time: the integral of the measured power over the frames shown, "
        "divided by how long they were shown. Intervals come from how much passes of one version differ "
        "(Student's t). What one version takes less than another is freed from the drift that all of them "
        "share, a straight line over time. Equal means that two one-sided t-tests at 5 % exclude a "
        f"difference of {100 * EQUAL_SHARE:g} % of full brightness."
    )
    caption = (
        "Left: power over the time in the video, mean of the passes; dotted: each version's average. "
        "Right: the average of each pass (dots), of the version (diamond) and its 95 % interval (bar)"
    )
    caption += "; dash: as the power model predicts." if power.power_model else "."
    return Section(
        "Average power",
        (text, *_drift(power)),
        (_version_table(power), _saving_table(power), _pass_table(power)),
        (Picture(png, caption),),
        power.notes,
        power.simulated,
    )


def _drift(power: PlayedPower) -> tuple[str, ...]:
    """Return by how much the power of one and the same version changed."""
    if power.drift_w_h is None:
        return ()
    hours = (power.passes[-1].begun - power.passes[0].begun) / 3600
    return (
        f"Over the {60 * hours:.2g} minutes from the first pass to the last, the power of a version "
        f"changed by {1000 * power.drift_w_h * hours:+.2g} mW.",
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
    columns = ("version", "passes", "power [W]", "SD of passes [mW]", "95 % interval [W]")
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
        ("version", "saves [W]", "saves [%]", "95 % interval [%]", "frames [mJ]", "mean b"),
        tuple(rows),
    )


def _pass_table(power: PlayedPower) -> Table:
    """Return the passes in the order in which they were played."""
    rows: list[tuple[Cell, ...]] = [
        (
            one.pass_index + 1,
            NAMES[one.version],
            f"{one.begun - power.passes[0].begun:.1f}",
            None if one.mean_power is None else f"{one.mean_power:.4f}",
            f"{one.mean_factor:.4f}",
            f"{100 * one.measured_share:.1f} %",
            f"{100 * one.bridged_share:.2g} %",
            one.n_frames,
            one.n_left_out,
            one.n_dropped,
            "yes" if one.used else "no",
        )
        for one in power.passes
    ]
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
    words = clock_in_words(power.clock).removeprefix("clock: ")
    text = (
        f"The meter's clock was put on the computer's {words}. A sample is the mean power since the sample "
        "before, so that energy is known at the end of each, and interpolated to the times of the flips."
    )
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
    return Section("Time", (text,), (table,), (), (), power.simulated)
