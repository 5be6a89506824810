"""Thresholds in the midst of a session, with intervals: what adaptive placement believes, for every design.

The beliefs are those of `AdaptivePlacement`, on its grid; that of `evenlight fit` is finer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.recordings.ramp import Direction, Placement, Procedure, RampDesign, RampTrial
from evenlight.experiments.ramp.adaptive_placement import AdaptivePlacement, placement_grid, success_chances

INTERVAL = (0.025, 0.975)
LEAST_RATIO = 4.0  # of the highest to the lowest rate of the grid, for designs of one rate

Level = tuple[str, float, Direction, float]  # screen, factor, direction, duration [s]


@dataclass(frozen=True, slots=True)
class LevelSoFar:
    """A level's threshold so far."""

    level: Level
    luminance: float  # before the ramp [cd/m^2]
    # posterior mean of ln(threshold) and 95 % credible interval, as rates [cd/m^2/s]
    threshold: float
    ci_low: float
    ci_high: float
    # usable ramps, and those that were seen: "yes", or the right interval
    n_ramps: int
    n_seen: int
    latest: bool  # whether the last ramp was one of this level


class ThresholdsSoFar:
    """The thresholds of a session at each level.

    Parameters
    ----------
    design : RampDesign
        Of the session.
    """

    def __init__(self, design: RampDesign) -> None:
        ratio = max(max(design.relative_rates) / min(design.relative_rates), LEAST_RATIO)
        self._design = design
        self._grid = placement_grid(ratio, design.procedure is Procedure.TWO_INTERVAL)
        self._beliefs = AdaptivePlacement(Placement.TARGETED, self._grid)
        self._ramps: dict[Level, list[RampTrial]] = {}
        self._latest: Level | None = None

    def take(self, trial: RampTrial) -> None:
        """Learn from an answer; practice and flagged trials are passed over."""
        if not trial.usable:
            return
        if trial.is_catch:
            self._beliefs.take_catch(trial.success)
            return
        level = self._latest = trial.screen, trial.factor, trial.direction, trial.duration
        self._ramps.setdefault(level, []).append(trial)
        place = np.log([trial.rate / self._lowest(level, trial.initial_luminance)])
        chances = success_chances(place, self._grid.thresholds, self._grid.guess_rates)[0]
        self._beliefs.learn(level, chances, trial.success)

    def levels(self) -> list[LevelSoFar]:
        """Return the levels that had ramps, in the order of screens, factors, directions and durations."""
        return [self._so_far(level, ramps) for level, ramps in sorted(self._ramps.items(), key=_place)]

    def _so_far(self, level: Level, ramps: list[RampTrial]) -> LevelSoFar:
        """Return what is known of a level."""
        grid, luminance = self._grid, ramps[-1].initial_luminance
        masses = self._beliefs.posterior(level).sum(axis=(1, 2, 3))
        edges = np.append(grid.thresholds - grid.step / 2, grid.thresholds[-1] + grid.step / 2)
        ends = np.interp(INTERVAL, np.append(0.0, np.cumsum(masses)), edges)
        middle, low, high = self._lowest(level, luminance) * np.exp([grid.thresholds @ masses, *ends])
        return LevelSoFar(
            level,
            luminance,
            threshold=float(middle),
            ci_low=float(low),
            ci_high=float(high),
            n_ramps=len(ramps),
            n_seen=sum(trial.success for trial in ramps),
            latest=level == self._latest,
        )

    def _lowest(self, level: Level, luminance: float) -> float:
        """Return the rate of the grid's first candidate at a level [cd/m^2/s]."""
        return min(self._design.rates_of(level[3])) * luminance


def _place(item: tuple[Level, list[RampTrial]]) -> tuple[object, ...]:
    """Return what levels are sorted by: direction and duration, white before gray, bright before dark."""
    screen, factor, direction, duration = item[0]
    return direction.value, duration, screen != "white", -factor
