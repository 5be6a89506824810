"""Conditions of the ramp experiment: which way the luminance goes, and for how long.

A limit on the rate alone would give ramps of every duration the same threshold rate; a limit on the amount,
as some studies find (Knau 2000, J. Opt. Soc. Am. A 17, 1382: about the same total change for shallow and
steep gradients), would halve it where the duration doubles. So the rate limit holds for one condition, the
reference, and the others are reported as ratios to it (docs/decisions/ramp-conditions.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.analysis.calibration.rate_limit_curve import RateLimitOptions
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.ramp import Direction
from evenlight.data_schema.threshold import Threshold

LEAST_PARTICIPANTS = 3  # to tell how the effect differs between them


@dataclass(frozen=True, slots=True)
class Condition:
    """A direction and a duration of ramps [s]."""

    direction: Direction
    ramp_duration: float

    @property
    def words(self) -> str:
        """What it is, for a sentence.

        >>> Condition(Direction.DOWN, 5.0).words
        'falling ramps of 5 s'
        """
        way = "falling" if self.direction is Direction.DOWN else "rising"
        return f"{way} ramps of {self.ramp_duration:g} s"


@dataclass(frozen=True, slots=True)
class ConditionEffect:
    """The thresholds of a condition as a multiple of the reference's.

    Attributes
    ----------
    condition, reference : Condition
        Which are compared.
    ratio : float
        Of the threshold rates.
    ci_low, ci_high : float
        95 % interval.
    """

    condition: Condition
    reference: Condition
    ratio: float
    ci_low: float
    ci_high: float

    @property
    def ratio_of_equal_amounts(self) -> float:
        """The ratio that the same total change at threshold would give."""
        return self.reference.ramp_duration / self.condition.ramp_duration

    @property
    def in_words(self) -> str:
        """What was found, as a sentence."""
        words = (
            f"{self.condition.words} have {self.ratio:.2f} x the threshold rate of {self.reference.words} "
            f"({self.ci_low:.2f} to {self.ci_high:.2f})"
        )
        if self.condition.ramp_duration != self.reference.ramp_duration:
            words += (
                f"; 1.00 would be a limit on the rate, {self.ratio_of_equal_amounts:.2f} one on the amount "
                "of change"
            )
        return words


def condition_of(threshold: Threshold) -> Condition:
    """Return the condition of a threshold."""
    return Condition(threshold.direction, threshold.ramp_duration)


def conditions_of(thresholds: Iterable[Threshold]) -> tuple[Condition, ...]:
    """Return the conditions of some thresholds: falling before rising, short before long."""
    found = {condition_of(threshold) for threshold in thresholds}
    return tuple(sorted(found, key=lambda c: (c.direction is not Direction.DOWN, c.ramp_duration)))


def allowed_references(conditions: Sequence[Condition], options: RateLimitOptions) -> tuple[Condition, ...]:
    """Return the conditions that a rate limit may be for: all, or those that the options name.

    Raises
    ------
    InputError
        If there is none.
    """
    allowed = tuple(
        condition
        for condition in conditions
        if options.direction in (None, condition.direction)
        and options.ramp_duration in (None, condition.ramp_duration)
    )
    if conditions and not allowed:
        there = ", ".join(condition.words for condition in conditions)
        wanted = [options.direction.value] if options.direction else []
        wanted += [f"{options.ramp_duration:g} s"] if options.ramp_duration else []
        raise InputError(f"no usable threshold of ramps {' over '.join(wanted)}; there are {there}")
    return allowed


def indicators(thresholds: Sequence[Threshold], others: Sequence[Condition]) -> Array:
    """Return a column of 0 and 1 for each condition other than the reference, shape (n, k)."""
    own = [condition_of(threshold) for threshold in thresholds]
    return np.array([[float(c == other) for other in others] for c in own]).reshape(len(own), len(others))


def effect_of(
    pair: tuple[Condition, Condition],
    ln_ratio: float,
    model_error: float,
    residuals: Array,
    thresholds: Sequence[Threshold],
) -> ConditionEffect:
    """Return the effect of a condition with its interval (Student's t, participants as the sample).

    The model's standard error takes the ratio for the same in everybody. Where three participants or more saw
    both conditions, the scatter of their own ratios gives another, and the larger one is stated.

    Parameters
    ----------
    pair : (Condition, Condition)
        The condition and the reference.
    ln_ratio, model_error : float
        Coefficient of the mixed model and its standard error.
    residuals : array (n,)
        ln(threshold) minus the curve of the reference.
    thresholds : sequence of Threshold
        What was fitted.
    """
    condition, reference = pair
    own: dict[str, dict[Condition, list[float]]] = {}
    for value, threshold in zip(residuals.tolist(), thresholds, strict=True):
        own.setdefault(threshold.participant_id, {}).setdefault(condition_of(threshold), []).append(value)
    differences = [
        float(np.mean(seen[condition]) - np.mean(seen[reference]))
        for seen in own.values()
        if condition in seen and reference in seen
    ]
    error, df = model_error, max(len(differences) - 1, 1)
    if len(differences) >= LEAST_PARTICIPANTS:
        error = max(error, float(np.std(differences, ddof=1)) / len(differences) ** 0.5)
    half = float(special.stdtrit(df, 0.975)) * error
    low, middle, high = np.exp(np.clip([ln_ratio - half, ln_ratio, ln_ratio + half], -50, 50)).tolist()
    return ConditionEffect(condition, reference, middle, low, high)
