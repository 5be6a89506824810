"""Published numbers beside our own: detail quality (Table 1), average power (Table 3), slopes (Figure 3)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from evenlight.analysis.findings import Findings
from evenlight.analysis.published import SEQUENCES, published, published_values
from evenlight.analysis.report import Cell, Section, Table
from evenlight.analysis.report_prose import section
from evenlight.analysis.reproduction.reproduction import SequenceTracks
from evenlight.analysis.wording import in_words, p_text
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.played_power import PlayedPower
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.method.rate_limit import rate_limit_at

TABLE = "detail_quality"
DIFFERENCE = "mean difference, ours less baseline"
VERSIONS = ("baseline", "ours")
POWER = "power"
COLUMNS = {"baseline": "constant", "ours": "ours", "full": "full brightness"}  # of the table of powers
AUTHORS = "authors_thresholds"


def find(rows: Sequence[Statistic], group: str, what: str) -> Statistic | None:
    """Return the first row of a group that says a thing; None if there is none."""
    return next((row for row in rows if (row.group, row.what) == (group, what)), None)


def detail_quality_findings(rating: Findings, comparison: Findings) -> Findings:
    """Return mean ratings with standard errors, and how often ours was chosen, sequence by sequence.

    Parameters
    ----------
    rating, comparison : Findings
        Of the two experiments.
    """
    own = [*rating.statistics, *comparison.statistics]
    groups = dict.fromkeys(row.group for row in own if row.what in (DIFFERENCE, "ours chosen"))
    names = [name for name in groups if name != "all" and not name.startswith("all ")]
    rows = [row for name in SEQUENCES for row in _published_rows(name)]
    for name in names:
        for what in (*_ratings(), DIFFERENCE, "ours chosen"):
            row = find(own, name, what)
            rows += [row] if row is not None else []
    simulated = any(row.origin is Origin.SIMULATED for row in rows)
    shown = [name for name in SEQUENCES if name in names] + [n for n in names if n not in SEQUENCES]
    lines = [line for name in shown for line in _lines(rows, name)]
    lead = f"{rating.lead} {comparison.lead}"
    columns = (
        "sequence", "origin", "constant: mean", "SEM", "ours: mean", "SEM",
        "ours - constant", "95 % CI", "p, exact", "Holm", "ours chosen [%]", "95 % CI",
    )  # fmt: skip
    caption = (
        "Ratings of details from 1 to 5 as mean and standard error (SD with n - 1), their difference, and "
        "how often ours was chosen as the version whose brightness changes, with 95 % confidence intervals "
        "(CI). The paper prints no test and no interval; `evenlight audit` says which ones its numbers allow."
    )
    table = Table(caption, columns, tuple(lines))
    about = Section("Detail quality and artifacts (Table 1)", (lead,), (table,), simulated=simulated)
    return Findings(TABLE, lead, tuple(rows), (), (about,))


def _ratings() -> tuple[str, ...]:
    """Return the names of the rows of a version's ratings."""
    return tuple(f"{what}, {version}" for version in VERSIONS for what in ("mean rating", "standard error"))


def _published_rows(name: str) -> list[Statistic]:
    """Return what Table 1 prints of a sequence."""
    rows = []
    for version in VERSIONS:
        for what, key in (("mean rating", "mean"), ("standard error", "sem")):
            value = published(f"{TABLE}.{name}.{version}_{key}")
            rows.append(_published(name, f"{what}, {version}", value.number, "rating points", value.place))
    chosen = published(f"{TABLE}.{name}.chosen_percent")
    rows.append(_published(name, "ours chosen", chosen.number / 100, "1", chosen.place))
    return rows


def _published(group: str, what: str, value: float, unit: str, place: str) -> Statistic:
    """Return the row of a printed number."""
    n = int(published("participants.viewing").number)
    return Statistic(TABLE, group, what, value, unit, Origin.PUBLISHED, n=n, method=place)


def _lines(rows: Sequence[Statistic], name: str) -> list[tuple[Cell, ...]]:
    """Return the lines of a sequence: as printed, then ours."""
    lines = []
    for origin in (Origin.PUBLISHED, Origin.SIMULATED, Origin.RECORDED):
        own = [row for row in rows if row.group == name and row.origin is origin]
        if own:
            lines.append((in_words(name), origin.value, *_cells(own, name)))
    return lines


def _cells(rows: Sequence[Statistic], name: str) -> tuple[Cell, ...]:
    """Return the numbers of a line."""
    means = [_two_places(find(rows, name, what)) for what in _ratings()]
    difference, chosen = find(rows, name, DIFFERENCE), find(rows, name, "ours chosen")
    if difference is None and None not in means:
        apart: tuple[Cell, ...] = (f"{float(means[2] or 0) - float(means[0] or 0):+.2f}", None, None, None)
    else:
        apart = (
            None if difference is None or difference.value is None else f"{difference.value:+.2f}",
            interval_in_words(difference),
            p_text(difference.p_value if difference else None),
            p_text(difference.p_adjusted if difference else None),
        )
    share = None if chosen is None or chosen.value is None else f"{100 * chosen.value:.0f}"
    return (*means, *apart, share, interval_in_words(chosen, 100))


def _two_places(row: Statistic | None) -> str | None:
    """Return a rating with two places, as the paper prints it."""
    return None if row is None or row.value is None else f"{row.value:.2f}"


def interval_in_words(row: Statistic | None, times: float = 1.0) -> str | None:
    """Return an interval as "low to high"; an end without bound as a dash; None without an interval.

    >>> interval_in_words(Statistic("t", "g", "w", 0.5, "1", Origin.RECORDED, 0.25, 0.75, 0.95), 100)
    '25 to 75'
    """
    if row is None or row.interval is None:
        return None
    ends = ("–" if end is None else _short(times * end) for end in (row.ci_low, row.ci_high))
    return " to ".join(ends)


def _short(value: float) -> str:
    """Return a number with two places, or as a whole one from 10 on."""
    return f"{value:.0f}" if abs(value) >= 10 else f"{value:.2f}"


def power_findings(sequences: Sequence[SequenceTracks], data: Path | None = None) -> Findings:
    """Return average power of each sequence in each version.

    Parameters
    ----------
    sequences : sequence of SequenceTracks
        What was optimized; power follows from the power model.
    data : Path, optional
        Folder in which measured power is looked for (`played_power.json`, at any depth).

    Raises
    ------
    InputError
        If one of those files is not as it should be.
    """
    names = [sequence.name for sequence in sequences]
    rows = [*_published_powers(names), *(row for s in sequences for row in _computed_rows(s))]
    files = sorted(data.rglob("played_power.json")) if data else ()
    measured = [read_json_record(PlayedPower, path) for path in files]
    rows += [row for power in measured for row in _measured_rows(power)]
    saved = [100 * (1 - s.summary.mean_power / s.summary.full_power) for s in sequences]
    return Findings(
        name=POWER,
        lead=f"By the power model ours saves {min(saved):.0f} to {max(saved):.0f} % of the full power.",
        statistics=tuple(rows),
        drawings=(),
        sections=(_power_section(rows, bool(measured)),),
    )


def _published_powers(names: Sequence[str]) -> list[Statistic]:
    """Return what the paper prints of these sequences."""
    printed = [(n, column, published(f"power.{n}.{v}")) for n in names for v, column in COLUMNS.items()]
    return [
        Statistic(POWER, name, f"average power, {column}", value.number, "W", Origin.PUBLISHED,
                  method=value.place)
        for name, column, value in printed
    ]  # fmt: skip


def _computed_rows(sequence: SequenceTracks) -> list[Statistic]:
    """Return the power of a sequence by the power model."""
    summary = sequence.summary
    powers = (summary.baseline_power, summary.mean_power, summary.full_power)
    return [
        Statistic(
            POWER, sequence.name, f"average power, {column}", power, "W", Origin.COMPUTED,
            n=summary.frames, method=f"power model {summary.power_model}, mean over the frames",
        )
        for column, power in zip(COLUMNS.values(), powers, strict=True)
    ]  # fmt: skip


def _measured_rows(power: PlayedPower) -> list[Statistic]:
    """Return what was measured of a played video."""
    origin = Origin.SIMULATED if power.simulated else Origin.RECORDED
    return [
        Statistic(
            POWER, power.video, f"average power, {COLUMNS.get(one.version, one.version)}", one.mean_power,
            "W", origin, ci_low=one.ci_low, ci_high=one.ci_high,
            interval=None if one.ci_low is None else 0.95, n=one.n_passes,
            method="measured; n passes, Student's t over them",
        )
        for one in power.versions
    ]  # fmt: skip


def _power_section(rows: Sequence[Statistic], measured: bool) -> Section:
    """Return the table of the report: a line for each sequence and origin."""
    lines: dict[tuple[str, Origin], dict[str, float | None]] = {}
    for row in rows:
        lines.setdefault((row.group, row.origin), {})[row.what.removeprefix("average power, ")] = row.value
    order = list(dict.fromkeys(row.group for row in rows))
    cells: list[tuple[Cell, ...]] = []
    for (name, origin), values in sorted(lines.items(), key=lambda item: order.index(item[0][0])):
        ours, full = values.get("ours"), values.get("full brightness")
        saved = None if ours is None or not full else 100 * (1 - ours / full)
        cells.append((in_words(name), origin.value, *(values.get(c) for c in COLUMNS.values()), saved))
    table = Table(
        "Average power of each sequence [W].",
        ("sequence", "origin", *(f"{column} [W]" for column in COLUMNS.values()), "saved by ours [%]"),
        tuple(cells),
    )
    simulated = any(row.origin is Origin.SIMULATED for row in rows)
    return section("reproduction/power", (table,), simulated=simulated, measured=measured)


def slope_findings(calibration: Findings, limit: RateLimit) -> Findings:
    """Return the rate limit at the luminances that the paper's calibration has thresholds for.

    Parameters
    ----------
    calibration : Findings
        Of the calibration: its figure of the rate limit is shown.
    limit : RateLimit
        What was fitted to it.
    """
    rows: list[Statistic] = []
    lines = []
    for luminance, rate, place in _thresholds():
        group, ours = f"{luminance:g} cd/m^2", float(rate_limit_at(limit, luminance))
        origin = Origin.SIMULATED if limit.simulated else Origin.RECORDED
        low, high = _band(limit, luminance)
        rows += [
            Statistic(
                "slopes", group, "slope at threshold", rate, "cd/m^2/s", Origin.AUTHORS, method=place
            ),
            Statistic(
                "slopes", group, "rate limit", ours, "cd/m^2/s", origin, low, high,
                None if low is None else limit.band_level, method=limit.source,
            ),
        ]  # fmt: skip
        band = None if low is None or high is None else f"{low:.3g} to {high:.3g}"
        lines.append((luminance, rate, 100 * rate / luminance, ours, band, 100 * ours / luminance))
    drawing = next(d for d in calibration.drawings if d.name == "rate_limit")
    kind = "simulated" if limit.simulated else "recorded"
    table = Table(
        "Fastest change of luminance that is noticed in 75 % of the trials.",
        (
            "luminance [cd/m²]",
            "published [cd/m²/s]",
            "[%/s]",
            f"{kind} [cd/m²/s]",
            limit.band_words,
            "[%/s]",
        ),
        tuple(lines),
    )
    worst = max(abs(np.log(line[3] / line[1])) for line in lines)
    about = section(
        "reproduction/slopes",
        (table,),
        (drawing.picture,),
        simulated=limit.simulated,
        kind=kind,
        worst=np.exp(worst),
    )
    statistics = (*rows, *(row for row in calibration.statistics if row.table == "rate_limit"))
    lead = about.paragraphs[0]
    return Findings("slope_over_luminance", lead, statistics, (drawing,), (about,), calibration.warnings)


def _thresholds() -> list[tuple[float, float, str]]:
    """Return luminance, slope (the drop over the ramp's time) and place of the published thresholds."""
    seconds = published("ramp.duration").number
    values = published_values(AUTHORS)
    pairs = zip(values[::2], values[1::2], strict=True)  # luminance, drop, luminance, drop, ...
    return [(luminance.number, drop.number / seconds, drop.place) for luminance, drop in pairs]


def _band(limit: RateLimit, luminance: float) -> tuple[float | None, float | None]:
    """Return the band of a limit; None without one, and beyond the measured luminances."""
    low, high = limit.luminance_range
    if not limit.band_luminance or not low * (1 - 1e-9) <= luminance <= high * (1 + 1e-9):
        return None, None
    at, lower, upper = limit.band_luminance, limit.band_lower, limit.band_upper
    return float(np.interp(luminance, at, lower)), float(np.interp(luminance, at, upper))
