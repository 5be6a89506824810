"""Sections of a video that count more or less, or in which brightness may change faster or not at all."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.quantities import as_in, check_limits, quantity

LARGEST_WEIGHT = (
    1e6  # weights or multiples of the rate limit: beyond, a section means "no other" or "no limit"
)


@dataclass(frozen=True, slots=True)
class WeightSection:
    """How much the frames of a section count in the objective; a row of `*.weights.csv`."""

    start: float = quantity(
        "s", "where the section begins; a frame that appears then belongs to it", minimum=0.0, key="start_s"
    )
    end: float = quantity("s", "where it ends; a frame that appears then is outside", above=0.0, key="end_s")
    weight: float = quantity(
        "1",
        "how much each of its frames counts; frames outside all sections have 1",
        minimum=0.0,
        maximum=LARGEST_WEIGHT,
    )

    def __post_init__(self) -> None:
        check_limits(self)
        _require_length(self.start, self.end)


@dataclass(frozen=True, slots=True)
class AllowanceSection:
    """How many times the fitted rate limit a section allows. A row of `*.allowances.csv`."""

    start: float = quantity(
        "s",
        "where the section begins; the step to a frame that appears then belongs to it",
        minimum=0.0,
        key="start_s",
    )
    end: float = as_in(WeightSection, "end")
    allowance: float = quantity(
        "1",
        "multiple of the rate limit: 0 holds brightness still, 1 allows what was fitted",
        minimum=0.0,
        maximum=LARGEST_WEIGHT,
    )

    def __post_init__(self) -> None:
        check_limits(self)
        _require_length(self.start, self.end)


def _require_length(start: float, end: float) -> None:
    """Raise `ValueError` if a section does not end after it begins."""
    if not start < end:
        raise ValueError(f"need start_s < end_s, got {start:g} and {end:g}")
