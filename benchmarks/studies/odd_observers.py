"""Simulated participants who are not as the fit has them: another shape, a flatter rise, more lapses.

The rate that they tell right in 75 % of the trials is the one of the population they are drawn from, so that
it is known what a fit should find.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.data_schema.recordings.ramp import Direction, Procedure, Response
from evenlight.experiments.ramp.ramp_observer import REFERENCE_DURATION, SimulatedObserver
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.method.psychometric import WIDTH_LOGITS, PsychometricFunction, threshold_logit

PRIOR_WIDTH = 1.6  # ln(rate), median of the fit's prior (docs/decisions/threshold-definition.md)
MANY_LAPSES = 0.06  # of the answers to a clear ramp; the fit's prior for two intervals has a mean of 1.6 %


@dataclass(frozen=True, slots=True)
class Flat(SimulatedObserver):
    """Somebody whose function rises over twice the width that the prior has for its median."""

    def function_at(
        self,
        luminance: float,
        procedure: Procedure = Procedure.YES_NO,
        direction: Direction = Direction.DOWN,
        duration: float = REFERENCE_DURATION,
    ) -> PsychometricFunction:
        """Return the function at a level."""
        own = SimulatedObserver.function_at(self, luminance, procedure, direction, duration)
        return dataclasses.replace(own, width=2 * PRIOR_WIDTH)


@dataclass(frozen=True, slots=True)
class Lapsing(SimulatedObserver):
    """Somebody who misses six clear ramps in a hundred."""

    def function_at(
        self,
        luminance: float,
        procedure: Procedure = Procedure.YES_NO,
        direction: Direction = Direction.DOWN,
        duration: float = REFERENCE_DURATION,
    ) -> PsychometricFunction:
        """Return the function at a level."""
        own = SimulatedObserver.function_at(self, luminance, procedure, direction, duration)
        return dataclasses.replace(own, lapse_rate=MANY_LAPSES)


@dataclass(frozen=True, slots=True)
class WeibullShaped(SimulatedObserver):
    """Somebody with a Weibull function of the rate, of the logistic one's threshold and slope there."""

    def answer(self, ramp: PlannedTrial, rng: np.random.Generator) -> Response:
        """Return the answer to a trial of two intervals."""
        function = self.function_at(
            ramp.level.luminance, Procedure.TWO_INTERVAL, ramp.direction, ramp.duration
        )
        right = rng.random() < weibull_probability(ramp.rate, function)
        return Response.FIRST if right == (ramp.ramp_interval == 1) else Response.SECOND


def weibull_probability(rate: float, function: PsychometricFunction) -> float:
    """Return γ + (1 - γ - λ) (1 - exp(-t (rate / threshold)^b)), which meets a logistic ψ at its threshold.

    There F is the same, t = -ln(1 - F), and so is the slope: b t (1 - F) = F (1 - F) · (logits / width).

    >>> logistic = PsychometricFunction(threshold=2.0, width=1.6, guess_rate=0.5, lapse_rate=0.02)
    >>> round(weibull_probability(2.0, logistic), 12)  # 0.5 + 0.48 / 2
    0.74
    """
    span = 1 - function.guess_rate - function.lapse_rate
    rise = float(special.expit(threshold_logit(function.guess_rate)))
    t = -math.log1p(-rise)
    b = rise * WIDTH_LOGITS / (function.width * t)
    return function.guess_rate - span * math.expm1(-t * (rate / function.threshold) ** b)


def changed_into(kind: type[SimulatedObserver], observer: SimulatedObserver) -> SimulatedObserver:
    """Return the same participant as one of another kind."""
    own = {field.name: getattr(observer, field.name) for field in dataclasses.fields(observer)}
    return kind(**own)
