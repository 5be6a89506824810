"""Numbers of the ratings' results as cells of a table."""

from __future__ import annotations

from evenlight.analysis.inference.exact_paired_tests import ExactTest
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.analysis.report import Cell


def number_cell(value: float | None) -> str | None:
    """Return a number with two decimals, for a cell."""
    return None if value is None else f"{round(value, 2) + 0.0:.2f}"  # no "-0.00"


def two_digits(value: float | None) -> str | None:
    """Return a number with two significant digits, for what is known to some percent only.

    >>> two_digits(0.4297), two_digits(1.203), two_digits(0.0)
    ('0.43', '1.2', '0')
    """
    return None if value is None else f"{value:.2g}"


def interval_cell(effect: Effect) -> str | None:
    """Return an interval for a cell; one with a single end in words.

    >>> interval_cell(Effect(0.5, 0.25, 0.75)), interval_cell(Effect(0.5, 0.25, None))
    ('0.25 to 0.75', 'above 0.25')
    """
    low, high = effect.ci_low, effect.ci_high
    if low is None:
        return None if high is None else f"below {high:.2f}"
    return f"above {low:.2f}" if high is None else f"{low:.2f} to {high:.2f}"


def effect_cells(effect: Effect) -> tuple[Cell, Cell]:
    """Return an effect and its interval as two cells."""
    return number_cell(effect.value), interval_cell(effect)


def p_of(test: ExactTest | None) -> float | None:
    """Return the p value of a test, if there is one."""
    return None if test is None else test.p_value
