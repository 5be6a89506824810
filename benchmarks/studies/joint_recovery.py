"""Simulated data sets through the joint model, back to the population's curve."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.calibration.joint.joint_fit import JointFit, fit_joint
from evenlight.analysis.calibration.psychometric.serial_dependence import serial_dependence
from evenlight.analysis.calibration.psychometric.thresholds import fit_thresholds_of
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import fit_thresholds
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.recordings.ramp import Procedure, RampDesign, RampTrial
from evenlight.experiments.design_files import load_design
from evenlight.experiments.ramp.ramp_observer import ObserverPopulation, draw_observer
from evenlight.experiments.ramp.ramp_plan import ramp_levels
from evenlight.experiments.ramp.ramp_viewing import RampViewing
from evenlight.experiments.ramp.simulate_ramp import answered_session
from evenlight.method.preset_files import load_display, load_rate_limit
from evenlight.method.rate_limit import rate_limit_at

Array = NDArray[np.float64]
DISPLAY = "varjo-xr3"
BEND = 30.0  # [cd/m^2] of the broken line: the relative rate is held below, the rate goes with L^0.3 above
DRAWN = 20_000  # observers, for the mean of their ln(threshold): its standard error is 0.002


def _preset(luminance: Array) -> Array:
    """Return the published limit; below 8.8 cd/m^2 its relative rate is held."""
    return rate_limit_at(load_rate_limit("surace2025"), luminance)


def _power_law(luminance: Array) -> Array:
    """Return 0.06 L^0.8."""
    return np.asarray(0.06 * luminance**0.8)


def _broken_line(luminance: Array) -> Array:
    """Return a line with a bend over logarithms: no polynomial."""
    return np.asarray(0.035 * BEND * np.where(luminance < BEND, luminance / BEND, (luminance / BEND) ** 0.3))


TRUTHS: dict[str, Callable[[Array], Array]] = {
    "preset": _preset,
    "power law": _power_law,
    "broken line": _broken_line,
}


@dataclass(frozen=True, slots=True)
class Study:
    """What is simulated.

    Attributes
    ----------
    design, truth : str or RampDesign, str
        Design or its preset; which of `TRUTHS` the median person's yes/no threshold follows.
    participants, population : int, ObserverPopulation
        How many, and how they differ.
    scale : float
        Of all thresholds.
    repeat_share : float
        Of the trials in which the last answer is given again, whatever is seen; for constant ramps, which do
        not depend on answers.
    """

    design: str | RampDesign
    truth: str
    participants: int = 10
    population: ObserverPopulation = dataclasses.field(default_factory=ObserverPopulation)
    scale: float = 1.0
    repeat_share: float = 0.0

    @property
    def ramps(self) -> RampDesign:
        """The design."""
        design = load_design(self.design) if isinstance(self.design, str) else self.design
        assert isinstance(design, RampDesign)
        return design

    def answers(self, seed: int) -> tuple[list[RampTrial], dict[float, list[float]]]:
        """Return the trials of a data set, and ln(threshold) of its people at each luminance."""
        viewing = RampViewing(self.ramps, load_display(DISPLAY), _weber(), self.population)
        trials: list[RampTrial] = []
        own: dict[float, list[float]] = {}
        for k in range(self.participants):
            seen = viewing.person_of((seed, k))
            factors = {
                luminance: own * self._over_limit(luminance) for luminance, own in seen.level_factors.items()
            }
            observer = dataclasses.replace(seen, level_factors=factors)
            given = answered_session(viewing, (seed, k), f"{k + 1:02d}", observer)
            trials += repeated_answers(given, self.repeat_share, np.random.default_rng([seed, k, 7]))
            for level in ramp_levels(self.ramps, load_display(DISPLAY)):
                at, function = level.luminance, observer.function_at(level.luminance, self.ramps.procedure)
                own.setdefault(at, []).append(float(np.log(function.threshold)))
        return trials, own

    def _over_limit(self, luminance: float) -> float:
        """Return the truth as a multiple of the limit that observers are drawn from."""
        at = np.array([luminance])
        return float(self.scale * TRUTHS[self.truth](at)[0] / rate_limit_at(_weber(), at)[0])

    def true_curve(self, luminance: Array) -> Array:
        """Return exp(mean of ln threshold over people) in the design's task [cd/m^2/s]."""
        if self.ramps.procedure is Procedure.TWO_INTERVAL:
            own = self.population.median_two_interval_ratio
        else:
            own = mean_caution(self.population)
        return np.asarray(self.scale * own * TRUTHS[self.truth](luminance))


def repeated_answers(
    trials: Iterable[RampTrial], share: float, rng: np.random.Generator
) -> Iterator[RampTrial]:
    """Yield a session's trials, in some of which the last answer is given again."""
    last = None
    for trial in trials:
        again = rng.random() < share and last is not None
        last = last if again else trial.response
        yield dataclasses.replace(trial, response=last)


def _weber() -> RateLimit:
    """Return a limit with one relative rate."""
    ends = (1.0, 200.0)
    middle, half = np.log(ends).mean(), np.ptp(np.log(ends)) / 2
    coefficients = (float(np.log(0.03) + middle), float(half))
    return RateLimit("weber", DISPLAY, "", RateLimitForm.LOG_LOG, coefficients, ends)


@functools.cache
def mean_caution(population: ObserverPopulation) -> float:
    """Return exp(mean of ln caution): what the criterion makes of yes/no thresholds on average."""
    chance = np.random.default_rng(5)
    limit = _weber()
    drawn = (draw_observer(limit, (), chance, population).caution for _ in range(DRAWN))
    return float(np.exp(np.mean(np.log(list(drawn)))))


@dataclass(frozen=True, slots=True)
class Recovered:
    """One data set's curve against the truth, at the luminances of the band.

    Attributes
    ----------
    fit : JointFit
        What was found.
    errors : array (97,)
        ln(curve / truth).
    own_errors : array (levels,)
        ln(curve / geometric mean of the participants' thresholds) at the levels: free of whom chance drew.
    covered : bool
        Whether the truth lies in the simultaneous band everywhere.
    pointwise : array (97,) of bool
        Whether it lies in the pointwise band.
    people : array (participants,) of bool
        Whether the mean factor by which a person's thresholds differ from the truth lies in its interval.
    """

    fit: JointFit
    errors: Array
    own_errors: Array
    covered: bool
    pointwise: NDArray[np.bool_]
    people: NDArray[np.bool_]

    @property
    def half_width(self) -> float:
        """Of the simultaneous band, in ln(rate), on average over luminance."""
        return float(np.mean(np.log(self.fit.simultaneous_upper / self.fit.simultaneous_lower)) / 2)


def recovered_sets(
    study: Study, sets: int, seed: int, options: RateLimitOptions | None = None
) -> Iterator[Recovered]:
    """Yield what is found of each of some data sets."""
    for k in range(sets):
        yield recovered(study, seed + k, options)


def recovered(study: Study, seed: int, options: RateLimitOptions | None = None) -> Recovered:
    """Return what is found of a data set."""
    trials, people = study.answers(seed)
    repeats = None
    if study.repeat_share:
        repeats = serial_dependence(trials, fit_thresholds_of(trials, judge=False))[1]
    return compared(fit_joint(trials, options, repeats=repeats), study, people)


def compared(fit: JointFit, study: Study, people: dict[float, list[float]]) -> Recovered:
    """Return a fit against the truth of its study, and ln(threshold) of its participants."""
    at = fit.band_luminance
    truth = study.true_curve(at)
    curve = fit.basis.rate(fit.basis.design(at) @ fit.coefficients)
    inside = (fit.simultaneous_lower <= truth) & (truth <= fit.simultaneous_upper)
    pointwise = (fit.pointwise_lower <= truth) & (truth <= fit.pointwise_upper)
    levels, thresholds = np.array(list(people)), np.array(list(people.values()))
    own = fit.basis.design(levels) @ fit.coefficients - thresholds.mean(axis=1)
    factors = (thresholds - np.log(study.true_curve(levels))[:, None]).mean(axis=0)
    ends = np.log([(one.ci_low, one.ci_high) for one in fit.participants]).T
    held = (ends[0] <= factors) & (factors <= ends[1])
    return Recovered(fit, np.log(curve / truth), own, bool(inside.all()), pointwise, held)


def individual_errors(trials: list[RampTrial], people: dict[float, list[float]]) -> Array:
    """Return ln(curve / geometric mean of the participants' thresholds) of the individual fits' curve.

    Parameters
    ----------
    trials, people
        What `Study.answers` gives.
    """
    thresholds = [fit.threshold for fit in fit_thresholds_of(trials, judge=False)]
    limit = fit_thresholds(thresholds, load_display(DISPLAY)).limit
    means = [float(np.mean(own)) for own in people.values()]
    return np.asarray(np.log(rate_limit_at(limit, np.array(list(people)))) - means)
