"""What an optimization minimized and how far, in words; and whether there was much to gain.

From which numbers on there is little to gain is a convention: docs/decisions/little-to-gain.md.
"""

from __future__ import annotations

from evenlight.analysis.wording import percent
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary

LITTLE_SPREAD = 0.005  # mean difference of contrast loss between two frames, of either track
UNEVEN = 2.0  # times the mean loss: from here on the worst frame does not lose nearly the same
LITTLE_WORST = 0.01  # by which the largest loss of any frame is smaller than under constant dimming


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
        bound = summary.lower_bound
        return f"no track lets two frames differ by less than {bound:.4g}" if bound > 0 else "not certified"
    words += f"{summary.objective_baseline:.4g} at constant dimming"
    shares = [f"{m.name} {percent(m.value / m.baseline)}" for m in summary.by_measure if m.baseline > 0]
    if not shares:
        return words
    return f"by {summary.contrast_model}, {words}; of constant dimming's: {', '.join(shares)}"


def _compared(value: float, constant: float, bound: float) -> str:
    """Return how a value compares to constant dimming's, and what none goes below."""
    certified = f"no track does better than {bound:.4g}" if bound > 0 else "not certified"
    less = less_or_more(1 - value / constant if constant > 0 else 0.0, 1)
    return f"{constant:.4g} at constant dimming ({less}; {certified})"


def less_or_more(gain: float, decimals: int = 0) -> str:
    """Return how much less a track has than constant dimming, or more where the gain is negative.

    >>> less_or_more(0.214), less_or_more(-0.3991, 1)
    ('21 % less', '39.9 % more')
    """
    return f"{100 * abs(gain):.{decimals}f} % {'more' if gain < 0 else 'less'}"


def little_of(summary: OptimizationSummary) -> str:
    """Return that there was little to gain in a video, if so; nothing where losses were minimized."""
    if summary.minimized is not None:
        return ""
    worst, constant = summary.worst_contrast_loss or 0.0, summary.worst_contrast_loss_baseline or 0.0
    worst_and_mean = constant, summary.mean_contrast_loss_baseline
    return little_to_gain(summary.objective, summary.objective_baseline, constant - worst, *worst_and_mean)


def little_to_gain(
    ours: float, constant: float, saved_at_worst: float = 0.0, worst: float = 0.0, mean: float = 0.0
) -> str:
    """Return that there is little to gain, if so; else nothing.

    Parameters
    ----------
    ours, constant : float
        Mean difference of contrast loss between two frames: of the track, of constant dimming.
    saved_at_worst : float
        How much less the track loses in its worst frame than constant dimming in its own.
    worst, mean : float
        Contrast loss of constant dimming, in its worst frame and on average.

    >>> little_to_gain(0.00055, 0.00066)
    'little to gain here: constant dimming already loses nearly the same in every frame'
    >>> little_to_gain(0.00088, 0.0029, 0.009, worst=0.013, mean=0.0025)
    'little to gain here: constant dimming already loses little (worst frame 1.3 %)'
    >>> little_to_gain(0.0012, 0.0049, 0.02), little_to_gain(0.009, 0.0147), little_to_gain(0.02, 0.002)
    ('', '', '')
    """
    if max(ours, constant) >= LITTLE_SPREAD or saved_at_worst >= LITTLE_WORST:
        return ""
    if worst > UNEVEN * mean:
        return f"little to gain here: constant dimming already loses little (worst frame {percent(worst)})"
    return "little to gain here: constant dimming already loses nearly the same in every frame"
