"""The files that follow from a sweep: a model for the optimizer, tables, a figure and a report."""

from __future__ import annotations

import sys
from collections.abc import Sequence
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
    display_lines,
    display_warnings,
    power_lines,
    power_warnings,
)
from evenlight.analysis.measurement.sweeps.sweep_report import luminance_report, power_report
from evenlight.analysis.report import write_report
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.sweep_fit import LuminanceLevel, PowerLevel
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
        found = display_warnings(luminance.record)
        lines = (*display_lines(luminance.record), *against_file(luminance))
        return SweepResults(lines, (*found, *luminance.sweep.warnings))
    power = fit_power_sweep(load_power_sweep(folder))
    with results_folder(out) as staging:
        _write_power(power, staging)
    found = power_warnings(power.record)
    return SweepResults(tuple(power_lines(power.record)), (*found, *power.sweep.warnings))


def write_chosen_sweeps(chosen: Sequence[ChosenSweep], out: Path, *, needed: bool) -> SweepResults:
    """Write the results of the newest sweep of each task, and say which others there are.

    Parameters
    ----------
    chosen : sequence of ChosenSweep
        What is fitted, each into a folder of `out` that is named as its task.
    out : Path
        Where the results go.
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
