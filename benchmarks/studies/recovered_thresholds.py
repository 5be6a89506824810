"""Simulated participants through schedule, answers and fit, back to their thresholds, for each mode."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from studies import Mapped

from evenlight.analysis.calibration.psychometric.psychometric_fit import PsychometricFit, fit_psychometric
from evenlight.analysis.calibration.psychometric.ramp_counts import catch_counts, ramp_counts
from evenlight.data_schema.recordings.ramp import Placement, Procedure, RampDesign, trial_seconds
from evenlight.experiments.ramp.ramp_observer import SimulatedObserver
from evenlight.experiments.ramp.ramp_plan import ramp_levels
from evenlight.experiments.ramp.ramp_viewing import RampViewing
from evenlight.experiments.ramp.simulate_ramp import answered_session
from evenlight.method.preset_files import load_display

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
        return LEVELS * trials * trial_seconds(self.design(ramps)) / 60


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


def recover(
    mode: Mode,
    ramps: int,
    participants: int,
    seed: int,
    change: Callable[[SimulatedObserver], SimulatedObserver] = lambda observer: observer,
    mapped: Mapped = map,
) -> Recovery:
    """Return what the fit finds of the thresholds of simulated participants, each changed as told."""
    viewing = RampViewing(mode.design(ramps), load_display("varjo-xr3"))
    each = mapped(partial(_errors_of, viewing, seed, change), range(participants))
    errors, covered, stated = zip(*(error for own in each for error in own), strict=True)
    return Recovery(np.array(errors), np.array(covered), np.array(stated))


def _errors_of(
    viewing: RampViewing,
    seed: int,
    change: Callable[[SimulatedObserver], SimulatedObserver],
    order_index: int,
) -> list[tuple[float, bool, float]]:
    """Return the errors of a participant, level by level."""
    design, session, who = viewing.design, (seed, order_index), f"{order_index + 1:02d}"
    observer = change(viewing.person_of(session))
    trials = answered_session(viewing, session, who, observer)
    found = []
    for level in ramp_levels(design, viewing.display):
        own = [t for t in trials if not t.is_catch and t.initial_luminance == level.luminance]
        counts = ramp_counts(own, *catch_counts(trials).get(who, (0, 0)))
        truth = observer.function_at(level.luminance, design.procedure).threshold
        found.append(_error(fit_psychometric(counts), truth))
    return found


def _error(fit: PsychometricFit, threshold: float) -> tuple[float, bool, float]:
    """Return the error of a fit in ln(threshold), whether its interval holds the truth, and its own error."""
    found, truth = fit.ln_threshold, np.log(threshold)
    return found.mean - truth, bool(found.ci_low <= truth <= found.ci_high), found.sd
