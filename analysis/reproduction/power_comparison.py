"""The table of average power (the paper's Table 3): published, computed from the tracks, or recorded."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from evenlight.analysis.findings import Findings
from evenlight.analysis.published import published
from evenlight.analysis.report import Section, Table
from evenlight.analysis.reproduction.sequence_tracks import SequenceTracks
from evenlight.analysis.wording import in_words
from evenlight.data_schema.played_power import PlayedPower
from evenlight.data_schema.statistic import Origin, Statistic
from evenlight.data_schema.text_files import read_json_record

VERSIONS = ("baseline", "ours", "full")
COLUMNS = {"baseline": "constant", "ours": "ours", "full": "full brightness"}
TABLE = "power"


def power_findings(sequences: Sequence[SequenceTracks], data: Path | None = None) -> Findings:
    """Return average power of each sequence in each version.

    Parameters
    ----------
    sequences : sequence of SequenceTracks
        What was optimized; power follows from the power model.
    data : Path, optional
        Folder in which measured power is looked for (`played_power.json`, at any depth).
    """
    names = [sequence.name for sequence in sequences]
    rows = [*_published_rows(names), *(row for s in sequences for row in _computed_rows(s))]
    measured = measured_power(data) if data else ()
    rows += [row for power in measured for row in _measured_rows(power)]
    saved = [100 * (1 - s.summary.mean_power / s.summary.full_power) for s in sequences]
    return Findings(
        name=TABLE,
        lead=f"By the power model ours saves {min(saved):.0f} to {max(saved):.0f} % of the full power.",
        statistics=tuple(rows),
        drawings=(),
        sections=(_section(rows, bool(measured)),),
    )


def measured_power(data: Path) -> tuple[PlayedPower, ...]:
    """Return the measured power of played videos that lies in a folder, in order of the files' names.

    Raises
    ------
    InputError
        If one of the files is not as it should be.
    """
    return tuple(read_json_record(PlayedPower, path) for path in sorted(data.rglob("played_power.json")))


def _published_rows(names: Sequence[str]) -> list[Statistic]:
    """Return what the paper prints of these sequences."""
    rows = []
    for name in names:
        for version in VERSIONS:
            value = published(f"power.{name}.{version}")
            rows.append(
                Statistic(
                    TABLE, name, f"average power, {COLUMNS[version]}", value.number, "W", Origin.PUBLISHED,
                    method=value.place,
                )
            )  # fmt: skip
    return rows


def _computed_rows(sequence: SequenceTracks) -> list[Statistic]:
    """Return what the power model says of a sequence."""
    summary = sequence.summary
    powers = {
        "baseline": summary.baseline_power,
        "ours": summary.mean_power,
        "full": summary.full_power,
    }
    return [
        Statistic(
            TABLE, sequence.name, f"average power, {COLUMNS[version]}", power, "W", Origin.COMPUTED,
            n=summary.frames, method=f"power model {summary.power_model}, mean over the frames",
        )
        for version, power in powers.items()
    ]  # fmt: skip


def _measured_rows(power: PlayedPower) -> list[Statistic]:
    """Return what was measured of a played video."""
    origin = Origin.SIMULATED if power.simulated else Origin.RECORDED
    return [
        Statistic(
            TABLE, power.video, f"average power, {COLUMNS.get(one.version, one.version)}", one.mean_power,
            "W", origin, ci_low=one.ci_low, ci_high=one.ci_high,
            interval=None if one.ci_low is None else 0.95, n=one.n_passes,
            method="measured; n passes, Student's t over them",
        )
        for one in power.versions
    ]  # fmt: skip


def _section(rows: Sequence[Statistic], measured: bool) -> Section:
    """Return the table of the report: a line for each sequence and origin."""
    lines: dict[tuple[str, Origin], dict[str, float | None]] = {}
    for row in rows:
        lines.setdefault((row.group, row.origin), {})[row.what.removeprefix("average power, ")] = row.value
    columns = tuple(COLUMNS.values())
    cells = tuple(
        (
            in_words(name),
            origin.value,
            *(values.get(c) for c in columns),
            _saving(values.get("ours"), values.get("full brightness")),
        )
        for (name, origin), values in sorted(lines.items(), key=lambda item: _order(rows, item[0][0]))
    )
    return Section(
        "Average power",
        (
            "What is computed is the power model P(L) = 0.001858 L + 0.2945 at the track's factors, with a "
            "panel of 750 cd/m² at full brightness. What is published was measured on the authors' panel, "
            "whose full brightness lies above what their own model says (see `evenlight audit`).",
            "Power of played videos was measured, and stands beside."
            if measured
            else "To measure: `evenlight play VIDEO TRACK --measure-power`, and `--data` with its folder.",
        ),
        (
            Table(
                "Average power of each sequence [W].",
                ("sequence", "origin", *(f"{c} [W]" for c in columns), "saved by ours [%]"),
                cells,
            ),
        ),
        simulated=any(row.origin is Origin.SIMULATED for row in rows),
    )


def _order(rows: Sequence[Statistic], name: str) -> int:
    """Return the place of a sequence among the rows."""
    return next(k for k, row in enumerate(rows) if row.group == name)


def _saving(ours: float | None, full: float | None) -> float | None:
    """Return what ours saves of full brightness, in percent; None where one of them is missing."""
    return None if ours is None or not full else 100 * (1 - ours / full)
