"""Published numbers beside our own: slopes (Figure 3), detail quality (Table 1), average power (Table 3).

Also what simulated viewers are assumed to show: they answer as they were built to.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from scipy import special

from evenlight.analysis.inference.binomial_tests import clopper_pearson
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.analysis.published import SEQUENCES, published, published_values
from evenlight.analysis.report import Cell, Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.reproduction.published_beside import (
    CHOSEN,
    DIFFERENCE,
    POWER,
    RATINGS,
    SLOPE,
    beside_table,
    marked,
)
from evenlight.analysis.reproduction.reproduction import SequenceTracks
from evenlight.analysis.results import Analysis
from evenlight.analysis.rows import Rows, number, with_interval
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.assumed_effect import CHOSEN as CHANCE
from evenlight.data_schema.recordings.assumed_effect import CHOSEN_UNMASKED, RATED, TIME_RATIO
from evenlight.data_schema.recordings.played_power import PlayedPower
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.method.rate_limit import rate_limit_at

TABLE = "detail_quality"
VERSIONS = ("baseline", "ours")
COLUMNS = {"baseline": "constant", "ours": "ours", "full": "full brightness"}  # of the table of powers
ASSUMED = "assumed"  # the table of what is true of simulated participants
VIEWERS = "simulated_viewers"
SHORT = {
    RATED: "rating difference",
    CHANCE: "share choosing the track",
    TIME_RATIO: "ratio of search times",
}


def slope_findings(calibration: Analysis, limit: RateLimit) -> Analysis:
    """Return the rate limit that was fitted at the luminances of the paper's thresholds, and its figure."""
    rows = Rows(Origin.SIMULATED if limit.simulated else Origin.RECORDED)
    factors = []
    for luminance, rate, place in _thresholds():
        add = partial(rows.add, "slopes", f"{luminance:g} cd/m^2")
        ours, band = float(rate_limit_at(limit, luminance)), _band(limit, luminance)
        add(SLOPE, "cd/m^2/s", place, rate, origin=Origin.AUTHORS)
        add("rate limit", "cd/m^2/s", limit.source, Effect(ours, *band), level=limit.band_level)
        rows[-1] = marked(rows[-1], drawn=limit.simulated, beside=SLOPE)
        factors.append(ours / rate)
    drawing = next(own for own in calibration.drawings if own.name == "rate_limit")
    kind, worst = rows.origin.value, float(np.exp(np.abs(np.log(factors)).max()))
    caption = (
        f"Fastest change of luminance that is noticed in 75 % of the trials, with its {limit.band_words}."
    )
    table = beside_table(caption, rows, drawn=limit.simulated)
    about = section(
        "reproduction/slopes", (table,), (drawing.picture,), simulated=limit.simulated, kind=kind, worst=worst
    )
    statistics = (*rows, *(row for row in calibration.rows if row.table == "rate_limit"))
    return Analysis(
        "slope_over_luminance", about.paragraphs[0], statistics, (drawing,), (about,), calibration.warnings
    )


def _thresholds() -> Iterator[tuple[float, float, str]]:
    """Yield luminance, slope (the drop over the ramp's time) and place of the published thresholds."""
    seconds = published("ramp.duration").number
    values = published_values("authors_thresholds")
    for luminance, drop in zip(values[::2], values[1::2], strict=True):
        yield luminance.number, drop.number / seconds, drop.place


def _band(limit: RateLimit, luminance: float) -> tuple[float | None, float | None]:
    """Return the band of a limit; None without one, and beyond the measured luminances."""
    low, high = limit.luminance_range
    if not limit.band_luminance or not low * (1 - 1e-9) <= luminance <= high * (1 + 1e-9):
        return None, None
    ends = (np.interp(luminance, limit.band_luminance, edge) for edge in (limit.band_lower, limit.band_upper))
    lower, upper = (float(end) for end in ends)
    return lower, upper


def detail_quality_findings(rating: Analysis, comparison: Analysis) -> Analysis:
    """Return mean ratings with standard errors, and how often ours was chosen, sequence by sequence."""
    printed = _printed_quality()
    answered = [*rating.rows, *comparison.rows]
    groups = dict.fromkeys(row.group for row in answered if row.what in (DIFFERENCE, CHOSEN))
    names = [name for name in groups if name != "all" and not name.startswith("all ")]
    ours = Rows(Origin.SIMULATED)
    for name in names:
        for what in (*RATINGS, DIFFERENCE, CHOSEN):
            own = next((row for row in answered if (row.group, row.what) == (name, what)), None)
            if own is not None:
                ours.append(marked(own, drawn=True) if what in (DIFFERENCE, CHOSEN) else own)
    (caption,) = prose(f"reproduction/{TABLE}_caption")
    table = beside_table(caption, (*printed, *ours), drawn=True)
    simulated = any(row.origin is Origin.SIMULATED for row in ours)
    about = section(
        f"reproduction/{TABLE}", (table,), simulated=simulated, leads=(rating.lead, comparison.lead)
    )
    return Analysis(TABLE, f"{rating.lead} {comparison.lead}", (*printed, *ours), (), (about,))


def _printed_quality() -> Rows:
    rows, n = Rows(Origin.PUBLISHED), int(published("participants.viewing").number)
    for name in SEQUENCES:
        add = partial(rows.add, TABLE, name)
        for version in VERSIONS:
            for what, key in (("mean rating", "mean"), ("standard error", "sem")):
                value = published(f"{TABLE}.{name}.{version}_{key}")
                add(f"{what}, {version}", "rating points", value.place, value.number, n)
        gain, place = _published_gain(name), published(f"{TABLE}.{name}.ours_mean").place
        add(DIFFERENCE, "rating points", f"{place}, difference of two means", gain, n)
        chosen = published(f"{TABLE}.{name}.chosen_percent")
        add(CHOSEN, "1", chosen.place, chosen.number / 100, n)
    return rows


def _published_gain(name: str) -> float:
    baseline, ours = (published(f"{TABLE}.{name}.{version}_mean").number for version in VERSIONS)
    return ours - baseline


def power_findings(sequences: Sequence[SequenceTracks], data: Path | None = None) -> Analysis:
    """Return average power of each sequence in each version, by the power model.

    Measured power stands beside it, if a folder of data has any (`played_power.json`, at any depth).
    """
    rows = Rows(Origin.COMPUTED)
    for name in (sequence.name for sequence in sequences):
        for version, column in COLUMNS.items():
            watts = published(f"power.{name}.{version}")
            add = partial(rows.add, "power", name, f"{POWER}, {column}", "W", origin=Origin.PUBLISHED)
            add(watts.place, watts.number)
    for sequence in sequences:
        summary = sequence.summary
        powers = (summary.baseline_power, summary.mean_power, summary.full_power)
        method = f"power model {summary.power_model}, mean over the frames"
        for column, power in zip(COLUMNS.values(), powers, strict=True):
            rows.add("power", sequence.name, f"{POWER}, {column}", "W", method, power, summary.frames)
            rows[-1] = marked(rows[-1], drawn=False)
    files = sorted(data.rglob("played_power.json")) if data else []
    measured = [read_json_record(PlayedPower, path) for path in files]
    for played in measured:
        origin = Origin.SIMULATED if played.simulated else Origin.RECORDED
        for one in played.versions:
            what = f"{POWER}, {COLUMNS.get(one.version, one.version)}"
            add = partial(rows.add, "power", played.video, what, "W", origin=origin)
            effect = Effect(one.mean_power, one.ci_low, one.ci_high)
            add("measured; n passes, Student's t over them", effect, one.n_passes)
    table = beside_table("Average power of each sequence.", rows, drawn=False)
    saved = [sequence.saved for sequence in sequences]
    simulated = any(row.origin is Origin.SIMULATED for row in rows)
    about = section("reproduction/power", (table,), simulated=simulated, measured=bool(measured))
    lead = f"By the power model the track saves {min(saved):.0f} to {max(saved):.0f} % of the full power."
    return Analysis("power", lead, tuple(rows), (), (about,))


def viewer_findings(parts: Sequence[Analysis]) -> tuple[Analysis, ...]:
    """Return what simulated viewers are assumed to show, beside what is published; nothing without them."""
    assumed = [row for part in parts for row in part.rows if row.table == ASSUMED]
    if not assumed:
        return ()
    rows, lines = Rows(Origin.SIMULATED), list[tuple[Cell, ...]]()
    for row in (own for own in assumed if own.what in SHORT):
        told = published_effect(row.what, row.group)
        if told is not None:
            how = "as printed; independent means, or Clopper and Pearson"
            rows.add(VIEWERS, row.group, row.what, row.unit, how, told, origin=Origin.PUBLISHED)
        printed = with_interval(rows.find(VIEWERS, row.group, row.what))
        rows.add(VIEWERS, row.group, f"{row.what}: assumed", row.unit, "", row.value)
        lines.append((f"{in_words(row.group)}: {SHORT[row.what]}", *printed, *number(row)))
    table = Table(
        "What simulated viewers are assumed to show, in the population, beside what is published.",
        ("effect", "published", "95 % CI", "assumed"),
        tuple(lines),
    )
    of = {what: [row for row in assumed if row.what == what] for what in (*SHORT, CHOSEN_UNMASKED)}
    printed_gains = [row for row in rows if row.origin is Origin.PUBLISHED and row.what == RATED]
    about = section(
        f"reproduction/{VIEWERS}",
        (table,),
        simulated=True,
        ratings=[row.value for row in of[RATED]],
        established=sum(row.ci_low is not None and row.ci_low > 0 for row in printed_gains),
        choices=[row.value for row in of[CHANCE]],
        unmasked=[row.value for row in of[CHOSEN_UNMASKED]],
        searches=[row for row in of[TIME_RATIO] if row.group in ("brightened", "dimmed")],
    )
    return (Analysis(VIEWERS, about.paragraphs[0], tuple(rows), (), (about,)),)


def published_effect(what: str, group: str) -> Effect | None:
    """Return an effect as printed, with the 95 % interval that the printed numbers allow; None if none is.

    Intervals are those of differences of independent means (Student's t; people who rate both versions alike
    would make it narrower), and of Clopper and Pearson.
    """
    if group not in SEQUENCES or what not in (RATED, CHANCE):
        return None
    key, people = f"{TABLE}.{group}", int(published("participants.viewing").number)
    if what == CHANCE:
        share = published(f"{key}.chosen_percent").number / 100
        return Effect(share, *clopper_pearson(round(share * people), people))
    error = math.hypot(*(published(f"{key}.{version}_sem").number for version in VERSIONS))
    gain, half = _published_gain(group), float(special.stdtrit(people - 1, 0.975)) * error
    return Effect(gain, gain - half, gain + half)
