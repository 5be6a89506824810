"""Which published effects the simulated viewers reproduce, in sign and size, and how often estimates show it.

What they are assumed to show follows from the method's own model and from chosen figures
(docs/decisions/simulated-viewers.md), at a headset's field of view and as a small picture.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.report import Cell, Table
from evenlight.analysis.report_prose import section
from evenlight.analysis.reproduction.published_effects import COUNTS, FACTOR, Verdict
from evenlight.analysis.reproduction.repeated_figure import effect_points, effects_figure
from evenlight.analysis.reproduction.repeated_sets import RepeatedEffect
from evenlight.analysis.reproduction.reproduction import ReproductionPlan
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.assumed_effect import CHOSEN, RATED, TIME_RATIO
from evenlight.stimuli.video.viewing_geometry import field_of_view_on

NAME = "simulated_viewers"
SHORT = {RATED: "rating difference", CHOSEN: "share choosing ours", TIME_RATIO: "ratio of search times"}


def viewer_findings(
    effects: Sequence[RepeatedEffect], plan: ReproductionPlan, display: Display
) -> tuple[Findings, ...]:
    """Return what simulated viewers reproduce of the paper; nothing where none answered.

    Parameters
    ----------
    effects : sequence of RepeatedEffect
        Each with its estimates.
    plan, display : ReproductionPlan, Display
        The two geometries.
    """
    if not effects:
        return ()
    drawing = Drawing(
        NAME,
        png_bytes(effects_figure(effects, plan.sets)),
        f"What {plan.sets} simulated data sets of {plan.viewers} people give: how estimates are distributed, "
        "what is assumed (line), the one data set that this report shows (ring), and what is published, with "
        "the 95 % interval that its numbers allow (diamond).",
        effect_points(effects),
    )
    degrees = field_of_view_on(display, plan.picture_size[0])
    of = {what: [effect for effect in effects if effect.assumed.what == what] for what in SHORT}
    about = section(
        f"reproduction/{NAME}",
        (_paper_table(effects, plan, degrees), _sets_table(effects, plan)),
        (drawing.picture,),
        simulated=True,
        plan=plan,
        degrees=degrees,
        ratings=of[RATED],
        established=sum(effect.published.is_established(effect.no_effect) for effect in of[RATED]),
        near=_agreeing(of[RATED], [effect.assumed.value for effect in of[RATED]]),
        far=_agreeing(of[RATED], [effect.as_picture for effect in of[RATED]]),
        choices=of[CHOSEN],
        searches=[effect for effect in of[TIME_RATIO] if effect.assumed.group in ("brightened", "dimmed")],
    )
    rows = tuple(row for effect in effects for row in _rows(effect))
    return (Findings(NAME, about.paragraphs[0], rows, (drawing,), (about,)),)


def _agreeing(effects: Sequence[RepeatedEffect], assumed: Sequence[float | None]) -> tuple[int, int]:
    """Return how many assumed values have an established published sign, and how many its size too."""
    found = [e.published.verdict(value, e.no_effect) for e, value in zip(effects, assumed, strict=True)]
    sizes = found.count(Verdict.SIZE)
    return sizes + found.count(Verdict.SIGN), sizes


def _paper_table(effects: Sequence[RepeatedEffect], plan: ReproductionPlan, degrees: float) -> Table:
    """Return each effect as published and as assumed, at both geometries."""
    near, far = f"{plan.field_of_view:g}°", f"{degrees:.1f}°"
    rows: list[tuple[Cell, ...]] = []
    for effect in effects:
        at, told = (effect.assumed.value, effect.as_picture), effect.published
        shown = (_number(told.value), _range(told.interval), *(_number(value) for value in at))
        rows.append((_named(effect), *shown, *(told.verdict_words(value, effect.no_effect) for value in at)))
    return Table(
        f"What simulated viewers are assumed to show, in the population, where a sequence fills a headset's "
        f"field of view ({near}) and as a picture of {far}, and what of the published effect that has: it "
        "agrees by construction. A published sign is established where its interval excludes no effect; a "
        f"size agrees within a factor of {FACTOR:g}, and below {100 * COUNTS:.0f} % of it is too small "
        "to count. CI: 95 % confidence interval.",
        ("effect", "published", "CI", f"assumed, {near}", f"assumed, {far}", f"agrees, {near}",
         f"agrees, {far}"),
        tuple(rows),
    )  # fmt: skip


def _sets_table(effects: Sequence[RepeatedEffect], plan: ReproductionPlan) -> Table:
    """Return how the estimates scatter, and how often they show what is published."""
    rows: list[tuple[Cell, ...]] = []
    for effect in effects:
        towards = effect.share_of_published_sign
        values = (_number(effect.assumed.value), _number(effect.shown), _range(effect.middle()))
        sign = None if towards is None else round(100 * towards)
        rows.append((_named(effect), *values, sign, round(100 * effect.significant)))
    return Table(
        f"Estimates from {plan.sets} simulated data sets of {plan.viewers} people, {plan.field_of_view:g}°: "
        "the one that this report shows, the middle 95 % of all, how often they have the published sign, and "
        "how often p ≤ 0.05 (unadjusted). Ratios of search times are of a model of those locations or that "
        "sequence alone; the section on search times has one model for all sides.",
        ("effect", "assumed", "this report", "middle 95 %", "published sign [%]", "p ≤ 0.05 [%]"),
        tuple(rows),
    )


def _named(effect: RepeatedEffect) -> str:
    """Return what a row is about."""
    return f"{in_words(effect.assumed.group)}: {SHORT[effect.assumed.what]}"


def _rows(effect: RepeatedEffect) -> Iterator[Statistic]:
    """Yield every number of the tables of an effect."""
    own, told = effect.assumed, effect.published
    if told.value is not None and told.interval is not None:
        how = "as printed; independent means, or Clopper and Pearson"
        yield Statistic(
            NAME,
            own.group,
            own.what,
            told.value,
            own.unit,
            Origin.PUBLISHED,
            *told.interval,
            0.95,
            method=how,
        )
    for what, value, unit in (
        ("assumed", own.value, own.unit),
        ("assumed, as a picture", effect.as_picture, own.unit),
        ("estimate of the data set shown", effect.shown, own.unit),
        ("share of the data sets with p <= 0.05", effect.significant, "1"),
        ("share of the data sets with the published sign", effect.share_of_published_sign, "1"),
    ):
        if value is not None and math.isfinite(value):
            yield Statistic(NAME, own.group, f"{own.what}: {what}", value, unit, Origin.SIMULATED)
    yield Statistic(
        NAME, own.group, f"{own.what}: mean of the estimates", effect.mean, own.unit, Origin.SIMULATED,
        *effect.middle(), 0.95, n=len(effect.estimates),
        method="interval: middle 95 % of the data sets; n: data sets",
    )  # fmt: skip


def _number(value: float | None) -> str | None:
    """Return a number with two decimals."""
    return None if value is None or not math.isfinite(value) else f"{round(value, 2) + 0.0:.2f}"


def _range(ends: tuple[float, float] | None) -> str | None:
    """Return an interval with two decimals."""
    return None if ends is None else f"{_number(ends[0])} to {_number(ends[1])}"
