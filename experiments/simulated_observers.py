"""Simulated participants of the ramp experiment: known thresholds, human-like scatter.

The population's median threshold is the paper's published rate limit. How participants scatter about it was
not published; the figures below are choices within what brightness-change studies report
(docs/decisions/yes-no-task.md), and every record made from them says that it is simulated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schema.ramp import Response
from data_schema.rate_limit import RateLimit
from method.psychometric import PsychometricFunction, yes_probability
from method.rate_limit import rate_limit_at

MAX_GUESS_RATE = 0.5  # who says "yes" more often than not to nothing would be excluded by any experimenter
MAX_LAPSE_RATE = 0.2


@dataclass(frozen=True, slots=True)
class ObserverPopulation:
    """Of whom simulated participants are drawn.

    Attributes
    ----------
    participant_sd : float
        Standard deviation of ln(threshold) between participants: 0.25 makes two of three lie within a factor
        of 1.28 of the median (choice; the paper's ten participants are published pooled only).
    level_sd : float
        Standard deviation of a participant's ln(threshold) from level to level, beyond their own factor
        (choice: about the scatter of the published points around their curve, 0.12).
    width_median, width_spread : float
        ln(rate) from 5 % to 95 %: median, and standard deviation of its logarithm; 1.6 is a logistic scale of
        0.12 in log10(rate), usual for yes/no detection (choice).
    guess, lapse : (float, float)
        Beta parameters of the guess rate (mean 0.07) and of the lapse rate (mean 0.024) (choice).
    """

    participant_sd: float = 0.25
    level_sd: float = 0.1
    width_median: float = 1.6
    width_spread: float = 0.3
    guess: tuple[float, float] = (2.0, 28.0)
    lapse: tuple[float, float] = (1.5, 60.0)


@dataclass(frozen=True, slots=True)
class SimulatedObserver:
    """A participant whose truth is known.

    Attributes
    ----------
    limit : RateLimit
        The population's median threshold over luminance.
    sensitivity : float
        The participant's threshold as a multiple of the population's.
    level_factors : dict of float to float
        Further multiple at each luminance level [cd/m^2]; 1 where none is given.
    width : float
        ln(rate) from 5 % to 95 % of the rise.
    guess_rate, lapse_rate : float
        γ and λ.
    """

    limit: RateLimit
    sensitivity: float
    level_factors: dict[float, float]
    width: float
    guess_rate: float
    lapse_rate: float

    def threshold_at(self, luminance: float) -> float:
        """Return the rate [cd/m^2/s] that is detected in 75 % of the trials at an initial luminance L."""
        own = self.sensitivity * self.level_factors.get(luminance, 1.0)
        return own * float(rate_limit_at(self.limit, luminance))

    def function_at(self, luminance: float) -> PsychometricFunction:
        """Return the psychometric function at an initial luminance L [cd/m^2]."""
        return PsychometricFunction(
            self.threshold_at(luminance), self.width, self.guess_rate, self.lapse_rate
        )

    def answer(self, luminance: float, rate: float, rng: np.random.Generator) -> Response:
        """Return an answer to "did the brightness change?" for one ramp.

        Parameters
        ----------
        luminance : float
            Initial luminance L [cd/m^2].
        rate : float
            Rate of the change [cd/m^2/s]; 0 in a catch trial.
        rng : numpy.random.Generator
            Chance.
        """
        seen = rng.random() < float(yes_probability(rate, self.function_at(luminance)))
        return Response.YES if seen else Response.NO


def draw_observer(
    limit: RateLimit,
    luminances: tuple[float, ...],
    rng: np.random.Generator,
    population: ObserverPopulation | None = None,
) -> SimulatedObserver:
    """Return a participant drawn from a population.

    Parameters
    ----------
    limit : RateLimit
        The population's median threshold over luminance.
    luminances : tuple of float
        Initial luminances of the session's levels [cd/m^2].
    rng : numpy.random.Generator
        Chance.
    population : ObserverPopulation, optional
        How participants differ.
    """
    people = population or ObserverPopulation()
    scatter = np.exp(people.level_sd * rng.standard_normal(len(luminances)))
    return SimulatedObserver(
        limit=limit,
        sensitivity=float(np.exp(people.participant_sd * rng.standard_normal())),
        level_factors=dict(zip(luminances, scatter.tolist(), strict=True)),
        width=float(people.width_median * np.exp(people.width_spread * rng.standard_normal())),
        guess_rate=min(float(rng.beta(*people.guess)), MAX_GUESS_RATE),
        lapse_rate=min(float(rng.beta(*people.lapse)), MAX_LAPSE_RATE),
    )
