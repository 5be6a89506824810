"""What an optimization minimized, in words."""

from __future__ import annotations

from evenlight.analysis.wording import percent
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary


def minimized_in_words(summary: OptimizationSummary) -> str:
    """Return a clause on what was minimized and how far; empty where it is the spread."""
    found = summary.minimized
    if found is None:
        return ""
    if summary.by_measure:
        return (
            f"the {found.name} was minimized: {percent(found.value)} of constant dimming's (no track below "
            f"{percent(found.bound)})"
        )
    what = "the largest contrast loss of any frame"
    if summary.level_weight is not None:
        what = f"the difference between two frames plus {summary.level_weight:g} times the mean contrast loss"
    return f"minimized was {what}: {found.value:.4g}, {_compared(found.value, found.baseline, found.bound)}"


def spread_in_words(summary: OptimizationSummary) -> str:
    """Return how much contrast loss differs between frames; by each measure, where several counted."""
    words = f"contrast loss differs by {summary.objective:.4g} between two frames, "
    if summary.minimized is None:
        return words + _compared(summary.objective, summary.objective_baseline, summary.lower_bound)
    words += f"{summary.objective_baseline:.4g} at constant dimming"
    shares = [f"{m.name} {percent(m.value / m.baseline)}" for m in summary.by_measure if m.baseline > 0]
    if not shares:
        return words
    return f"by {summary.contrast_model}, {words}; of constant dimming's: {', '.join(shares)}"


def _compared(value: float, constant: float, bound: float) -> str:
    """Return how a value compares to that of constant dimming, and what no track goes below."""
    less = less_or_more(1 - value / constant if constant > 0 else 0.0, 1)
    certified = f"no track does better than {bound:.4g}" if bound > 0 else "not certified"
    return f"{constant:.4g} at constant dimming ({less}; {certified})"


def less_or_more(gain: float, decimals: int = 0) -> str:
    """Return how much less a track has than constant dimming, or more where the gain is negative.

    >>> less_or_more(0.214), less_or_more(-0.3991, 1)
    ('21 % less', '39.9 % more')
    """
    return f"{100 * abs(gain):.{decimals}f} % {'more' if gain < 0 else 'less'}"
