"""The calibration: from the trials of a data set to thresholds and the rate limit, and their files."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from analysis.loading import RampData
from analysis.pooled_fit import PooledFit, fit_pooled
from analysis.rate_limit_curve import RateLimitOptions
from analysis.rate_limit_fit import UNUSABLE, RateLimitFit, fit_thresholds
from analysis.thresholds import Criterion, ThresholdFit, catch_counts, criterion_of, fit_thresholds_of
from data_schema.errors import InputError
from data_schema.mapping import mapping_from_record
from data_schema.provenance import Provenance
from data_schema.text_files import write_json, write_json_record, write_rows
from data_schema.threshold import Threshold
from method.rate_limit import rate_limit_at

COMPARED_AT = 201  # luminances at which two curves are compared
NO_CATCH_TRIALS = "there are no catch trials: how often people say yes to nothing is the prior's word"


@dataclass(frozen=True, slots=True)
class Calibration:
    """Everything that the trials say: what the files and figures are made from.

    Attributes
    ----------
    data : RampData
        The trials.
    thresholds : tuple of ThresholdFit
        One per participant and level.
    criteria : dict of str to Criterion
        How readily each participant says "yes"; without those who had no catch trials.
    rate_limit : RateLimitFit
        The population's curve.
    pooled : PooledFit or None
        The paper's way; None if too few levels allow it.
    """

    data: RampData
    thresholds: tuple[ThresholdFit, ...]
    criteria: dict[str, Criterion]
    rate_limit: RateLimitFit
    pooled: PooledFit | None

    @property
    def excluded_participants(self) -> dict[str, str]:
        """Participants of whom no threshold went into the rate limit, and why."""
        flags: dict[str, set[str]] = {}
        usable = set()
        for fit in self.thresholds:
            flags.setdefault(fit.threshold.participant_id, set()).add(fit.threshold.flag.value)
            if fit.threshold.flag not in UNUSABLE:
                usable.add(fit.threshold.participant_id)
        return {who: ", ".join(sorted(why)) for who, why in flags.items() if who not in usable}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of the results should know."""
        catches = () if self.criteria else (NO_CATCH_TRIALS,)
        return self.data.warnings + catches + _single_levels(self.thresholds) + self.rate_limit.notes


def calibrate(
    data: RampData,
    options: RateLimitOptions | None = None,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> Calibration:
    """Fit thresholds and the rate limit to the ramp trials of a data set.

    Parameters
    ----------
    data : RampData
        The trials.
    options : RateLimitOptions, optional
        Form and degree of the rate limit.
    report : callable, optional
        Called with the psychometric fits done and their total.

    Raises
    ------
    InputError
        If the thresholds that can be used lie at too few luminances.
    """
    options = dataclasses.replace(
        options or RateLimitOptions(), ramp_duration=data.sessions[0].manifest.design.ramp_duration
    )
    thresholds = tuple(fit_thresholds_of(data.trials, report=report))
    limit = fit_thresholds([fit.threshold for fit in thresholds], data.display, options, "calibration")
    try:
        pooled = fit_pooled(data.trials, data.display, options)
    except InputError:
        pooled = None  # the pooled answers of a level can be all alike; the summary says that it is missing
    criteria = {who: criterion_of(*counts) for who, counts in catch_counts(data.trials).items()}
    return Calibration(data, thresholds, criteria, limit, pooled)


def write_calibration(calibration: Calibration, folder: Path, provenance: Provenance) -> None:
    """Write `thresholds.csv`, `rate_limit.json` and `fit_summary.json`."""
    write_rows(folder / "thresholds.csv", Threshold, [fit.threshold for fit in calibration.thresholds])
    participants = len(calibration.data.participant_ids)
    kind = "simulated participants" if calibration.data.simulated else "participants"
    limit = dataclasses.replace(
        calibration.rate_limit.limit,
        simulated=calibration.data.simulated,
        source=f"ramp calibration with {participants} {kind}",
        provenance=provenance,
    )
    write_json_record(folder / "rate_limit.json", limit)
    write_json(folder / "fit_summary.json", summary_of(calibration, provenance))


def summary_of(calibration: Calibration, provenance: Provenance) -> dict[str, Any]:
    """Return the content of `fit_summary.json`."""
    curve = calibration.rate_limit
    return {
        "simulated": calibration.data.simulated,
        "n_participants": len(calibration.data.participant_ids),
        "n_trials": len(calibration.data.trials),
        "n_thresholds": len(calibration.thresholds),
        "n_thresholds_used": len(curve.used),
        "excluded_participants": calibration.excluded_participants,
        "flags": _flag_counts(calibration.thresholds),
        "participant_sd_ln": curve.participant_sd,
        "residual_sd_ln": curve.residual_sd,
        "form": curve.limit.form.value,
        "degree": len(curve.limit.coefficients) - 1,
        "residual_df": curve.residual_df,
        "condition_number": curve.limit.condition_number,
        "monotone": curve.monotone,
        "falling_cd_m2": [list(stretch) for stretch in curve.falling],
        "pooled": pooled_comparison(calibration),
        "criteria": {who: mapping_from_record(c) for who, c in calibration.criteria.items()},
        "warnings": list(calibration.warnings),
        "provenance": mapping_from_record(provenance),
    }


def pooled_comparison(calibration: Calibration) -> dict[str, Any] | None:
    """Return how far the pooled curve lies from the population's, as ratios; None if one is missing or 0."""
    pooled = calibration.pooled
    if pooled is None:
        return None
    ours, theirs = calibration.rate_limit.limit, pooled.curve.limit
    low = max(ours.luminance_range[0], theirs.luminance_range[0])
    high = min(ours.luminance_range[1], theirs.luminance_range[1])
    luminance = np.linspace(low, high, COMPARED_AT)
    pooled_rate, own_rate = rate_limit_at(theirs, luminance), rate_limit_at(ours, luminance)
    if min(pooled_rate.min(), own_rate.min()) <= 0:  # a polynomial of the rate can fall so far: no ratio
        return None
    ratio = pooled_rate / own_rate
    mean = float(np.exp(np.mean(np.log(ratio))))
    return {
        "luminance_cd_m2": pooled.luminance.tolist(),
        "threshold_cd_m2_s": pooled.threshold.tolist(),
        "coefficients": list(theirs.coefficients),
        "monotone": pooled.curve.monotone,
        "levels_left_out": pooled.left_out,
        "ratio_to_population_mean": mean,
        "ratio_to_population_min": float(ratio.min()),
        "ratio_to_population_max": float(ratio.max()),
        "in_words": f"the pooled curve lies {abs(mean - 1):.1%} {'above' if mean > 1 else 'below'} the "
        "population's on average, in which each participant has a threshold of their own",
    }


def _flag_counts(thresholds: tuple[ThresholdFit, ...]) -> dict[str, int]:
    """Return how many thresholds carry each flag."""
    counts: dict[str, int] = {}
    for fit in thresholds:
        if fit.threshold.flag.value:
            counts[fit.threshold.flag.value] = counts.get(fit.threshold.flag.value, 0) + 1
    return counts


def _single_levels(thresholds: tuple[ThresholdFit, ...]) -> tuple[str, ...]:
    """Return a warning for each participant with thresholds at one level only, among others with more."""
    counts: dict[str, int] = {}
    for fit in thresholds:
        counts[fit.threshold.participant_id] = counts.get(fit.threshold.participant_id, 0) + 1
    return tuple(
        f"participant {who} has a single level, which says nothing about the curve's shape"
        for who, count in counts.items()
        if count == 1
    )
