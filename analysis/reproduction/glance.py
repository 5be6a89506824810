"""The paper's headline numbers with ours beside them, and what agreement of the two can show.

Many of our numbers are made with published ones: budgets, power model, rate limit, gains. Some follow from
them, and then cannot but agree (docs/decisions/what-agreement-shows.md).
"""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from evenlight.analysis.findings import Findings
from evenlight.analysis.published import SEQUENCES, published
from evenlight.analysis.report import Cell, Table
from evenlight.analysis.report_prose import section
from evenlight.analysis.reproduction.measured_times import FRAME, OPTIMIZATION, TIMED_FRAMES
from evenlight.analysis.reproduction.online_findings import RATIO
from evenlight.analysis.reproduction.reproduced_tables import DIFFERENCE, find, interval_in_words
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.rate_limit import RateLimit

NAME = "at_a_glance"
LAG = "integral of |static - dynamic response| over time: per pixel"  # what the paper integrates
CAPTION = (
    "Numbers that the paper prints, or that follow from two of them, and ours. Sign: whether both lie on the "
    "same side of no effect; unclear where our interval has both sides, or ours has none and lies within "
    "5 % of no effect."
)
NEAR = 0.05  # of no effect, or of what is printed where that is 0: within it a number alone has no sign


class Dependence(enum.Enum):
    """How far published numbers make ours, so that agreement would show nothing."""

    INDEPENDENT = "independent"  # none went into it
    PARTLY = "partly determined by published numbers"  # some went into it, and leave it open
    CIRCULAR = "circular"  # they, or choices that were made to meet them, make it


@dataclass(frozen=True, slots=True)
class GlanceLine:
    """A line of the table.

    Attributes
    ----------
    place : str
        Where in the paper.
    theirs, ours : Statistic
        What is printed, and our number; None where there is none.
    dependence, because : Dependence, str
        How far theirs makes ours, and by what.
    no_effect : float or None
        What either would be without any effect; None where that has no side.
    """

    place: str
    theirs: Statistic
    ours: Statistic | None
    dependence: Dependence
    because: str
    no_effect: float | None = None

    @property
    def sign(self) -> str | None:
        """Whether ours lies on the same side of no effect; None where the agreement is circular."""
        ours, none = self.ours, self.no_effect
        if none is None or self.dependence is Dependence.CIRCULAR:
            return None
        if self.theirs.value is None or ours is None or ours.value is None:
            return None
        if f"{ours.value:.3g}" == f"{none:.3g}":
            return "no difference"  # to the digits shown
        near = abs(ours.value - none) <= NEAR * abs(none or self.theirs.value)
        if near and (ours.ci_low is None or ours.ci_high is None):
            return "unclear"
        same = "same" if (self.theirs.value - none) * (ours.value - none) > 0 else "opposite"
        if ours.ci_low is not None and ours.ci_high is not None and ours.ci_low <= none <= ours.ci_high:
            return f"{same}, unclear"
        return same


def glance_findings(parts: Mapping[str, Findings], times: Sequence[Statistic], limit: RateLimit) -> Findings:
    """Return the paper's headline numbers with ours beside them.

    Parameters
    ----------
    parts : mapping of str to Findings
        Of the reproduction, by name.
    times : sequence of Statistic
        What was timed, from `measured_times`.
    limit : RateLimit
        Of all tracks.
    """
    lines = (
        *_ratings(parts["detail_quality"].statistics), *_choices(parts["detail_quality"].statistics),
        *_adaptation(parts["adaptation"], limit), *_power(parts["power"]), _online(parts["online"], limit),
        *_times(times),
    )  # fmt: skip
    rows = [row for line in lines for row in _rows(line)]
    table = Table(
        CAPTION,
        ("what", "where", "published", "ours", "95 % interval", "origin of ours", "ours is", "by", "sign"),
        tuple(_cells(line) for line in lines),
    )
    simulated = any(row.origin is Origin.SIMULATED for row in rows)
    about = section("reproduction/glance", (table,), simulated=simulated, times=times)
    return Findings(NAME, "", tuple(rows), (), (about,))


def _rows(line: GlanceLine) -> Iterator[Statistic]:
    """Yield both numbers of a line; ours says in its flag what makes it, where published ones do."""
    yield line.theirs
    if line.ours is not None:
        made = "" if line.dependence is Dependence.INDEPENDENT else f"{line.dependence.value}: {line.because}"
        yield replace(line.ours, flag="; ".join(filter(None, (made, line.ours.flag))))


def _cells(line: GlanceLine) -> tuple[Cell, ...]:
    """Return a line of the table."""
    theirs, ours = line.theirs, line.ours
    name = "Walk through the house" if theirs.group == "house" else in_words(theirs.group)
    what = f"{name}: {theirs.what}"
    if ours is None:
        return what, line.place, theirs.value, *(None,) * 6
    interval, origin = interval_in_words(ours), ours.origin.value
    made = line.dependence.value, line.because
    return what, line.place, theirs.value, ours.value, interval, origin, *made, line.sign


def _printed(group: str, what: str, value: float, unit: str, places: str) -> Statistic:
    """Return a row of what the paper prints."""
    return Statistic(NAME, group, what, value, unit, Origin.PUBLISHED, method=places)


def _own(row: Statistic | None, what: str) -> Statistic | None:
    """Return one of our rows as a row of this table."""
    return None if row is None else replace(row, table=NAME, what=what)


def _row(rows: Sequence[Statistic], group: str, what: str) -> Statistic | None:
    """Return a row that is not a published one."""
    return find([row for row in rows if row.origin is not Origin.PUBLISHED], group, what)


def _answered(row: Statistic | None, chosen: str) -> tuple[Dependence, str]:
    """Return what makes answers: people, or choices about simulated ones."""
    if row is not None and row.origin is Origin.RECORDED:
        return Dependence.INDEPENDENT, "people answered"
    return Dependence.CIRCULAR, chosen


def _ratings(own: Sequence[Statistic]) -> Iterator[GlanceLine]:
    """Yield how much better ours is rated."""
    what = "rating, ours less constant"
    for name in SEQUENCES:
        key = f"detail_quality.{name}"
        gain = published(f"{key}.ours_mean").number - published(f"{key}.baseline_mean").number
        place = published(f"{key}.ours_mean").place
        theirs = _printed(name, what, gain, "rating points", f"{place}, difference of two means")
        ours = _own(_row(own, name, DIFFERENCE), what)
        made = _answered(ours, "raters' loss model and cut points")
        yield GlanceLine(place, theirs, ours, *made, no_effect=0.0)


def _choices(own: Sequence[Statistic]) -> Iterator[GlanceLine]:
    """Yield how often ours is chosen."""
    what = "share that chose ours as the one that changed"
    for name in SEQUENCES:
        chosen = published(f"detail_quality.{name}.chosen_percent")
        theirs = _printed(name, what, chosen.number / 100, "1", chosen.place)
        ours = _own(_row(own, name, "ours chosen"), what)
        made = _answered(ours, "observers' thresholds and masking")
        yield GlanceLine(chosen.place, theirs, ours, *made)


def _adaptation(part: Findings, limit: RateLimit) -> Iterator[GlanceLine]:
    """Yield how much further adaptation lags without a rate limit than within it."""
    what = "lag of the cones, without rate limit over within it"
    for name in SEQUENCES:
        printed = [published(f"adaptation.{name}.{track}") for track in ("unconstrained", "constrained")]
        place = printed[0].place
        theirs = _printed(name, what, printed[0].number / printed[1].number, "1", place)
        free, held = (
            _row(part.statistics, name, f"{LAG}, {track}")
            for track in ("without a rate limit", "within the rate limit")
        )
        own = None
        if free is not None and held is not None and free.value is not None and held.value:
            own = replace(free, table=NAME, what=what, value=free.value / held.value, unit="1")
        because = _and_limit("budgets", limit)
        yield GlanceLine(place, theirs, own, Dependence.PARTLY, because, no_effect=1.0)


def _and_limit(what: str, limit: RateLimit) -> str:
    """Return what was published; the rate limit too if participants were drawn around the published one."""
    return f"{what} and rate limit" if limit.simulated else what


def _power(part: Findings) -> Iterator[GlanceLine]:
    """Yield the share of power that ours saves."""
    what = "power saved, share of full brightness"
    for name in SEQUENCES:
        printed = {version: published(f"power.{name}.{version}") for version in ("ours", "full")}
        place = printed["ours"].place
        theirs = _printed(name, what, 1 - printed["ours"].number / printed["full"].number, "1", place)
        ours, full = (_row(part.statistics, name, f"average power, {v}") for v in ("ours", "full brightness"))
        saved = None
        if ours is not None and full is not None and ours.value is not None and full.value:
            saved = replace(ours, table=NAME, what=what, value=1 - ours.value / full.value, unit="1",
                            ci_low=None, ci_high=None, interval=None)  # fmt: skip
        yield GlanceLine(place, theirs, saved, Dependence.CIRCULAR, "budgets and power model")


def _online(part: Findings, limit: RateLimit) -> GlanceLine:
    """Return how much steadier contrast loss is under the online controller."""
    ours, constant = published("online.sd_ours"), published("online.sd_baseline")
    what = "SD of contrast loss, controller over constant"
    theirs = _printed("house", what, ours.number / constant.number, "1", ours.place)
    row = _own(_row(part.statistics, "house", RATIO), what)
    return GlanceLine(ours.place, theirs, row, Dependence.PARTLY, _and_limit("gains", limit), no_effect=1.0)


def _times(times: Sequence[Statistic]) -> Iterator[GlanceLine]:
    """Yield how long the optimizer takes, and a frame of the controller."""
    solved, frame = (next(row for row in times if row.what == what) for what in (OPTIMIZATION, FRAME))
    whole = published("optimizer.duration")
    seconds = 60 * whole.number * TIMED_FRAMES / published("optimizer.frames").number
    theirs = _printed(solved.group, solved.what, seconds, "s", f"{whole.place}: {whole.note}")
    yield GlanceLine(whole.place, theirs, _own(solved, solved.what), Dependence.INDEPENDENT, "timed here")
    added = published("online.overhead")
    theirs = _printed(frame.group, frame.what, added.number, "ms", f"{added.place}: {added.note}")
    yield GlanceLine(added.place, theirs, _own(frame, frame.what), Dependence.INDEPENDENT, "timed here")
