"""What of a mixed model may be shown: a fit whose participant effect ran to its bound has no numbers.

Where everybody always gives the same answer the likelihood rises with the participants' standard deviation
without end. What the search then leaves at its bound is made by that bound, not by the data.
"""

from __future__ import annotations

from evenlight.analysis.inference.cumulative_link import OrdinalFit
from evenlight.analysis.inference.fixed_effects import FitFlag, FixedEffect

WITHOUT_NUMBERS = (FitFlag.NO_VARIATION, FitFlag.APART, FitFlag.NOT_CONVERGED)
NO_RATIO = (*WITHOUT_NUMBERS, FitFlag.SEPARATED)  # nor has the likelihood a maximum to be compared


def cause(fit: OrdinalFit) -> str:
    """Return why a fit has no numbers; empty if it has."""
    return _said(fit, WITHOUT_NUMBERS)


def no_ratio(fit: OrdinalFit) -> str:
    """Return why the likelihood of a fit cannot be tested against another's; empty if it can."""
    return _said(fit, NO_RATIO)


def _said(fit: OrdinalFit, flags: tuple[FitFlag, ...]) -> str:
    return "; ".join(flag.value for flag in fit.flags if flag in flags)


def shown_effect(fit: OrdinalFit, effect: FixedEffect) -> FixedEffect:
    """Return an effect of a fit as it may be shown: without numbers where the fit has none.

    Parameters
    ----------
    fit : OrdinalFit
        The model.
    effect : FixedEffect
        One of its effects.
    """
    why = cause(fit)
    if not why:
        return effect
    return FixedEffect(effect.name, None, None, None, None, None, flag=why)


def shown_spread(fit: OrdinalFit, spread: float | None) -> tuple[float | None, str]:
    """Return a standard deviation between participants and its flag: the reason if there is none.

    Parameters
    ----------
    fit : OrdinalFit
        The model.
    spread : float or None
        Its standard deviation of the level, or of the slope.
    """
    alone = FitFlag.ONE_PARTICIPANT.value if FitFlag.ONE_PARTICIPANT in fit.flags else ""
    why = cause(fit) or alone
    if not why and spread is None:
        why = FitFlag.NOT_ESTIMABLE.value
    return (None, why) if why else (spread, "")
