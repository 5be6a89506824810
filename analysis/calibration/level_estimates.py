"""The population's threshold at each level, estimated in three ways that should not be confused.

Everybody's answers with a random threshold (the estimate to be believed), all answers pooled as if one person
had given them (the paper's way, if "the answers" means that), and the geometric mean of the thresholds fitted
to each participant (docs/decisions/pooling.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.calibration.pooled_fit import logistic_threshold
from evenlight.analysis.calibration.posterior_grid import RampCounts
from evenlight.analysis.calibration.ramp_counts import RampLevelKey, level_of_threshold, level_order
from evenlight.analysis.calibration.random_threshold import RandomThresholdFit, fit_random_threshold
from evenlight.analysis.calibration.rate_limit_notes import UNUSABLE
from evenlight.analysis.calibration.thresholds import ThresholdFit
from evenlight.data_schema.threshold import ThresholdFlag


@dataclass(frozen=True, slots=True)
class LevelEstimates:
    """Three estimates of the population's threshold at one level.

    Attributes
    ----------
    level : RampLevelKey
        Which.
    random : RandomThresholdFit or None
        With a threshold for each participant, integrated out; None for fewer than two participants. Left out
        are those with too many false alarms, but not those who answered all alike.
    pooled : float or None
        75 % point of everybody's answers in one pot [cd/m^2/s]; None if they are all alike.
    mean_of_fits : float or None
        Geometric mean of the participants' usable thresholds [cd/m^2/s].
    n_participants, n_usable : int
        Participants at this level, and usable thresholds.
    """

    level: RampLevelKey
    random: RandomThresholdFit | None
    pooled: float | None
    mean_of_fits: float | None
    n_participants: int
    n_usable: int

    @property
    def pooled_ratio(self) -> float | None:
        """Pooled over random threshold."""
        return self.pooled / self.random.threshold if self.pooled and self.random else None

    @property
    def mean_ratio(self) -> float | None:
        """Mean of individual fits over random threshold."""
        return self.mean_of_fits / self.random.threshold if self.mean_of_fits and self.random else None

    @property
    def in_words(self) -> str:
        """What pooling does here."""
        if self.random is None:
            return "no random threshold: two participants or more with answers of both kinds are needed"
        parts = [
            f"the {name} lies {_percent(ratio)} the population's threshold"
            for name, ratio in (
                ("pooled fit", self.pooled_ratio),
                ("mean of individual fits", self.mean_ratio),
            )
            if ratio is not None
        ]
        return "; ".join(parts)


def estimate_levels(fits: Iterable[ThresholdFit]) -> tuple[LevelEstimates, ...]:
    """Return the estimates of every level.

    Parameters
    ----------
    fits : iterable of ThresholdFit
        One per participant and level.
    """
    levels: dict[RampLevelKey, list[ThresholdFit]] = {}
    for fit in fits:
        levels.setdefault(level_of_threshold(fit.threshold), []).append(fit)
    return tuple(_estimates(level, levels[level]) for level in sorted(levels, key=level_order))


def _estimates(level: RampLevelKey, fits: Sequence[ThresholdFit]) -> LevelEstimates:
    """Return the estimates of one level."""
    usable = [fit.threshold.threshold for fit in fits if fit.threshold.flag not in UNUSABLE]
    honest = [fit.fit.counts for fit in fits if fit.threshold.flag is not ThresholdFlag.FALSE_ALARMS]
    return LevelEstimates(
        level=level,
        random=fit_random_threshold(honest),
        pooled=logistic_threshold(pooled_counts([fit.fit.counts for fit in fits])),
        mean_of_fits=float(np.exp(np.mean(np.log(usable)))) if usable else None,
        n_participants=len(fits),
        n_usable=len(usable),
    )


def pooled_counts(participants: Sequence[RampCounts]) -> RampCounts:
    """Return everybody's answers in one pot, catch trials left out."""
    rates, index = np.unique(np.concatenate([c.rates for c in participants]), return_inverse=True)

    def summed(parts: list[NDArray[np.int64]]) -> NDArray[np.int64]:
        return np.bincount(index, np.concatenate(parts), minlength=rates.size).astype(np.int64)

    return RampCounts(
        rates,
        summed([c.n_yes for c in participants]),
        summed([c.n_trials for c in participants]),
        guess_rate=participants[0].guess_rate,
    )


def mean_ratios(levels: Sequence[LevelEstimates]) -> tuple[float | None, float | None]:
    """Return pooled and mean-of-fits over random threshold, geometric means over the levels."""
    pooled = [level.pooled_ratio for level in levels if level.pooled_ratio]
    means = [level.mean_ratio for level in levels if level.mean_ratio]
    return _geometric_mean(pooled), _geometric_mean(means)


def difference_in_words(levels: Sequence[LevelEstimates]) -> str | None:
    """Return what pooling and averaging do over all levels, in words; None if nothing can be compared."""
    pooled, means = mean_ratios(levels)
    if pooled is None or means is None:
        return None
    return (
        f"on average over {len(levels)} levels, the pooled fit lies {_percent(pooled)} and the geometric "
        f"mean of individual fits {_percent(means)} the population's threshold with one of their own for "
        "each participant"
    )


def level_mapping(estimates: LevelEstimates) -> dict[str, Any]:
    """Return the estimates of a level as an entry of `fit_summary.json`."""
    level, random = estimates.level, estimates.random
    return {
        "screen": level.screen,
        "factor": level.factor,
        "luminance_cd_m2": level.luminance,
        "direction": level.direction.value,
        "ramp_duration_s": level.ramp_duration,
        "procedure": level.procedure.value,
        "n_participants": estimates.n_participants,
        "n_usable": estimates.n_usable,
        "random_threshold": None if random is None else _random_mapping(random),
        "pooled_threshold_cd_m2_s": estimates.pooled,
        "mean_of_fits_cd_m2_s": estimates.mean_of_fits,
        "pooled_ratio": estimates.pooled_ratio,
        "mean_of_fits_ratio": estimates.mean_ratio,
        "in_words": estimates.in_words,
    }


def _random_mapping(fit: RandomThresholdFit) -> dict[str, float]:
    """Return the random threshold's figures, units in their keys."""
    return {
        "threshold_cd_m2_s": fit.threshold,
        "ci_low_cd_m2_s": fit.ci_low,
        "ci_high_cd_m2_s": fit.ci_high,
        "standard_error_ln": fit.standard_error_ln,
        "participant_sd_ln": fit.participant_sd,
        "width": fit.width,
        "lapse_rate": fit.lapse_rate,
        "n_participants": fit.n_participants,
    }


def _geometric_mean(values: Sequence[float]) -> float | None:
    """Return the geometric mean; None of nothing."""
    return float(np.exp(np.mean(np.log(values)))) if values else None


def _percent(ratio: float) -> str:
    """Return a ratio as "12.3 % above"."""
    return f"{abs(100 * (ratio - 1)):.1f} % {'above' if ratio >= 1 else 'below'}"
