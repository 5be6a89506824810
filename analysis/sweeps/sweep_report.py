"""Sweeps of a folder or of a data set: fitted, and their results written."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from evenlight.analysis.sweeps.luminance_sweep import fit_luminance_sweep
from evenlight.analysis.sweeps.power_sweep import fit_power_sweep
from evenlight.analysis.sweeps.sweep_loading import load_manifest, load_sweep
from evenlight.analysis.sweeps.sweep_result import REPORT, SweepResult
from evenlight.data_schema.errors import InputError


def analyse_sweep(folder: Path) -> SweepResult:
    """Fit the sweep of a folder.

    Raises
    ------
    InputError
        If the sweep cannot be used.
    """
    sweep = load_sweep(folder)
    return (fit_power_sweep if sweep.manifest.task == "power-sweep" else fit_luminance_sweep)(sweep)


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
    result = analyse_sweep(folder)
    if out == folder:
        result.write(out)
    else:
        result.save(out)
    for warning in result.warnings:
        print(f"evenlight: warning: {warning}", file=sys.stderr)
    return [*result.lines, f"{out / REPORT} has the details"]


def write_chosen_sweeps(
    chosen: Mapping[Path, Sequence[str]], out: Path, *, needed: bool
) -> tuple[list[str], list[str]]:
    """Write the results of the newest sweep of each task; return what came out, in lines, and warnings.

    Parameters
    ----------
    chosen : mapping of Path to sequence of str
        What is fitted, and the names of other sweeps, which are not: `newest_sweeps`.
    out : Path
        Where to: each into a folder that is named as its task.
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
    for folder, others in chosen.items():
        task = load_manifest(folder).task
        try:
            result = analyse_sweep(folder)
        except InputError as error:
            unusable.append(error)
            warnings.append(f"{task} was not fitted: {error}")
            continue
        result.write(out / task)
        unfitted = f"; not fitted: {', '.join(others)}" if others else ""
        lines += [f"{task}: {folder.name}{unfitted}", *result.lines]
        warnings += [f"{folder.name}: {warning}" for warning in result.warnings]
    if needed and len(unusable) == len(chosen):
        raise unusable[0]
    return lines, warnings
