"""What a track saves, costs and gains: the same words in the terminal, the report, the player and Python.

Loss is in % of visible contrast, a difference of losses in percentage points. From which numbers on there is
little to gain is a convention: docs/decisions/lower-bound.md.
"""

from __future__ import annotations

import math

from evenlight.analysis.wording import percent, sentence
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.optimization_summary import ROUNDING, OptimizationSummary
from evenlight.method.online.gain import NO_GAIN
from evenlight.method.preset_files import no_power_model

OFF_BUDGET = 0.005  # relative: from here on a budget that is not met is told of
PUBLISHED = "surace2025"  # the preset of a power model, measured on a panel of its own
SAME_POWER = 1e-4  # relative: powers that print alike
LITTLE_SPREAD = 0.005  # mean difference of contrast loss between two frames, of either track
UNEVEN = 2.0  # times the mean loss: from here on the worst frame does not lose nearly the same
LITTLE_WORST = 0.01  # by which the largest loss of any frame is smaller than under constant dimming
ALWAYS = 0.995  # share of the time that prints as 100 %


# --- numbers


def lost(share: float) -> str:
    """Return a loss of visible contrast, to a tenth, or to two digits where it is small.

    >>> lost(0.03049), lost(0.00054)
    ('3.0 %', '0.054 %')
    """
    return f"{alike(share)[0]} %"


def alike(*shares: float) -> tuple[str, ...]:
    """Return losses in %, or differences in points, that are compared: all with the same decimals.

    They are told to tenths; to hundredths where one is below 1, and to two digits where all are below 0.1.

    >>> alike(0.03, 0.04), alike(0.0068, 0.0138), alike(0.00055, 0.00066), alike(0.0, 0.04)
    (('3.0', '4.0'), ('0.68', '1.38'), ('0.055', '0.066'), ('0.0', '4.0'))
    """
    known = [100 * share for share in shares if share > ROUNDING] or [1.0]
    decimals = max(_decimals(max(known)), min(_decimals(min(known)), 2))
    return tuple(f"{100 * share:.{decimals}f}" for share in shares)


def _decimals(value: float) -> int:
    """Return the decimals that two digits take: one at least, and six at most, as beyond is rounding."""
    return min(max(1 - math.floor(math.log10(value)), 1), 6)


def watts(power: float) -> str:
    """Return a power.

    >>> watts(0.8523), watts(12.34), watts(0.0123), watts(4.0)
    ('0.85 W', '12.3 W', '0.012 W', '4.00 W')
    """
    return f"{power:.2g} W" if power < 0.1 else f"{power:.2f} W" if power < 10 else f"{power:.1f} W"


def less_or_more(gain: float) -> str:
    """Return how much less a track has than constant dimming, or more where the gain is negative.

    >>> less_or_more(0.214), less_or_more(-0.3991)
    ('21 % less', '40 % more')
    """
    return f"{100 * abs(gain):.0f} % {'more' if gain < 0 else 'less'}"


def compared(ours: float, constant: float) -> str:
    """Return how one difference of losses compares to that of constant dimming, which is above 0.

    >>> [compared(ours, 0.1) for ours in (0.05, 0.1, 0.12, 1.0)]
    ['50 % less', 'as much', '20 % more', '10 times as much']
    """
    ratio = ours / constant
    if abs(ratio - 1) < 0.005:
        return "as much"
    if ratio < 2:
        return less_or_more(1 - ratio)
    return f"{ratio:.3g} times as much" if ratio < 1000 else "over 1000 times as much"


# --- what else came out


def details(summary: OptimizationSummary) -> tuple[str, ...]:
    """Return what a track's figures rest on, and how near to the best it is, a line each."""
    equal = "at equal power" if uses_same_power(summary) else "with the same mean factor"
    lines = (
        f"constant: dimmed by {summary.baseline_factor:.3g} throughout, {equal}",
        _best_possible(summary),
        _other_measures(summary),
        _minimized(summary),
        _off_budget(summary),
        _power(summary),
        _watched(summary),
    )
    return tuple(line for line in (*lines, *(summary.film.notes if summary.film else ())) if line)


def detail_sentences(summary: OptimizationSummary) -> str:
    """Return the same in sentences."""
    return _sentences(details(summary))


def uses_same_power(summary: OptimizationSummary) -> bool:
    """Return whether a track and its constant baseline use the same power."""
    ours, constant = summary.mean_power, summary.baseline_power
    return ours is not None and constant is not None and abs(ours - constant) <= SAME_POWER * constant


def _power(summary: OptimizationSummary) -> str:
    """Return what the power is of, and how long a battery lasts."""
    panel, life, life_full = summary.power_model, summary.battery_life, summary.battery_life_full
    if panel is None:
        return no_power_model(summary.display)
    lines = []
    if panel == PUBLISHED != summary.display:
        own = f"give {summary.display}'s own as --power-model"
        lines.append(f"power is that of the published panel, an LCD ({panel}; {own})")
    elif panel != summary.display:
        lines.append(f"power is that of the display of the power model {panel}")
    if life is not None and life_full is not None:
        hours = f"{life:.3g} h instead of {life_full:.3g} h"
        lines.append(f"{summary.battery_capacity:g} Wh last that panel alone {hours}")
    return "; ".join(lines)


def nothing_lost(summary: OptimizationSummary) -> str:
    """Return that no frame loses anything, and why; empty if one does."""
    if max(summary.mean_contrast_loss, summary.mean_contrast_loss_baseline) > ROUNDING:
        return ""
    if summary.frames_without_contrast == summary.frames:
        return "nothing is visible in any frame, so there is no contrast to lose"
    return "no visible contrast is lost in any frame, nor is it with constant dimming"


def differences(summary: OptimizationSummary) -> tuple[str, str, str]:
    """Return the difference between two frames, with constant dimming, and the least; empty if not known."""
    ours, constant, least = alike(summary.objective, summary.objective_baseline, summary.lower_bound)
    return ours, constant, least if summary.lower_bound > 0 else ""


def evenness(summary: OptimizationSummary) -> str:
    """Return how much frames differ in what they lose; nothing where none loses anything."""
    ours, constant = summary.objective, summary.objective_baseline
    if nothing_lost(summary):
        return ""
    if not (ours > 0 or constant > 0):
        return "constant dimming already loses the same share of contrast in every frame"
    spread, spread_constant, _ = differences(summary)
    words = (
        f"two frames differ by {spread} points in what they lose{', by their weights' * summary.weighted}, "
        f"with constant dimming by {spread_constant}"
    )
    if little := little_to_gain(summary):
        return f"{little}: {words}"
    return f"{words}: {compared(ours, constant)}" if constant > 0 else words


def _best_possible(summary: OptimizationSummary) -> str:
    """Return what unevenness is, and how little frames can differ at least, where that is of use."""
    constant, least = summary.objective_baseline, differences(summary)[2]
    what = f"unevenness: mean difference in loss between two frames{', by their weights' * summary.weighted}"
    if nothing_lost(summary):
        return ""
    if not least or summary.minimized is not None or little_to_gain(summary):
        return what
    certain = summary.objective > NO_GAIN * constant and summary.lower_bound > 0.9 * constant
    why = ": budget, rate limit and lowest factor leave no room" * certain
    return f"{what}; within the limits {least} points at least{why}"


def _other_measures(summary: OptimizationSummary) -> str:
    """Return what other measures say of the difference, and in how many frames."""
    known = [f"{less_or_more(one.gain)} by {one.measure}" for one in summary.measured if one.gain is not None]
    if not known:
        return ""
    frames = f"in {summary.frames_measured} sampled frames, unevenness is {' and '.join(known)}"
    return f"{frames} (evenlight judge looks at all)"


def _minimized(summary: OptimizationSummary) -> str:
    """Return what was minimized and how far; empty where it is the difference between two frames."""
    found = summary.minimized
    if found is None:
        return ""
    best = f"best possible {{}}{' points' * (summary.level_weight is not None)}" if found.bound > 0 else ""
    if summary.by_measure:
        each = [f"; {m.name} {percent(m.value / m.baseline)}" for m in summary.by_measure if m.baseline > 0]
        certain = best and f" ({best.format(percent(found.bound))})"
        return (
            f"the {found.name} was minimized: {percent(found.value)} of constant dimming's{certain}"
            f"{''.join(each)}; loss itself is by {summary.contrast_model}"
        )
    less = less_or_more(1 - found.value / found.baseline if found.baseline > 0 else 0.0)
    value, constant, bound = alike(found.value, found.baseline, found.bound)
    unit, what = "%", "the largest loss of any frame"
    if summary.level_weight is not None:
        unit = "points"
        what = f"the difference between two frames plus {summary.level_weight:g} times the mean loss"
    return (
        f"minimized was {what}: {value} {unit}, with constant dimming {constant} "
        f"({less}{best and '; ' + best.format(bound)})"
    )


def _off_budget(summary: OptimizationSummary) -> str:
    """Return by how much a budget is not met; nothing where it is, or where clips share it."""
    used, budget = summary.achieved, summary.budget
    if summary.clips > 1 or abs(used - budget) <= OFF_BUDGET * budget:
        return ""
    how = "exceeded" if used > budget else "not used up"
    return f"the budget of {budget:g} ({summary.budget_unit.value}) is {how}: {used:.3g} on average"


def outcome_in_words(summary: OptimizationSummary) -> str:
    """Return how evenly contrast is lost, and what was minimized if it was not that."""
    return _sentences((_minimized(summary), evenness(summary) or nothing_lost(summary)))


def budget_in_words(summary: OptimizationSummary) -> str:
    """Return what a track uses, and the budget where that is another, or not the track's alone."""
    unit, achieved, budget = summary.budget_unit, summary.achieved, summary.budget

    def amount(value: float) -> str:
        if unit is BudgetUnit.POWER:
            return f"{100 * value:.3g} %"
        return f"{value:.3g}" if unit is BudgetUnit.FACTOR else f"{value:.3g} W"

    what = {BudgetUnit.FACTOR: "mean brightness factor {}", BudgetUnit.POWER: "{} of full power"}
    words = what.get(unit, "mean power {}").format(amount(achieved))
    if summary.clips > 1:
        return f"{words} ({amount(budget)} shared by {summary.clips} clips)"
    return f"{words} (budget {amount(budget)})" if abs(achieved - budget) > SAME_POWER * budget else words


# --- little to gain


def little_to_gain(summary: OptimizationSummary) -> str:
    """Return that there was little to gain in a video, by any measure that counts; nothing of mean losses."""
    spreads = [summary.objective, summary.objective_baseline]
    spreads += [spread for one in summary.by_measure for spread in (one.value, one.baseline)]
    worst, mean = summary.worst_contrast_loss_baseline or 0.0, summary.mean_contrast_loss_baseline
    spared = worst - (summary.worst_contrast_loss or 0.0)
    if summary.level_weight is not None or max(spreads) >= LITTLE_SPREAD or spared >= LITTLE_WORST:
        return ""
    if worst > UNEVEN * mean:
        return f"little to gain here: constant dimming already loses little (worst frame {percent(worst)})"
    return "little to gain here: constant dimming already loses nearly the same in every frame"


# --- how fast it changes


def detection_in_words(summary: OptimizationSummary) -> str:
    """Return a sentence on how near to its limit a track changes, and how often it turns back."""
    near, turns = summary.share_near_limit, summary.reversals_per_s
    if near is None or turns is None:
        return "How long it is near the limit is not known (an older file)."
    how_near = f"near its limit {f'{100 * near:.0f} % of' if near < ALWAYS else 'all'} the time"
    if near <= 1 - ALWAYS:
        how_near = "never near its limit"
    often = f"reverses {turns:.2g} times a second" if turns > 0 else "never reverses"
    if f"{turns:.2g}" == "1":
        often = "reverses once a second"
    elif 0 < turns < 1:
        often = f"reverses once in {1 / turns:{'.2g' if turns > 0.1 else '.0f'}} s"
    return f"The track is {how_near} and {often}."


def _watched(summary: OptimizationSummary) -> str:
    """Return who a watcher is, and what is assumed of people."""
    if (seen := summary.watched) is None:
        return ""
    assumed = f"; assumed: {seen.assumed}" if seen.assumed else ""
    who = "the median person who watches a plain screen for changes; one person in 20 is sensitive"
    return f"noticed: by {who}{assumed}"


def moved_in_words(summary: OptimizationSummary) -> str:
    """Return for which share of detections the limit is, with a space before; nothing as it was fitted."""
    return "" if summary.noticed is None else f" for {100 * summary.noticed:g} % noticed"


def rate_in_words(summary: OptimizationSummary) -> str:
    """Return how fast brightness changes at most, by which limit, and what was accepted of it."""
    procedure = summary.rate_limit_procedure
    known = [*([procedure.value] if procedure else []), *(["simulated"] if summary.simulated else [])]
    asked = f" ({', '.join(known)})" * bool(known) + moved_in_words(summary)
    accepted = ", whose wide or missing band was accepted" if summary.wide_band_accepted else ""
    allowance, ratio = summary.largest_allowance or 0.0, summary.max_rate_ratio_fitted or 0.0
    beyond = ""
    if allowance > 1:
        beyond = f"nowhere beyond the fitted limit, though allowances go up to {allowance:g} times it"
        if ratio > 1 + 1e-6:
            beyond = f"where allowances say so, up to {ratio:.3g} times the fitted limit"
        beyond = f" as allowed; {beyond}"
    return (
        f"fastest change {percent(summary.max_rate_ratio)} of the rate limit {summary.rate_limit!r}{asked}"
        f"{accepted}{beyond}"
    )


def _sentences(lines: tuple[str, ...]) -> str:
    return " ".join(f"{sentence(line)}." for line in lines if line)
