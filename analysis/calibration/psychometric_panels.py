"""How the figure of psychometric functions is laid out: which panels, in which rows, on which scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.calibration.goodness_of_fit import LEAST_IN_BIN, bin_starts
from evenlight.analysis.calibration.ramp_counts import RampLevelKey, level_of_threshold, level_order
from evenlight.analysis.calibration.thresholds import ThresholdFit
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.ramp import Procedure
from evenlight.method.psychometric import THRESHOLD_PROBABILITY

BETWEEN_ROWS = 6.8  # numbers of the axis, and the next row's titles [em]
LEAST_IN_DOT = 12  # trials of neighbouring rates that are drawn as one dot


def by_level(fits: Sequence[ThresholdFit]) -> dict[RampLevelKey, list[ThresholdFit]]:
    """Return the fits of each level, lowest threshold first."""
    levels: dict[RampLevelKey, list[ThresholdFit]] = {}
    for fit in sorted(fits, key=lambda fit: fit.threshold.threshold):
        levels.setdefault(level_of_threshold(fit.threshold), []).append(fit)
    return levels


@dataclass(frozen=True, slots=True)
class PanelGrid:
    """Where the panels are [inch]."""

    em: float
    left: float
    top: float
    cell_width: float
    panel_height: float
    strip_height: float

    @property
    def row_height(self) -> float:
        """Height of a row: panel, strip, title and numbers of the axis."""
        return self.panel_height + self.strip_height + BETWEEN_ROWS * self.em


@dataclass(frozen=True, slots=True)
class PanelScale:
    """What all panels share.

    Attributes
    ----------
    low, high : float
        Slowest and fastest relative rate tested [%/s].
    lowest_share : float
        Where the axis of answers begins.
    two : bool
        Whether of two intervals the right one was to be found.
    zero : bool
        Whether there are catch trials, drawn at the left end of the axis.
    several : bool
        Whether there are several directions or durations.
    """

    low: float
    high: float
    lowest_share: float
    two: bool
    zero: bool
    several: bool

    @property
    def zero_at(self) -> float:
        """Where on the logarithmic axis "no change" is put [%/s]."""
        return self.low / 2

    @property
    def left(self) -> float:
        """Left end of the axis [%/s]."""
        return self.zero_at / 1.25 if self.zero else self.low / 1.4


def scale_of(fits: Sequence[ThresholdFit]) -> PanelScale:
    """Return what all panels share."""
    rates = [100 * fit.fit.counts.rates / fit.threshold.luminance for fit in fits]
    two = fits[0].threshold.procedure is Procedure.TWO_INTERVAL
    levels = by_level(fits)
    shares = [drawn_answers(group) for group in levels.values()]
    lowest = min(float((yes / trials).min()) for _, yes, trials in shares)
    return PanelScale(
        low=float(min(r.min() for r in rates)),
        high=float(max(r.max() for r in rates)),
        lowest_share=min(0.5, lowest) if two else 0.0,
        two=two,
        zero=any(fit.fit.counts.catch_trials for fit in fits),
        several=len({(level.direction, level.ramp_duration) for level in levels}) > 1,
    )


def panel_rows(levels: list[RampLevelKey], columns: int) -> list[list[RampLevelKey]]:
    """Return the levels in rows: a new row for each screen and condition, brighter levels to the right."""
    blocks: dict[tuple[object, ...], list[RampLevelKey]] = {}
    for level in sorted(levels, key=level_order):  # white, then gray
        blocks.setdefault((level.screen, level.direction, level.ramp_duration), []).append(level)
    rows: list[list[RampLevelKey]] = []
    for block in blocks.values():
        own = sorted(block, key=lambda level: level.luminance)
        rows += [own[k : k + columns] for k in range(0, len(own), columns)]
    return rows


def heading_of(fits: Sequence[ThresholdFit], simulated: bool) -> tuple[str, str]:
    """Return title and subtitle."""
    people = len({fit.threshold.participant_id for fit in fits})
    trials = sum(fit.threshold.n_trials for fit in fits)
    catches = sum({fit.threshold.participant_id: fit.threshold.n_catch for fit in fits}.values())
    who = ("simulated " if simulated else "") + ("participant" if people == 1 else "participants")
    two = fits[0].threshold.procedure is Procedure.TWO_INTERVAL
    ramps = f"{trials} ramps" if two else f"{trials} ramps and {catches} catch trials"
    several = len({(fit.threshold.direction, fit.threshold.ramp_duration) for fit in fits}) > 1
    arrows = ", direction and duration" if several else ""
    verb = "found" if two else "seen"
    return (
        "How often the interval with a change of luminance is found"
        if two
        else "How often a change of luminance is seen",
        f"{people} {who}, {ramps}. Above each panel: screen and brightness factor, initial "
        f"luminance{arrows}, and the rate {verb} in {100 * THRESHOLD_PROBABILITY:.0f} % of the "
        "trials (geometric mean of participants).",
    )


def pooled_answers(fits: Sequence[ThresholdFit]) -> tuple[Array, Array, Array]:
    """Return relative rates [%/s], successes and trials, summed over the participants of a level."""
    rates = np.concatenate([100 * fit.fit.counts.rates / fit.threshold.luminance for fit in fits])
    distinct, index = np.unique(np.round(rates, 9), return_inverse=True)
    yes = np.concatenate([fit.fit.counts.n_yes for fit in fits]).astype(np.float64)
    trials = np.concatenate([fit.fit.counts.n_trials for fit in fits]).astype(np.float64)
    return distinct, _summed(index, yes), _summed(index, trials)


def drawn_answers(fits: Sequence[ThresholdFit]) -> tuple[Array, Array, Array]:
    """Return the pooled answers as they are drawn: where single rates have few trials, put together.

    Adaptive placement asks many rates a few times; shares of two or three answers would be dots at 0, 50 and
    100 %. A group lies at the mean ln(rate) of its trials.
    """
    rates, yes, trials = pooled_answers(fits)
    if trials.min() >= LEAST_IN_BIN:
        return rates, yes, trials
    starts = bin_starts(trials.astype(np.int64), LEAST_IN_DOT)
    total = np.add.reduceat(trials, starts)
    middle = np.exp(np.add.reduceat(trials * np.log(rates), starts) / total)
    return middle, np.add.reduceat(yes, starts), total


def _summed(index: NDArray[np.intp], values: Array) -> Array:
    """Return the sum of the values of each index."""
    return np.asarray(np.bincount(index, values), dtype=np.float64)
