"""Simulated participants through schedule, answers and fit, back to their thresholds, for each mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.psychometric_fit import PsychometricFit, fit_psychometric
from analysis.ramp_counts import catch_counts, ramp_counts
from analysis.session_length import trial_seconds
from data_schema.ramp import Placement, Procedure, RampDesign, RampTrial
from experiments.simulate_ramp import simulated_trials_and_thresholds
from method.preset_files import load_display

YES_NO_RATES = RampDesign().relative_rates  # of the paper mode
TWO_INTERVAL_RATES = tuple(np.geomspace(0.004, 0.08, 8).round(5).tolist())  # where that task's thresholds are
LEVELS = 10  # of a session; two of them are simulated, with the catch trials of all
FACTORS = (0.4, 1.0)  # of those two
CATCH_SHARE = 0.2


@dataclass(frozen=True, slots=True)
class Mode:
    """A task with a way of placing its ramps."""

    procedure: Procedure
    placement: Placement

    def design(self, ramps: int) -> RampDesign:
        """Return a design of two levels with so many ramps each, and the catch trials of a whole session."""
        yes_no = self.procedure is Procedure.YES_NO
        rates = YES_NO_RATES if yes_no else TWO_INTERVAL_RATES
        catches = LEVELS / len(FACTORS) * CATCH_SHARE / (1 - CATCH_SHARE)  # to each ramp
        return RampDesign(
            procedure=self.procedure,
            placement=self.placement,
            screens=("white",),
            factors=FACTORS,
            relative_rates=rates,
            repetitions=max(ramps // len(rates), 1),
            trials_per_level=ramps,
            catch_share=catches / (1 + catches),
        )

    def minutes(self, ramps: int) -> float:
        """Return how long a session of ten levels with so many ramps at each takes, without breaks."""
        trials = ramps / (1 - CATCH_SHARE) if self.procedure is Procedure.YES_NO else ramps
        return LEVELS * trials * trial_seconds(5.0, self.design(ramps)) / 60


MODES = {
    "paper (yes/no, constant)": Mode(Procedure.YES_NO, Placement.CONSTANT),
    "yes/no, targeted": Mode(Procedure.YES_NO, Placement.TARGETED),
    "yes/no, psi-marginal": Mode(Procedure.YES_NO, Placement.PSI_MARGINAL),
    "two intervals, constant": Mode(Procedure.TWO_INTERVAL, Placement.CONSTANT),
    "two intervals, targeted": Mode(Procedure.TWO_INTERVAL, Placement.TARGETED),
    "two intervals, psi-marginal": Mode(Procedure.TWO_INTERVAL, Placement.PSI_MARGINAL),
}


@dataclass(frozen=True, slots=True)
class Recovery:
    """What came back of simulated thresholds.

    Attributes
    ----------
    errors : array (n,)
        ln(estimate / truth) of each participant and level, participant after participant.
    covered : array (n,)
        Whether the 95 % interval holds the truth.
    stated : array (n,)
        Standard error of ln(threshold) that the fit states.
    """

    errors: NDArray[np.float64]
    covered: NDArray[np.bool_]
    stated: NDArray[np.float64]

    @property
    def bias(self) -> float:
        """Of the threshold, as a share: the geometric mean of estimate / truth, less 1."""
        return float(np.expm1(self.errors.mean()))

    @property
    def bias_error(self) -> float:
        """Standard error of the bias; the levels of a participant share width, guess and lapse rate."""
        own = self.errors.reshape(-1, len(FACTORS)).mean(axis=1)
        return float(own.std(ddof=1) / np.sqrt(own.size))

    @property
    def coverage(self) -> float:
        """Share of the intervals that hold the truth."""
        return float(self.covered.mean())

    @property
    def scatter(self) -> float:
        """Root of the mean square of ln(estimate / truth): bias and chance together."""
        return float(np.sqrt(np.mean(self.errors**2)))


def recover(mode: Mode, ramps: int, participants: int, seed: int) -> Recovery:
    """Return what the fit finds of the thresholds of simulated participants."""
    display = load_display("varjo-xr3")
    trials, truth = simulated_trials_and_thresholds(mode.design(ramps), display, participants, seed)
    ramps_of: dict[tuple[str, float], list[RampTrial]] = {}
    for trial in trials:
        if not trial.is_catch:
            ramps_of.setdefault((trial.participant_id, trial.initial_luminance), []).append(trial)
    catches = catch_counts(trials)
    found = [
        _error(fit_psychometric(ramp_counts(ramps_of[key], *catches.get(key[0], (0, 0)))), threshold)
        for key, threshold in truth.items()
    ]
    errors, covered, stated = zip(*found, strict=True)
    return Recovery(np.array(errors), np.array(covered), np.array(stated))


def _error(fit: PsychometricFit, threshold: float) -> tuple[float, bool, float]:
    """Return the error of a fit in ln(threshold), whether its interval holds the truth, and its own error."""
    found, truth = fit.ln_threshold, np.log(threshold)
    return found.mean - truth, bool(found.ci_low <= truth <= found.ci_high), found.sd
