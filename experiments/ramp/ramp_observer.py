"""Simulated participants of the ramp experiment: known thresholds, human-like scatter.

Two traits make a yes/no threshold (Green & Swets 1966): how well a person sees, and how much they must have
seen to say "yes". They are independent here. The threshold of two intervals, which the criterion leaves
alone, scatters by the first; that of yes/no by both. The median person's yes/no threshold is the paper's
published rate limit. How participants scatter about it was not published; the figures below are choices
within what brightness-change studies report (docs/decisions/yes-no-task.md,
docs/decisions/ramp-conditions.md), and every record made from them says that it is simulated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.ramp import Direction, Procedure, Response
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.method.psychometric import PsychometricFunction, two_interval_function, yes_probability
from evenlight.method.rate_limit import rate_limit_at

MEDIAN_RATE_LIMIT = "surace2025"  # the yes/no threshold of the median simulated participant
REFERENCE_DURATION = 5.0  # [s] of the paper's ramps, for which the published limit holds
MAX_GUESS_RATE = 0.5  # who says "yes" more often than not to nothing would be excluded by any experimenter
MAX_LAPSE_RATE = 0.2


@dataclass(frozen=True, slots=True)
class ObserverPopulation:
    """Of whom simulated participants are drawn."""

    # standard deviation of ln(threshold) between participants' eyes, which is that of two intervals: 0.2
    # makes two of three lie within a factor of 1.22 of the median (choice; the paper's ten participants are
    # published pooled only). In yes/no the criterion adds its own: 0.35 in all, levels included.
    participant_sd: float = 0.2
    # standard deviation of a participant's ln(threshold) from level to level, beyond their own factor
    # (choice: about the scatter of the published points around their curve, 0.12)
    level_sd: float = 0.1
    # ln(rate) from 5 % to 95 %: median, and standard deviation of its logarithm; 1.6 is a logistic scale of
    # 0.12 in log10(rate), usual for yes/no detection (choice)
    width_median: float = 1.6
    width_spread: float = 0.3
    # Beta parameters of the guess rate (mean 0.07) and of the lapse rate (mean 0.024) (choice)
    guess: tuple[float, float] = (2.0, 28.0)
    lapse: tuple[float, float] = (1.5, 60.0)
    # the threshold in rate goes with duration^-amount_share: 0 if only the rate is seen, 1 if only the total
    # change is, as Knau (2000) found for a whole field. 0.5 lies half way (choice).
    amount_share: float = 0.5
    # threshold of rising luminance as a multiple of that of falling luminance: decrements are seen a little
    # better than increments (choice of the amount)
    up_ratio: float = 1.1

    @property
    def median_two_interval_ratio(self) -> float:
        """The two-interval threshold of who is the median in every trait, as a multiple of their yes/no one.

        >>> round(ObserverPopulation(width_median=1e-9).median_two_interval_ratio, 6)  # a step has one place
        1.0
        """
        guess_rate, lapse_rate = (float(special.betaincinv(*beta, 0.5)) for beta in (self.guess, self.lapse))
        return two_interval_ratio(self.width_median, guess_rate, lapse_rate)


@dataclass(frozen=True, slots=True)
class SimulatedObserver:
    """A participant whose truth is known."""

    # the median person's threshold over luminance: of yes/no, for the luminance falling over 5 s
    limit: RateLimit
    # the participant's two-interval threshold as a multiple of the median person's: above 1 for who sees less
    # well
    sensitivity: float
    # further multiple at each luminance level [cd/m^2]; 1 where none is given
    level_factors: dict[float, float]
    width: float  # ln(rate) from 5 % to 95 % of the rise, in yes/no
    # γ and λ, in yes/no
    guess_rate: float
    lapse_rate: float
    # how far it is the total change that is seen and not its rate: the threshold in rate goes with
    # duration^-amount_share
    amount_share: float = 0.5
    up_ratio: float = 1.1  # threshold of rising luminance as a multiple of that of falling luminance
    # how much more 75 % "yes" takes of the participant than of a median person with the same eye: their
    # yes/no threshold as a multiple of their two-interval one, over the median person's
    caution: float = 1.0

    def threshold_at(
        self, luminance: float, direction: Direction = Direction.DOWN, duration: float = REFERENCE_DURATION
    ) -> float:
        """Return the rate [cd/m^2/s] of 75 % "yes" at an initial luminance [cd/m^2], over a duration [s]."""
        own = self.sensitivity * self.caution * self.level_factors.get(luminance, 1.0)
        own *= math.pow(duration / REFERENCE_DURATION, -self.amount_share)
        own *= self.up_ratio if direction is Direction.UP else 1.0
        return own * float(rate_limit_at(self.limit, luminance))

    def function_at(
        self,
        luminance: float,
        procedure: Procedure = Procedure.YES_NO,
        direction: Direction = Direction.DOWN,
        duration: float = REFERENCE_DURATION,
    ) -> PsychometricFunction:
        """Return the psychometric function at an initial luminance [cd/m^2], for what is asked and shown.

        The two ways of asking meet the same eye: what is right of two intervals follows from the yes/no
        function by signal detection (`method.psychometric`).
        """
        yes_no = PsychometricFunction(
            self.threshold_at(luminance, direction, duration), self.width, self.guess_rate, self.lapse_rate
        )
        return two_interval_function(yes_no) if procedure is Procedure.TWO_INTERVAL else yes_no

    def answer(self, ramp: PlannedTrial, rng: np.random.Generator) -> Response:
        """Return the answer to a trial: "did it change?", or, if it has two intervals, "in which?".

        Parameters
        ----------
        ramp : PlannedTrial
            The trial.
        rng : numpy.random.Generator
            Chance, of this trial alone.
        """
        two = ramp.ramp_interval is not None
        procedure = Procedure.TWO_INTERVAL if two else Procedure.YES_NO
        function = self.function_at(ramp.level.luminance, procedure, ramp.direction, ramp.duration)
        success = rng.random() < float(yes_probability(ramp.rate, function))
        if not two:
            return Response.YES if success else Response.NO
        return Response.FIRST if success == (ramp.ramp_interval == 1) else Response.SECOND


def two_interval_ratio(width: float, guess_rate: float, lapse_rate: float) -> float:
    """Return a person's two-interval threshold as a multiple of their yes/no one; it is the same at any rate.

    Parameters
    ----------
    width, guess_rate, lapse_rate : float
        In yes/no.
    """
    return two_interval_function(PsychometricFunction(1.0, width, guess_rate, lapse_rate)).threshold


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
        The median person's yes/no threshold over luminance.
    luminances : tuple of float
        Initial luminances of the session's levels [cd/m^2].
    rng : numpy.random.Generator
        Chance.
    population : ObserverPopulation, optional
        How participants differ.
    """
    people = population or ObserverPopulation()
    scatter = np.exp(people.level_sd * rng.standard_normal(len(luminances)))
    sensitivity = float(np.exp(people.participant_sd * rng.standard_normal()))
    width = float(people.width_median * np.exp(people.width_spread * rng.standard_normal()))
    guess_rate = min(float(rng.beta(*people.guess)), MAX_GUESS_RATE)
    lapse_rate = min(float(rng.beta(*people.lapse)), MAX_LAPSE_RATE)
    return SimulatedObserver(
        limit=limit,
        sensitivity=sensitivity,
        level_factors=dict(zip(luminances, scatter.tolist(), strict=True)),
        width=width,
        guess_rate=guess_rate,
        lapse_rate=lapse_rate,
        amount_share=people.amount_share,
        up_ratio=people.up_ratio,
        caution=people.median_two_interval_ratio / two_interval_ratio(width, guess_rate, lapse_rate),
    )
