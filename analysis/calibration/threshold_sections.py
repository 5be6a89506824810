"""The sections of the report on thresholds: the population's at each level, and every one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.conditions import condition_of, conditions_of
from evenlight.analysis.calibration.level_estimates import LevelEstimates, difference_in_words, mean_ratios
from evenlight.analysis.report import Cell, Section, Table, probability
from evenlight.data_schema.ramp import Procedure


def population_section(levels: Sequence[LevelEstimates], simulated: bool) -> Section:
    """Return the three estimates of the population's threshold at each level, and why they differ.

    Parameters
    ----------
    levels : sequence of LevelEstimates
        Of all levels.
    simulated : bool
        Whether the participants were simulated.
    """
    several = len({(level.level.direction, level.level.ramp_duration) for level in levels}) > 1
    rows: list[tuple[Cell, ...]] = []
    by_luminance = sorted(levels, key=lambda e: (_order_of_ramps(e), e.level.luminance))
    for estimates in by_luminance:
        level, random = estimates.level, estimates.random
        interval = None if random is None else f"{random.ci_low:.3g} to {random.ci_high:.3g}"
        spread = None if random is None else f"{np.exp(random.participant_sd):.2f}"
        row = (
            level.screen,
            level.factor,
            level.luminance,
            None if random is None else random.threshold,
            interval,
            spread,
            estimates.pooled,
            _ratio(estimates.pooled_ratio),
            estimates.mean_of_fits,
            _ratio(estimates.mean_ratio),
        )
        rows.append((f"{level.direction.value}, {level.ramp_duration:g}\u00a0s", *row) if several else row)
    columns = ("screen", "factor b", "luminance [cd/m²]", "population", "95 % interval", "people differ ×",
               "pooled", "ratio", "mean of fits", "ratio")  # fmt: skip
    table = Table(
        "Threshold of the population [cd/m²/s]: everybody's answers with a threshold for each participant; "
        "all answers pooled; geometric mean of the individual fits. Ratios are to the first. “People "
        "differ”: two of three lie within this factor of the median.",
        ("ramps", *columns) if several else columns,
        tuple(rows),
    )
    text = (
        "There are three ways from many participants to one threshold. Pooled answers look as if one person "
        f"had given them. {_what_pooling_does(levels)} The mean of individual fits does without that, but "
        "counts a threshold known badly as much as one known well, and leaves out who answered all alike. "
        "The first estimate gives each participant a threshold of their own and averages over where it may "
        "lie.",
    )
    words = difference_in_words(levels)
    found = (words[0].upper() + words[1:] + ".",) if words else ()
    return Section("The population's threshold", text + found, (table,), (), (), simulated)


def _what_pooling_does(levels: Sequence[LevelEstimates]) -> str:
    """Return what flattening does to a 75 % point: nothing in the middle of the rise, else it moves it up."""
    flatter = "People differ, so that the pooled function is flatter than anybody's own"
    if any(estimates.level.procedure is Procedure.TWO_INTERVAL for estimates in levels):
        return f"{flatter}; its 75 % point, of two intervals the middle of its rise, hardly moves for it."
    pooled = mean_ratios(levels)[0]
    if pooled is not None and pooled < 1:
        return (
            f"{flatter}, which alone would move its 75 % point above the median participant's; here it lies "
            "below."
        )
    return f"{flatter}, which moves its 75 % point above the median participant's."


def _order_of_ramps(estimates: LevelEstimates) -> tuple[str, float]:
    """Return what sorts levels by direction and duration: falling first, short first."""
    return estimates.level.direction.value, estimates.level.ramp_duration


def _ratio(value: float | None) -> str | None:
    """Return a ratio with two decimals."""
    return None if value is None else f"{value:.2f}"


def thresholds_section(calibration: Calibration) -> Section:
    """Return every threshold with what there is to know about it."""
    thresholds = [fit.threshold for fit in calibration.thresholds]
    several = len(conditions_of(thresholds)) > 1
    rows: list[tuple[Cell, ...]] = []
    for t in thresholds:
        row = (
            t.participant_id,
            t.screen,
            t.factor,
            t.luminance,
            t.threshold,
            f"{t.ci_low:.3g} to {t.ci_high:.3g}",
            t.threshold_d_prime_1,
            t.n_trials,
            None if t.deviance is None else f"{t.deviance:.1f}",
            None if t.deviance_p is None else probability(t.deviance_p),
            t.flag.value.replace("_", " ") or "–",
        )
        rows.append((*row[:1], condition_of(t).words, *row[1:]) if several else row)
    columns = ("participant", "screen", "b", "L [cd/m²]", "threshold [cd/m²/s]", "95 % interval", "at d′ = 1",
               "ramps", "deviance", "p", "flag")  # fmt: skip
    text = (
        "All that was fitted, as in thresholds.csv; false alarms, criterion and d′ belong to the participant "
        "and stand above. The rate at d′ = 1 does not depend on how readily somebody says “yes”, and so "
        "compares tasks and people. The deviance is that of the answers from the fitted function, p the "
        "share of simulated answers of that function with at least this deviance: of a hundred good fits, "
        "one has p below 0.01.",
    )
    return Section(
        "Every threshold",
        text,
        (
            Table(
                f"{len(thresholds)} thresholds.",
                columns if not several else (columns[0], "of", *columns[1:]),
                tuple(rows),
            ),
        ),
        (),
        (),
        calibration.data.simulated,
    )
