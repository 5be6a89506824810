"""The files of a benchmark."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.chart import chart_png
from benchmarks.machine import machine
from benchmarks.measured import RunSettings, Subject, SubjectResults
from benchmarks.page import page
from benchmarks.records import BenchmarkClaim, BenchmarkGrowth, BenchmarkPoint, BenchmarkSummary
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.storage.whole_files import write_whole


def measure_all(
    subjects: Mapping[str, Subject],
    settings: RunSettings,
    folder: Path,
    mapped: Callable[..., Iterable[Any]] = map,
) -> list[SubjectResults]:
    """Measure subjects one after the other, write the files of all, and return what was measured.

    Parameters
    ----------
    subjects : mapping of str to Subject
        By name.
    settings : RunSettings
        How to run them.
    folder : Path
        Gets `NAME_benchmark.csv`, `NAME_claims.csv`, `NAME_growth.csv` and figures of each, `benchmarks.md`
        and `benchmark.json` of all.
    mapped : callable, optional
        `map`, or one that has other computers measure.
    """
    machines: list[dict[str, str]] = []
    measured: list[SubjectResults] = []
    for where, subject in mapped(partial(_measured, settings), subjects.values()):
        machines.append(where)
        measured.append(subject)
        _write(folder, subject)
    where = {name: " or ".join(dict.fromkeys(one[name] for one in machines)) for name in machines[0]}
    write_whole(folder / "benchmarks.md", page(where, measured, settings.quick, "").encode())
    write_json_record(folder / "benchmark.json", _summary(measured, settings, where))
    return measured


def _measured(settings: RunSettings, subject: Subject) -> tuple[dict[str, str], SubjectResults]:
    """Return what a subject was measured on, and what was measured."""
    return machine(), subject(settings)


def _write(folder: Path, measured: SubjectResults) -> None:
    """Write the tables and figures of one subject."""
    write_rows(folder / f"{measured.name}_benchmark.csv", BenchmarkPoint, measured.points)
    if measured.claims:
        write_rows(folder / f"{measured.name}_claims.csv", BenchmarkClaim, measured.claims)
    if measured.growth:
        write_rows(folder / f"{measured.name}_growth.csv", BenchmarkGrowth, measured.growth)
    for chart in measured.charts:
        write_whole(folder / f"bench-{chart.name}.png", chart_png(chart, measured.points))


def _summary(
    measured: Sequence[SubjectResults], settings: RunSettings, where: dict[str, str]
) -> BenchmarkSummary:
    """Return the record of a run."""
    return BenchmarkSummary(
        machine=where,
        quick=settings.quick,
        leads={m.name: m.lead for m in measured},
        refused={what: why for m in measured for what, why in m.refused.items()},
        provenance=provenance_now(settings.seed),
    )
