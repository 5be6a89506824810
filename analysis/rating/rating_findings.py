"""What the detail ratings show: numbers, a figure and words (the paper's Section 4.1)."""

from __future__ import annotations

from dataclasses import replace

from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.analysis.integrity.version_order import confounded_order
from evenlight.analysis.rating.rating_figure import rating_figure, rating_points
from evenlight.analysis.rating.rating_order import ContrastTest
from evenlight.analysis.rating.rating_pairs import ALL
from evenlight.analysis.rating.rating_power import POWER
from evenlight.analysis.rating.rating_results import PairResult, RatingResults, rating_results
from evenlight.analysis.rating.rating_statistics import mean_of, odds_ratio, rating_statistics, standard_error
from evenlight.analysis.report import Cell, Picture, Section, Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import in_words, listed, p_text, spaced
from evenlight.data_schema.recordings.viewing import HIGHEST_RATING, LOWEST_RATING, RatingTrial, Version


def rating_findings(data: TaskData[RatingTrial], seed: int = 1) -> Findings:
    """Analyse the ratings of a data set.

    Parameters
    ----------
    data : TaskData of RatingTrial
        All sessions of the task.
    seed : int
        Of the permutations, and of the experiments that are drawn for the smallest difference.
    """
    results, confound = rating_results(data, seed), confounded_order(data)
    unknown = all(trial.place_in_pair is None for trial in data.trials)
    caption = (
        f"Detail ratings of {results.people}: how often each rating was given to each version, and how the "
        "two differ for the same people (left of 0 the baseline is rated higher). Means with 95 % confidence "
        "intervals."
    )
    drawing = Drawing("rating", png_bytes(rating_figure(results)), caption, rating_points(results))
    return Findings(
        name="rating",
        lead=lead_of(results, confound, order_unknown=unknown),
        statistics=rating_statistics(results),
        drawings=(drawing,),
        sections=rating_sections(results, drawing.picture),
        warnings=(*data.warnings, *_warnings(results)),
    )


def _warnings(results: RatingResults) -> tuple[str, ...]:
    """Return what is wrong with the ratings but does not forbid their use."""
    warnings = []
    if len(results.participant_ids) == 1:
        warnings.append("ratings of one participant: nothing can be tested, nothing is said of other people")
    if results.unrated:
        names = listed([spaced(name) for name in results.unrated])
        warnings.append(f"nobody rated {names}: Holm's adjustment counts the other sequences only")
    if results.incomplete:
        who = ", ".join(results.incomplete)
        warnings.append(f"participants without both versions of every sequence: {who}")
    return tuple(warnings)


def lead_of(results: RatingResults, confound: str = "", *, order_unknown: bool = False) -> str:
    """Return what came out, in a sentence or two, and whether it may be the order of the versions."""
    tested = any(p is not None for p in results.adjusted)
    different = len(results.different) if tested else None
    values = {
        "overall": results.overall,
        "rated": len(results.rated),
        "different": different,
        "confound": confound,
        "order_unknown": order_unknown,
    }
    return prose("rating_lead", results=results, **values)[0]


def rating_sections(results: RatingResults, picture: Picture) -> tuple[Section, ...]:
    """Return the sections, in the order in which they are read."""
    sections = (
        _versions_section(results, picture),
        _effects_section(results),
        _model_section(results),
        _order_section(results),
    )
    return tuple(replace(own, simulated=results.simulated) for own in sections)


def _versions_section(results: RatingResults, picture: Picture) -> Section:
    """Return the paper's table, with both standard errors and all ratings."""
    rows: list[tuple[Cell, ...]] = []
    for name in results.sequences:
        for version in (Version.BASELINE, Version.OURS):
            ratings = results.versions[name, version]
            mean = mean_of(ratings)
            errors = [_number(standard_error(ratings, ddof)) for ddof in (1, 0)]
            counts = [ratings.ratings.count(k) for k in range(LOWEST_RATING, HIGHEST_RATING + 1)]
            row = (in_words(name), version.value, _number(mean.value), *errors, _interval(mean))
            rows.append((*row, *counts, len(ratings.means)))
    given = tuple(f"“{k}”" for k in range(LOWEST_RATING, HIGHEST_RATING + 1))
    table = Table(
        "Ratings of each version: mean over n participants with 95 % confidence interval (CI), and how many "
        "ratings of 1 to 5 were given. The standard error of the mean (SEM) is the SD over the root of n; "
        "the SD is divided by n - 1, or by n (population SD).",
        ("sequence", "version", "mean", "SEM", "SEM, population SD", "95 % CI", *given, "n"),
        tuple(rows),
    )
    return section(
        "rating_versions",
        (table,),
        (picture,),
        unrated=[spaced(name) for name in results.unrated],
        lacking=results.incomplete,
    )


def _effects_section(results: RatingResults) -> Section:
    """Return which sequences differ, by how much, and what so many ratings can show."""
    limits = [result.smallest for result in results.pairs if result.smallest is not None]
    overall = results.overall.smallest if len(results.pairs) > 1 else None
    return section(
        "rating_effects",
        (_effects_table(results), _tests_table(results)),
        different=[in_words(name) for name in results.different],
        reach=list(dict.fromkeys(_two_digits(end) for end in (min(limits), max(limits)))) if limits else [],
        overall=_two_digits(overall),
        why_none=list(dict.fromkeys(result.why_no_smallest for result in results.pairs)),
    )


def _effects_table(results: RatingResults) -> Table:
    """Return the effect sizes with their intervals."""
    return Table(
        "Effect sizes, ours less baseline, with 95 % confidence intervals (CI): mean difference [rating "
        "points]; probability that a participant rates ours higher, ties counting one half (0.5: no effect); "
        "matched-pairs rank-biserial correlation; Cohen's d_z.",
        ("sequence", "mean", "95 % CI", "superiority", "95 % CI", "rank-biserial", "95 % CI", "d_z",
         "95 % CI"),
        tuple(
            (
                _name(result),
                *_effect_cells(result.mean),
                *_effect_cells(result.superiority),
                *_effect_cells(result.rank_biserial),
                *_effect_cells(result.d_z),
            )
            for result in results.shown
        ),
    )  # fmt: skip


def _tests_table(results: RatingResults) -> Table:
    """Return the exact tests, and what they could find."""
    rows: list[tuple[Cell, ...]] = []
    for result, adjusted in zip(results.shown, (*results.adjusted, None), strict=False):
        differ = 0 if result.flip is None else result.flip.n_different
        p, *others = (
            p_text(None if test is None else test.p_value)
            for test in (result.flip, result.flip_mid_p, result.ranks, result.signs)
        )
        rows.append(
            (_name(result), p, p_text(adjusted), *others, f"{differ} of {len(result.pairs.participant_ids)}",
             _two_digits(result.smallest), result.caution or "–")
        )  # fmt: skip
    return Table(
        "Primary: exact p of the mean difference (sign flips) of each sequence, adjusted for their number "
        "(Holm). For comparison: its mid-p, the signed ranks (zeros ranked, Pratt) and the signs. The row of "
        "all sequences together is one more test, not adjusted. Detectable: the smallest mean difference "
        "[rating points] that so many pairs, with this spread, show at 5 % with a power of "
        f"{100 * POWER:.0f} %.",
        ("sequence", "p", "Holm", "mid-p", "p, ranks", "p, signs", "pairs that differ", "detectable",
         "remark"),
        tuple(rows),
    )  # fmt: skip


def _model_section(results: RatingResults) -> Section:
    """Return the cumulative-link mixed model and the interactions."""
    model = results.model
    first = in_words(results.rated[0])
    wanted = [("ours to baseline", model.version), ("shown second to shown first", model.place)]
    wanted += [(f"{in_words(effect.name)} to {first}", effect) for effect in model.sequences]
    wanted += [("ours to baseline, the same for all participants", model.version_alike)]
    table = Table(
        f"Odds ratios of a higher rating, from {model.fit.n} ratings of {results.people}, with profile-"
        "likelihood confidence intervals (CI).",
        ("odds ratio", "value", "95 % CI", "p", "remark"),
        tuple(_odds_row(what, effect) for what, effect in wanted),
    )
    return section("rating_model", (table,), model=model, ratio=model.interaction, permuted=results.permuted)


def _odds_row(what: str, effect: FixedEffect) -> tuple[Cell, ...]:
    """Return a row of odds ratios."""
    return (what, *_effect_cells(odds_ratio(effect)), p_text(effect.p_value), effect.flag or "–")


def _order_section(results: RatingResults) -> Section:
    """Return what the order does."""
    order = results.order
    effects = {
        "shown second less shown first": order.place,
        "mean of both versions, ours first less ours second": order.carry_over,
    }
    effects |= {
        f"{in_words(name)}: difference with ours first less that with ours second": test
        for name, test in order.by_sequence.items()
    }
    if all(test.effect.value is None for test in effects.values()):
        return section("rating_order", unknown=order.place.effect.flag)
    table = Table(
        "Effects of the order [rating points] with exact tests and confidence intervals (CI). The p of "
        "single sequences are not adjusted here; rating_statistics.csv has the adjusted ones too.",
        ("effect", "value", "95 % CI", "p", "n", "remark"),
        tuple(_order_row(what, test) for what, test in effects.items()),
    )
    return section("rating_order", (table,), unknown="")


def _order_row(what: str, test: ContrastTest) -> tuple[Cell, ...]:
    """Return a row of effects of the order."""
    return (what, *_effect_cells(test.effect), p_text(test.p_value), test.n, test.effect.flag or "–")


def _name(result: PairResult) -> str:
    """Return what a row is about."""
    return "all (participants' means)" if result.pairs.name == ALL else in_words(result.pairs.name)


def _number(value: float | None) -> str | None:
    """Return a number with two decimals."""
    return None if value is None else f"{round(value, 2) + 0.0:.2f}"  # no "-0.00"


def _two_digits(value: float | None) -> str | None:
    """Return a number with two significant digits, for what is known to some percent only."""
    return None if value is None else f"{value:.2g}"


def _interval(effect: Effect) -> str | None:
    """Return an interval; one with a single end in words."""
    low, high = effect.ci_low, effect.ci_high
    if low is None:
        return None if high is None else f"below {high:.2f}"
    return f"above {low:.2f}" if high is None else f"{low:.2f} to {high:.2f}"


def _effect_cells(effect: Effect) -> tuple[Cell, Cell]:
    """Return an effect and its interval as two cells."""
    return _number(effect.value), _interval(effect)
