"""What follows from a sweep: a model for the optimizer, tables, a figure, and the report on them."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.measurement.sweeps.luminance_sweep import (
    LuminanceSweepFit,
    display_of,
    fit_luminance_sweep,
)
from evenlight.analysis.measurement.sweeps.power_sweep import PowerSweepFit, fit_power_sweep, power_model_of
from evenlight.analysis.measurement.sweeps.sweep_figures import luminance_sweep_figure, power_sweep_figure
from evenlight.analysis.measurement.sweeps.sweep_loading import (
    ChosenSweep,
    load_luminance_sweep,
    load_manifest,
    load_power_sweep,
)
from evenlight.analysis.measurement.sweeps.sweep_notes import (
    against_file,
    brightness_in_words,
    display_lines,
    gamma_in_words,
    interval_in_words,
    linearity_in_words,
    power_lines,
    warnings_of,
)
from evenlight.analysis.report import Cell, Picture, Report, Section, Table, write_report
from evenlight.analysis.report_prose import prose
from evenlight.analysis.report_sections import files_section, provenance_section
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.sweep_fit import (
    DisplayFit,
    LuminanceLevel,
    LuminanceSource,
    PowerFit,
    PowerLevel,
    SuspectReading,
)
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json_record, write_toml_record
from evenlight.data_schema.storage.whole_files import results_folder, write_whole

REPORT = "report.html"
LUMINANCE_FILES = {
    "display.toml": "the display model, for `evenlight optimize --display`",
    "luminance_levels.csv": "pixel values as they were read, beside the curve",
    "brightness.csv": "brightness factors as they were read, for `backlight_curve` of a rig",
    "display_fit.json": "coefficients, confidence intervals, tests and flags, for programs",
    "luminance.png": "the figure of this page",
}
POWER_FILES = {
    "power.toml": "the power model, for `evenlight optimize --power-model`",
    "power_levels.csv": "brightness factors as they were read, beside the line",
    "power_fit.json": "coefficients, confidence intervals, tests and flags, for programs",
    "power.png": "the figure of this page",
}


@dataclass(frozen=True, slots=True)
class SweepResults:
    """What is said of a fitted sweep: what came out, in lines, and what to look at."""

    lines: tuple[str, ...]
    warnings: tuple[str, ...]


def fit_sweep(folder: Path, out: Path) -> list[str]:
    """Fit the sweep of a folder, write its results, print warnings, and return the closing lines.

    Parameters
    ----------
    folder : Path
        Of the sweep.
    out : Path
        Where the results go; it may be the same.

    Raises
    ------
    InputError
        If the sweep cannot be used; nothing is written then.
    """
    outcome = write_sweep_results(folder, out)
    warn(outcome.warnings)
    return [*outcome.lines, f"{out / REPORT} has the details"]


def warn(warnings: Sequence[str]) -> None:
    """Print warnings where they do not mix with results."""
    for warning in warnings:
        print(f"evenlight: warning: {warning}", file=sys.stderr)


def write_sweep_results(folder: Path, out: Path) -> SweepResults:
    """Fit the sweep of a folder and write its results, all or none of them."""
    task = load_manifest(folder).task
    if task == "luminance-sweep":
        luminance = fit_luminance_sweep(load_luminance_sweep(folder))
        with results_folder(out) as staging:
            _write_luminance(luminance, staging)
        found = warnings_of(luminance.record)
        lines = (*display_lines(luminance.record), *against_file(luminance))
        return SweepResults(lines, (*found, *luminance.sweep.warnings))
    power = fit_power_sweep(load_power_sweep(folder))
    with results_folder(out) as staging:
        _write_power(power, staging)
    found = warnings_of(power.record)
    return SweepResults(tuple(power_lines(power.record)), (*found, *power.sweep.warnings))


def write_chosen_sweeps(chosen: Sequence[ChosenSweep], out: Path, *, needed: bool) -> SweepResults:
    """Write the results of the newest sweep of each task, and say which others there are.

    Parameters
    ----------
    chosen, out : sequence of ChosenSweep, Path
        What is fitted, and where to: each into a folder of `out` that is named as its task.
    needed : bool
        Whether there is nothing else to be had; else a sweep that cannot be used is a warning.

    Raises
    ------
    InputError
        If results are needed, and no sweep can be used.
    """
    lines: list[str] = []
    warnings: list[str] = []
    unusable: list[InputError] = []
    for sweep in chosen:
        try:
            outcome = write_sweep_results(sweep.folder, out / sweep.task)
        except InputError as error:
            unusable.append(error)
            warnings.append(f"{sweep.task} was not fitted: {error}")
            continue
        others = f"; not fitted: {', '.join(sweep.others)}" if sweep.others else ""
        lines += [f"{sweep.task}: {sweep.folder.name}{others}", *outcome.lines]
        warnings += [f"{sweep.folder.name}: {warning}" for warning in outcome.warnings]
    if needed and len(unusable) == len(chosen):
        raise unusable[0]
    return SweepResults(tuple(lines), tuple(warnings))


def _write_luminance(result: LuminanceSweepFit, folder: Path) -> None:
    """Write the results of a luminance sweep."""
    files = dict(LUMINANCE_FILES)
    write_toml_record(folder / "display.toml", display_of(result))
    write_rows(folder / "luminance_levels.csv", LuminanceLevel, result.levels)
    if result.brightness:
        write_rows(folder / "brightness.csv", LuminanceLevel, result.brightness)
    else:
        del files["brightness.csv"]
    write_json_record(folder / "display_fit.json", result.record)
    png = png_bytes(luminance_sweep_figure(result))
    write_whole(folder / "luminance.png", png)
    write_report(folder / REPORT, luminance_report(result, png, files))


def _write_power(result: PowerSweepFit, folder: Path) -> None:
    """Write the results of a power sweep."""
    write_toml_record(folder / "power.toml", power_model_of(result))
    write_rows(folder / "power_levels.csv", PowerLevel, result.levels)
    write_json_record(folder / "power_fit.json", result.record)
    png = png_bytes(power_sweep_figure(result))
    write_whole(folder / "power.png", png)
    write_report(folder / REPORT, power_report(result, png, POWER_FILES))


def luminance_report(result: LuminanceSweepFit, png: bytes, files: Mapping[str, str]) -> Report:
    """Return the report of a luminance sweep; `png` is its figure, `files` what else was written."""
    record, simulated = result.record, result.record.simulated
    warnings = tuple(_sentence(words) for words in (*warnings_of(record), *result.sweep.warnings))
    sections = [
        Section(
            "The display",
            (
                *prose("sweep_measured", manifest=result.sweep.manifest),
                *_unless_warned(gamma_in_words(record), warnings),
                *(f"{_sentence(words)}." for words in against_file(result)),
            ),
            (_display_table(record), *_suspect_tables(record.suspects)),
            (Picture(png, prose("sweep_luminance_caption")[0]),),
            warnings,
            simulated,
        ),
        Section(
            "Pixel values",
            (),
            (_level_table("Pixel values at full brightness.", result.levels, "of the curve"),),
            simulated=simulated,
        ),
    ]
    if result.brightness:
        words = _unless_warned(brightness_in_words(record), warnings)
        table = _level_table("Brightness factors, white.", result.brightness, "in proportion to b")
        sections.append(Section("Brightness factors", words, (table,), simulated=simulated))
    sections += [provenance_section({"display model": record.provenance}), files_section(files)]
    lead = _sentence(display_lines(record)[0]) + "."
    return Report(f"Luminance of {record.display_name}", lead, tuple(sections), prose("sweep_simulated")[0])


def power_report(result: PowerSweepFit, png: bytes, files: Mapping[str, str]) -> Report:
    """Return the report of a power sweep; `png` is its figure, `files` what else was written."""
    record = result.record
    warnings = tuple(_sentence(words) for words in (*warnings_of(record), *result.sweep.warnings))
    sections = (
        Section(
            "The panel",
            (
                *prose("sweep_measured", manifest=result.sweep.manifest),
                *prose("sweep_light", by_meter=record.luminance_source is LuminanceSource.METER),
                *_unless_warned(linearity_in_words(record), warnings),
            ),
            (_power_table(record), *_suspect_tables(record.suspects)),
            (Picture(png, prose("sweep_power_caption")[0]),),
            warnings,
            record.simulated,
        ),
        Section("Brightness factors", (), (_power_level_table(result),), simulated=record.simulated),
        provenance_section({"power model": record.provenance}),
        files_section(files),
    )
    lead = _sentence(power_lines(record)[0]) + "."
    return Report(f"Power of {record.display_name}", lead, sections, prose("sweep_simulated")[0])


def _display_table(fit: DisplayFit) -> Table:
    """Return the display model with its intervals."""
    rows: list[tuple[Cell, ...]] = [
        ("γ", f"{fit.gamma:.4f}", interval_in_words(fit.gamma_interval, 5), "1"),
        (
            "peak L_max",
            f"{fit.peak_luminance:.5g}",
            interval_in_words(fit.peak_luminance_interval, 5),
            "cd/m²",
        ),
        ("black L_black", f"{fit.black_level:.3g}", interval_in_words(fit.black_level_interval, 3), "cd/m²"),
        ("reflected L_refl, as given", fit.reflected_luminance, None, "cd/m²"),
        ("noise of a reading, share", f"{100 * fit.noise_share:.2g}", None, "%"),
        ("noise of a reading in the dark", f"{fit.noise_floor:.2g}", None, "cd/m²"),
        ("lack of fit, F", fit.lack_of_fit_f, None, "1"),
        ("its probability on a gamma display", fit.lack_of_fit_p, None, "1"),
        *_change_rows("change at the end of the sweep", fit.drift, fit.drift_interval, "%"),
        *_change_rows("change late in the warm-up", fit.warm_up_change, fit.warm_up_interval, "% in 10 min"),
        ("readings, and without a value", f"{fit.n_readings} and {fit.n_under_range}", None, "1"),
    ]
    return Table(
        "The display model, with 95 % confidence intervals.",
        ("quantity", "value", "interval", "unit"),
        tuple(rows),
    )


def _suspect_tables(suspects: tuple[SuspectReading, ...]) -> tuple[Table, ...]:
    """Return the readings that contradict the others; no table if there are none."""
    cells = tuple(
        (
            each.row, each.level, "too dark" if each.value is None else f"{each.value:.5g}",
            None if each.others is None else f"{each.others:.5g}", each.unit.replace("^2", "²"),
            "left out" if each.left_out else "counts",
        )
        for each in suspects
    )  # fmt: skip
    columns = ("row", "shown", "read", "others of its level", "unit", "in the fit")
    return (Table("Suspect readings: each contradicts others.", columns, cells),) if cells else ()


def _change_rows(
    name: str, share: float | None, interval: tuple[float, float] | None, unit: str
) -> list[tuple[Cell, ...]]:
    """Return the row of a change in percent; an empty one if it was not measured."""
    if share is None or interval is None:
        return [(name, None, None, unit)]
    low, high = (100 * end for end in interval)
    return [(name, f"{100 * share:.2f}", f"{low:.2f} to {high:.2f}", unit)]


def _level_table(caption: str, rows: tuple[LuminanceLevel, ...], model: str) -> Table:
    """Return measured levels beside a model."""
    cells = tuple(
        (
            row.pixel_value if row.factor is None else row.factor, row.achieved_factor, row.luminance,
            row.luminance_sd, row.n_readings, row.n_under_range, row.model_luminance,
            None if row.deviation is None else f"{100 * row.deviation:.2f}",
        )
        for row in rows
    )  # fmt: skip
    level = "L′" if rows and rows[0].factor is None else "b"
    measured = ("L [cd/m²]", "SD [cd/m²]", "n", "too dark")
    return Table(caption, (level, "achieved b", *measured, f"L {model} [cd/m²]", "deviation [%]"), cells)


def _power_table(fit: PowerFit) -> Table:
    """Return the power model with its intervals."""
    rows: list[tuple[Cell, ...]] = [
        ("base power", f"{fit.base_power:.5g}", interval_in_words(fit.base_power_interval), "W"),
        (
            "slope",
            f"{fit.power_per_luminance:.5g}",
            interval_in_words(fit.power_per_luminance_interval),
            "W m²/cd",
        ),
        ("luminance at b = 1", f"{fit.peak_luminance:.5g}", None, "cd/m²"),
        ("reflected L_refl, as given", fit.reflected_luminance, None, "cd/m²"),
        ("SD around the line", f"{1e3 * fit.residual_sd:.3g}", None, "mW"),
        ("R²", f"{fit.r_squared:.6f}", None, "1"),
        ("lack of fit, F", fit.lack_of_fit_f, None, "1"),
        ("its probability on a linear panel", fit.lack_of_fit_p, None, "1"),
        ("bend, of the added power", f"{100 * fit.bend:.2f}", None, "%"),
        ("its probability on a linear panel", fit.bend_p, None, "1"),
        *_change_rows("power at the end of the sweep", fit.drift, fit.drift_interval, "%"),
        *_change_rows("luminance then", fit.luminance_drift, fit.luminance_drift_interval, "%"),
        *_change_rows("change late in the warm-up", fit.warm_up_change, fit.warm_up_interval, "% in 10 min"),
        ("readings, and left out", f"{fit.n_readings} and {fit.n_left_out}", None, "1"),
        ("samples, lost, doubled", f"{fit.n_samples}, {fit.n_lost}, {fit.n_duplicated}", None, "1"),
    ]
    return Table(
        "The power model, with 95 % confidence intervals.",
        ("quantity", "value", "interval", "unit"),
        tuple(rows),
    )


def _power_level_table(result: PowerSweepFit) -> Table:
    """Return measured levels beside the line."""
    rows = tuple(
        (
            row.factor, row.achieved_factor, row.luminance, row.luminance_sd, f"{row.power:.5g}",
            None if row.power_sd is None else f"{1e3 * row.power_sd:.3g}", row.n_readings,
            f"{1e3 * row.residual:.3g}",
        )
        for row in result.levels
    )  # fmt: skip
    columns = ("b", "achieved b", "L [cd/m²]", "SD [cd/m²]", "P [W]", "SD [mW]", "n", "P less line [mW]")
    return Table("Brightness factors, white.", columns, rows)


def _unless_warned(words: str, warnings: tuple[str, ...]) -> tuple[str, ...]:
    """Return a sentence, unless it is among the warnings."""
    sentence = _sentence(words)
    return () if sentence in warnings else (f"{sentence}.",)


def _sentence(words: str) -> str:
    """Return words of the terminal as a sentence of the report."""
    return words[0].upper() + words[1:].replace("^2", "²")
