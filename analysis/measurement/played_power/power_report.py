"""The results of measuring a played video: table, energies, figure and the report that explains them."""

from __future__ import annotations

from pathlib import Path

from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.measurement.played_power.pass_power import EQUAL_SHARE
from evenlight.analysis.measurement.played_power.power_figure import power_figure
from evenlight.analysis.measurement.played_power.power_recording import load_recording
from evenlight.analysis.measurement.played_power.power_table import MeasuredPower, measure_power
from evenlight.analysis.measurement.played_power.power_words import (
    NAMES,
    clock_in_words,
    closing_lines,
    main_findings,
)
from evenlight.analysis.report import Cell, Picture, Report, Section, Table, write_report
from evenlight.analysis.report_prose import prose
from evenlight.analysis.report_sections import files_section, provenance_section
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


def write_power_results(folder: Path, out: Path, power_model: PowerModel | None = None) -> list[str]:
    """Write table, energies, figure and report of a played video's power, and return lines that sum it up.

    Parameters
    ----------
    folder : Path
        The recording, as `evenlight play --measure-power` writes it.
    out : Path
        Folder for the results; it may be the same.
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
    text = prose("power_time", clock=clock_in_words(power.clock).removeprefix("clock: "))
    return Section("Time", text, (table,), (), (), power.simulated)
