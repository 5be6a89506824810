"""Published numbers and ours at a glance: one line for each claim of the paper that a number carries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from evenlight.analysis.findings import Findings
from evenlight.analysis.published import SEQUENCES, published
from evenlight.analysis.report import Cell, Table
from evenlight.analysis.report_prose import section
from evenlight.analysis.reproduction.online_findings import RATIO
from evenlight.analysis.reproduction.reproduced_tables import DIFFERENCE, find, interval_in_words
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin, Statistic

NAME = "at_a_glance"
LAG = "integral of |static - dynamic response| over time: per pixel"  # what the paper integrates
Line = tuple[str, Statistic, Statistic | None, float | None]  # place, published, ours, no effect


def glance_findings(parts: Mapping[str, Findings]) -> Findings:
    """Return the paper's headline numbers with ours beside them.

    Parameters
    ----------
    parts : mapping of str to Findings
        The parts of the reproduction, by name.
    """
    lines = [
        *_quality(parts),
        *_adaptation(parts["adaptation"]),
        *_power(parts["power"]),
        *_online(parts["online"]),
    ]
    rows = [row for _, theirs, own, _ in lines for row in (theirs, own) if row is not None]
    cells = tuple(_cells(line) for line in lines)
    table = Table(
        "Numbers that the paper prints, or that follow from two of them, and ours.",
        ("what", "where", "published", "ours", "95 % interval", "direction", "origin of ours"),
        cells,
    )
    simulated = any(row.origin is Origin.SIMULATED for row in rows)
    return Findings(
        NAME, "", tuple(rows), (), (section("reproduction/glance", (table,), simulated=simulated),)
    )


def _printed(group: str, what: str, value: float, unit: str, places: str) -> Statistic:
    """Return a row of what the paper prints."""
    return Statistic(NAME, group, what, value, unit, Origin.PUBLISHED, method=places)


def _own(row: Statistic | None, what: str) -> Statistic | None:
    """Return one of our rows as a row of this table."""
    return None if row is None else replace(row, table=NAME, what=what)


def _quality(parts: Mapping[str, Findings]) -> Iterator[Line]:
    """Yield how much better ours is rated, and how often it is chosen."""
    own = parts["detail_quality"].statistics
    for name in SEQUENCES:
        key = f"detail_quality.{name}"
        gain = published(f"{key}.ours_mean").number - published(f"{key}.baseline_mean").number
        what, place = "rating, ours less constant", published(f"{key}.ours_mean").place
        theirs = _printed(name, what, gain, "rating points", f"{place}, difference of two means")
        yield place, theirs, _own(_row(own, name, DIFFERENCE), what), 0.0
    for name in SEQUENCES:
        chosen = published(f"detail_quality.{name}.chosen_percent")
        what = "share that chose ours as the one that changed"
        theirs = _printed(name, what, chosen.number / 100, "1", chosen.place)
        yield chosen.place, theirs, _own(_row(own, name, "ours chosen"), what), None


def _row(rows: Sequence[Statistic], group: str, what: str) -> Statistic | None:
    """Return a row that is not a published one."""
    return find([row for row in rows if row.origin is not Origin.PUBLISHED], group, what)


def _power(part: Findings) -> Iterator[Line]:
    """Yield the share of power that ours saves."""
    for name in SEQUENCES:
        printed = {version: published(f"power.{name}.{version}") for version in ("ours", "full")}
        what, place = "power saved, share of full brightness", printed["ours"].place
        theirs = _printed(name, what, 1 - printed["ours"].number / printed["full"].number, "1", place)
        ours, full = (_row(part.statistics, name, f"average power, {v}") for v in ("ours", "full brightness"))
        saved = None
        if ours is not None and full is not None and ours.value is not None and full.value:
            saved = replace(ours, table=NAME, what=what, value=1 - ours.value / full.value, unit="1",
                            ci_low=None, ci_high=None, interval=None)  # fmt: skip
        yield place, theirs, saved, 0.0


def _online(part: Findings) -> Iterator[Line]:
    """Yield how much steadier contrast loss is under the online controller."""
    ours, constant = published("online.sd_ours"), published("online.sd_baseline")
    what = "SD of contrast loss, controller over constant"
    theirs = _printed("house", what, ours.number / constant.number, "1", ours.place)
    row = _row(part.statistics, "house", RATIO)
    yield ours.place, theirs, _own(row, what), 1.0


def _adaptation(part: Findings) -> Iterator[Line]:
    """Yield how much further adaptation lags without a rate limit than within it."""
    for name in SEQUENCES:
        printed = [published(f"adaptation.{name}.{track}") for track in ("unconstrained", "constrained")]
        what, place = "lag of the cones, without rate limit over within it", printed[0].place
        theirs = _printed(name, what, printed[0].number / printed[1].number, "1", place)
        free, held = (
            _row(part.statistics, name, f"{LAG}, {track}")
            for track in ("without a rate limit", "within the rate limit")
        )
        own = None
        if free is not None and held is not None and free.value is not None and held.value:
            own = replace(free, table=NAME, what=what, value=free.value / held.value, unit="1")
        yield place, theirs, own, 1.0


def _cells(line: Line) -> tuple[Cell, ...]:
    """Return a line of the table."""
    place, theirs, ours, none = line
    name = "Walk through the house" if theirs.group == "house" else in_words(theirs.group)
    what = f"{name}: {theirs.what}"
    if ours is None:
        return what, place, theirs.value, None, None, None, None
    way = _direction(theirs, ours, none)
    return what, place, theirs.value, ours.value, interval_in_words(ours), way, ours.origin.value


def _direction(theirs: Statistic, ours: Statistic, none: float | None) -> str | None:
    """Return whether ours lies on the same side of "no effect" as what is printed, and whether clearly so."""
    if none is None or theirs.value is None or ours.value is None:
        return None
    same = "same" if (theirs.value - none) * (ours.value - none) > 0 else "opposite"
    if ours.ci_low is not None and ours.ci_high is not None:
        return f"{same}, unclear" if ours.ci_low <= none <= ours.ci_high else same
    return same
