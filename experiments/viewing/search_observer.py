"""Simulated participants of the ring search: the further a ring is above threshold, the sooner it is found.

Search times are log-normal. Their median falls with the ring's visibility, grows with its eccentricity, and
has the person's own factor. A ring below threshold is mostly not found at all. All figures are choices
(docs/decisions/simulated-viewers.md); none was measured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.data_schema.recordings.search import ORIENTATIONS
from evenlight.experiments.ramp.ramp_observer import MAX_LAPSE_RATE

SHORTEST_TIME = 0.25  # [s] to see, decide and press
REFERENCE_ECCENTRICITY = 25.0  # [deg] where the median times hold; in the middle of a search's default range


@dataclass(frozen=True, slots=True)
class RingSight:
    """A ring as it is seen from where one stands."""

    visibility: float  # how far above threshold it is; 1 at threshold (`ring_views.ring_visibility`)
    eccentricity: float  # how far from the first direction of view it lies [deg]
    orientation: int  # where its gap is, counter-clockwise from the right [deg]
    background_luminance: float  # mean luminance around it at full brightness [cd/m^2]


@dataclass(frozen=True, slots=True)
class SearchAnswer:
    """What came of a search."""

    # when the key was pressed, since the scene appeared [s]; None if it was not, within the time limit
    found_after: float | None
    orientation: int | None  # reported direction of the gap; None where nothing was found


@dataclass(frozen=True, slots=True)
class SearchPopulation:
    """Of whom simulated participants are drawn; all figures are choices."""

    # median search time of a ring at threshold, at 25 deg [s]: as long as the time limit of the design
    threshold_time: float = 30.0
    # how the median falls with visibility v: as v^-gain. With 1, v = 10 takes a tenth, 3 s.
    gain: float = 1.0
    # by how much the logarithm of the time grows per degree: 0.02 makes 1.5 times as long of 20 deg more
    eccentricity_cost: float = 0.02
    time_sd: float = 0.6  # standard deviation of a time's logarithm from trial to trial
    # standard deviation between persons of the logarithm of their times, and of their visibilities
    speed_sd: float = 0.25
    sensitivity_sd: float = 0.2
    # ln(v) from 5 % to 95 % of rings that can be found at all; half of those at threshold can
    detection_width: float = 0.8
    gap_visibility: float = 1.2  # v at which the direction of the gap is identified half as well as it can be
    # Beta parameters of the share of searches without a ring seen in which the key is pressed all the same,
    # and of the share of known directions that are answered at random
    guess: tuple[float, float] = (1.0, 40.0)
    lapse: tuple[float, float] = (1.5, 60.0)


@dataclass(frozen=True, slots=True)
class SearchObserver:
    """A participant whose truth is known."""

    people: SearchPopulation  # what all of them have in common
    slowness: float = 1.0  # factor of their search times
    sensitivity: float = 1.0  # factor of the visibility that they see
    guess_rate: float = 0.0  # how often they press for nothing, of searches in which they see no ring
    lapse_rate: float = 0.0  # how often they report a random direction though they know the right one

    def median_time(self, sight: RingSight) -> float:
        """Return the median time after which a ring is found, if it can be found at all [s].

        >>> SearchObserver(SearchPopulation()).median_time(RingSight(10.0, 25.0, 90, 20.0))
        3.0
        """
        off = sight.eccentricity - REFERENCE_ECCENTRICITY
        seen = math.pow(self.sensitivity * sight.visibility, -self.people.gain)
        longer = math.exp(self.people.eccentricity_cost * off)
        return self.slowness * self.people.threshold_time * seen * longer

    def findable(self, sight: RingSight) -> float:
        """Return the probability that a ring can be found at all, however long one looks."""
        return self._rise(sight, 1.0)

    def identified(self, sight: RingSight) -> float:
        """Return the probability that the gap's direction is identified correctly, once the ring is found."""
        chance = 1 / len(ORIENTATIONS)
        return chance + (1 - chance) * (1 - self.lapse_rate) * self._rise(sight, self.people.gap_visibility)

    def answer(self, sight: RingSight, time_limit: float, rng: np.random.Generator) -> SearchAnswer:
        """Return what comes of a search.

        Parameters
        ----------
        sight : RingSight
            The ring, as `ring_views.RingViews` gives it.
        time_limit : float
            Of the search [s].
        rng : numpy.random.Generator
            Chance, of this trial alone.
        """
        can, guess, when, tells, which = rng.random(5)
        deviation = float(rng.standard_normal())
        if can < self.findable(sight):
            time = self.median_time(sight) * math.exp(self.people.time_sd * deviation)
            if time < time_limit:
                right = tells < self.identified(sight)
                return SearchAnswer(
                    max(time, SHORTEST_TIME), _reported_direction(sight.orientation, right, which)
                )
        if guess < self.guess_rate:
            return SearchAnswer(max(when * time_limit, SHORTEST_TIME), _random_direction(which))
        return SearchAnswer(None, None)

    def _rise(self, sight: RingSight, middle: float) -> float:
        """Return how far a logistic function of ln(visibility) has risen, 0 to 1."""
        seen = self.sensitivity * sight.visibility
        if seen <= 0:
            return 0.0
        return float(
            special.expit(2 * math.log(19.0) * math.log(seen / middle) / self.people.detection_width)
        )


def _reported_direction(orientation: int, right: bool, which: float) -> int:
    """Return the right direction, or one of the seven others."""
    if right:
        return orientation
    others = [other for other in ORIENTATIONS if other != orientation]
    return others[int(which * len(others))]


def _random_direction(which: float) -> int:
    return ORIENTATIONS[int(which * len(ORIENTATIONS))]


def draw_searcher(rng: np.random.Generator, population: SearchPopulation | None = None) -> SearchObserver:
    """Return a participant drawn from a population.

    Parameters
    ----------
    rng : numpy.random.Generator
        Chance.
    population : SearchPopulation, optional
        How participants differ.
    """
    people = population or SearchPopulation()
    slowness, sensitivity = rng.standard_normal(2)
    return SearchObserver(
        people=people,
        slowness=float(np.exp(people.speed_sd * slowness)),
        sensitivity=float(np.exp(people.sensitivity_sd * sensitivity)),
        guess_rate=min(float(rng.beta(*people.guess)), 0.5),
        lapse_rate=min(float(rng.beta(*people.lapse)), MAX_LAPSE_RATE),
    )
