"""What a likelihood model with a participant effect found of one effect, and what was wrong with its data."""

from __future__ import annotations

import enum
from dataclasses import dataclass


class FitFlag(enum.Enum):
    """What a reader of a fit must know; the value says it in words."""

    NONE = ""
    NO_VARIATION = "all answers are the same: nothing can be estimated"
    NOTHING_OBSERVED = "nothing was ever found: nothing can be estimated"
    NO_SCATTER = "the times leave no scatter to judge by: nothing can be estimated"
    SEPARATED = "an effect runs to infinity: the data separate perfectly"
    APART = "participants hardly vary within themselves: their standard deviation runs to infinity"
    NOT_ESTIMABLE = "an effect cannot be told apart from the others"
    ONE_PARTICIPANT = "one participant: no participant effect, nothing said of other people"
    UNUSED_CATEGORIES = "categories that nobody used were left out"
    NOT_CONVERGED = "the search for the largest likelihood did not converge"


@dataclass(frozen=True, slots=True)
class FixedEffect:
    """One effect of a likelihood model.

    Attributes
    ----------
    name : str
        Of its column.
    estimate : float or None
        Maximum of the likelihood, in the unit of the linear predictor; None where the data do not give it.
    standard_error : float or None
        From the curvature of the likelihood; None where there is none.
    ci_low, ci_high : float or None
        95 % interval of the profile likelihood with small-sample correction; None for an end without bound,
        or unknown (`flag` says so).
    p_value : float or None
        Of the likelihood-ratio test against 0, with the same correction.
    df : float or None
        Degrees of freedom of that correction.
    flag : str
        Why it should be looked at, or is missing; empty for nothing.
    """

    name: str
    estimate: float | None
    standard_error: float | None
    ci_low: float | None
    ci_high: float | None
    p_value: float | None
    df: float | None = None
    flag: str = ""


def unknown_effect(name: str, flag: FitFlag) -> FixedEffect:
    """Return an effect without numbers, and why.

    >>> unknown_effect("version", FitFlag.NO_VARIATION).flag
    'all answers are the same: nothing can be estimated'
    """
    return FixedEffect(name, None, None, None, None, None, flag=flag.value)
