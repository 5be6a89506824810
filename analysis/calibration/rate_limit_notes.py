"""What is to be said about a fitted rate limit: its shape, whose it is, and what was left out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.calibration.conditions import Condition, ConditionEffect
from evenlight.analysis.calibration.rate_limit_curve import CurveBasis, falling_stretches
from evenlight.analysis.inference.mixed_model import GroupedEstimates
from evenlight.data_schema.rate_limit import RateLimitForm
from evenlight.data_schema.threshold import Threshold, ThresholdFlag

UNUSABLE = (ThresholdFlag.ALL_YES, ThresholdFlag.ALL_NO, ThresholdFlag.FALSE_ALARMS)


def shape_notes(basis: CurveBasis, coefficients: NDArray[np.float64], residual_df: int) -> tuple[str, ...]:
    """Return what is to be said about the curve's shape."""
    notes = []
    if residual_df <= 0:
        notes.append(
            f"Degree {basis.degree} has as many coefficients as there are luminances: the curve can meet "
            "every level, and the data cannot tell whether its shape is right."
        )
    for low, high in falling_stretches(basis, coefficients):
        notes.append(
            f"The limit falls with luminance from {low:.4g} to {high:.4g} cd/m^2, within the measured range."
        )
    luminance = np.linspace(*basis.luminance_range, 201)
    if basis.form is RateLimitForm.RATE and (basis.design(luminance) @ coefficients <= 0).any():
        notes.append("The polynomial of the rate falls to 0 or below within the measured range.")
    return tuple(notes)


def participant_notes(data: GroupedEstimates) -> tuple[str, ...]:
    """Return what is to be said about a fit to one participant."""
    if data.n_groups > 1:
        return ()
    return ("One participant: the band is this participant's, and says nothing about others.",)


def exclusion_notes(excluded: Sequence[Threshold], total: int) -> tuple[str, ...]:
    """Return how many thresholds were left out, and which way that draws the curve."""
    if not excluded:
        return ()
    counts = {flag: sum(t.flag is flag for t in excluded) for flag in UNUSABLE}
    words = f"{len(excluded)} of {total} thresholds are left out ({listed(excluded, UNUSABLE)})."
    if counts[ThresholdFlag.ALL_YES]:
        words += (
            " All_yes lie below the slowest rate tested: without them the limit is too high, on the unsafe "
            "side; test slower rates."
        )
    if counts[ThresholdFlag.ALL_NO]:
        words += " All_no lie above the fastest one: without them the limit is too low, on the safe side."
    return (words,)


def listed(thresholds: Sequence[Threshold], flags: Sequence[ThresholdFlag]) -> str:
    """Return how many thresholds carry each of some flags, as "3 all_yes, 1 all_no"."""
    counts = ((sum(t.flag is flag for t in thresholds), flag.value) for flag in flags)
    return ", ".join(f"{count} {name}" for count, name in counts if count)


def condition_notes(
    reference: Condition, effects: Sequence[ConditionEffect], chosen: bool
) -> tuple[str, ...]:
    """Return whose ramps the limit holds for, and how the others differ; nothing for one condition."""
    if not effects:
        return ()
    why = "as was asked for" if chosen else "whose thresholds are the lowest: the safe choice"
    return (
        f"The limit is that of {reference.words}, {why}.",
        *(f"{effect.in_words[0].upper()}{effect.in_words[1:]}." for effect in effects),
    )
