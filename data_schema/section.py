"""Sections of a video that count more or less, or in which brightness may change faster or not at all."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.quantities import check_limits, quantity

MOST = 1e6  # weights or multiples of the rate limit: beyond, a section means "no other" or "no limit"


@dataclass(frozen=True, slots=True)
class WeightSection:
    """How much the frames of a section count in the objective. A row of `*.weights.csv`.

    Attributes
    ----------
    start, end : float
        From when and until when; a frame belongs to it that appears from `start` on and before `end` [s].
    weight : float
        Of each of its frames; frames outside all sections have 1.
    """

    start: float = quantity("s", "where the section begins", minimum=0.0, key="start_s")
    end: float = quantity("s", "where it ends; a frame that appears then is outside", above=0.0, key="end_s")
    weight: float = quantity("1", "how much each of its frames counts; others 1", minimum=0.0, maximum=MOST)

    def __post_init__(self) -> None:
        check_limits(self)
        _require_length(self.start, self.end)


@dataclass(frozen=True, slots=True)
class AllowanceSection:
    """How many times the fitted rate limit a section allows. A row of `*.allowances.csv`.

    Attributes
    ----------
    start, end : float
        From when and until when; the step to a frame belongs to it that appears from `start` on and before
        `end` [s].
    allowance : float
        0 holds brightness still, 1 allows what was fitted, more allows more.
    """

    start: float = quantity("s", "where the section begins", minimum=0.0, key="start_s")
    end: float = quantity("s", "where it ends; a frame that appears then is outside", above=0.0, key="end_s")
    allowance: float = quantity(
        "1", "multiple of the rate limit: 0 holds still, 1 as fitted", minimum=0.0, maximum=MOST
    )

    def __post_init__(self) -> None:
        check_limits(self)
        _require_length(self.start, self.end)


def _require_length(start: float, end: float) -> None:
    """Raise `ValueError` if a section does not end after it begins."""
    if not start < end:
        raise ValueError(f"need start_s < end_s, got {start:g} and {end:g}")
