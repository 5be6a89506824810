"""How often the tests and intervals of the log-normal model of times err, for 17 participants.

    python benchmarks/studies/times_levels.py [runs]

prints the table of docs/decisions/cumulative-link-model.md: a row for each truth, with the share of the 95 %
intervals that miss it (where the effect is 0: the error of the first kind of its test), and what becomes of
the effect if undetected trials are capped at the limit, or dropped.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from ordinal_levels import covers
from studies import Mapped, run_study

from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.inference.lognormal_times import CensoredTimes, fit_lognormal_times

PARTICIPANTS = 17
LIMIT = 30.0  # s
GROUP_SD, RESIDUAL_SD = 0.3, 0.7  # of ln(time)


@dataclass(frozen=True, slots=True)
class TimesTruth:
    """What is true of simulated search times: 17 participants, each location once in both versions.

    Attributes
    ----------
    effect : float
        Of the version, or of half of the people ("group") [ln s].
    locations : int
        How many.
    median : float
        Of the time at the middle location [s]; the medians spread by a factor of 3.3 over the locations.
    slope_sd : float
        Of the version's effect between participants [ln s].
    tested : str
        "version", "group", or "location" (the second against the first).
    random_slope : bool
        Whether the model fitted has the slope.
    """

    effect: float
    locations: int = 21
    median: float = 18.0
    slope_sd: float = 0.0
    tested: str = "version"
    random_slope: bool = False


TRUTHS = {
    "version -0.25, 21 locations": TimesTruth(-0.25),
    "version 0, 21 locations": TimesTruth(0.0),
    "version -0.25, 4 locations": TimesTruth(-0.25, locations=4),
    "version 0, slopes differ (SD 0.3), ignored": TimesTruth(0.0, slope_sd=0.3),
    "version with random slope, SD 0": TimesTruth(0.0, random_slope=True),
    "version with random slope, SD 0.3": TimesTruth(0.0, slope_sd=0.3, random_slope=True),
    "version with random slope, 4 locations, SD 0.3": TimesTruth(
        0.0, locations=4, slope_sd=0.3, random_slope=True
    ),
    "half of the people, 4 locations": TimesTruth(0.0, locations=4, tested="group"),
    "second location against the first": TimesTruth(0.0, locations=4, tested="location"),
}


def simulated_times(truth: TimesTruth, rng: np.random.Generator) -> CensoredTimes:
    """Return the search times of 17 simulated participants, cut off at 30 s."""
    groups, location, version = (
        grid.ravel()
        for grid in np.meshgrid(
            np.arange(PARTICIPANTS), np.arange(truth.locations), [-0.5, 0.5], indexing="ij"
        )
    )
    place = np.log(truth.median) + np.linspace(-0.6, 0.6, truth.locations)
    half = (groups % 2 - 0.5).astype(np.float64)
    columns = {f"location {k}": (location == k).astype(np.float64) for k in range(truth.locations)}
    columns["version"] = version
    if truth.tested == "group":
        columns["group"] = half
    moved = {"version": truth.effect * version, "group": truth.effect * half, "location": 0.0 * half}
    own = GROUP_SD * rng.standard_normal(PARTICIPANTS)[groups]
    own = own + truth.slope_sd * rng.standard_normal(PARTICIPANTS)[groups] * version
    ln_time = place[location] + moved[truth.tested] + own + RESIDUAL_SD * rng.standard_normal(groups.size)
    seconds = np.exp(ln_time)
    return CensoredTimes(
        times=np.minimum(seconds, LIMIT),
        observed=seconds <= LIMIT,
        design=np.column_stack(list(columns.values())),
        names=tuple(columns),
        groups=groups,
        slope_column=truth.locations if truth.random_slope else None,
    )


def fitted_time_effect(truth: TimesTruth, data: CensoredTimes) -> FixedEffect:
    """Return the effect in question as it was fitted."""
    if truth.tested == "location":
        weights = (-1.0, 1.0) + (0.0,) * (len(data.names) - 2)
        return fit_lognormal_times(data, {"location": weights}, ("location",)).contrasts[0]
    fit = fit_lognormal_times(data, profiled=(truth.tested,))
    return next(effect for effect in fit.effects if effect.name == truth.tested)


def true_value(truth: TimesTruth) -> float:
    """Return what the effect in question truly is [ln s]."""
    return 1.2 / (truth.locations - 1) if truth.tested == "location" else truth.effect


def naive_effects(data: CensoredTimes) -> tuple[float, float]:
    """Return the version's effect with undetected trials capped at the limit, and dropped [ln s]."""
    version = data.design[:, data.names.index("version")]
    ln_time = np.log(data.times)

    def difference(used: np.ndarray) -> float:
        return float(ln_time[used & (version > 0)].mean() - ln_time[used & (version < 0)].mean())

    return difference(np.ones_like(data.observed)), difference(data.observed)


def row_of(runs: int, name: str) -> str:
    """Return the row of a truth."""
    truth, rng = TRUTHS[name], np.random.default_rng(17)
    held, estimates, naive, lost = 0, [], [], []
    for _ in range(runs):
        data = simulated_times(truth, rng)
        effect = fitted_time_effect(truth, data)
        held += covers(effect, true_value(truth))
        estimates.append(effect.estimate)
        naive.append(naive_effects(data))
        lost.append(1 - data.observed.mean())
    share, (capped, dropped) = 1 - held / runs, np.mean(naive, axis=0)
    error = np.sqrt(share * (1 - share) / runs)
    return (
        f"| {name} | {np.mean(lost):.0%} | {share:.1%} | {error:.1%} | {np.mean(estimates):.3f} | "
        f"{capped:.3f} | {dropped:.3f} |"
    )


def main(runs: int, mapped: Mapped = map) -> None:
    """Print the table."""
    print(f"| truth | undetected | misses of {runs} | ± | mean estimate | capped | dropped |")
    print("|---|---|---|---|---|---|---|")
    for row in mapped(partial(row_of, runs), TRUTHS):
        print(row, flush=True)


if __name__ == "__main__":
    run_study(__file__, runs=1000)
