"""Simulated participants of detail rating: the more visible contrast a version keeps, the better it is rated.

How much detail a person finds in a video is taken to be what dimming has left of its visible contrast, by the
method's own model. What rating that makes is the person's own affair: everybody has four cut points on the
scale of what is left, and holds to them as well as memory goes (signal detection, Green & Swets 1966). All
figures of the population are choices (docs/decisions/simulated-viewers.md), none was measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import special

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.recordings.assumed_effect import RATED, AssumedEffect
from evenlight.data_schema.recordings.viewing import HIGHEST_RATING, LOWEST_RATING, Version
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.experiments.chance import Purpose
from evenlight.experiments.ramp.ramp_observer import MAX_LAPSE_RATE
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.sessions.task import SessionSetting
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.experiments.viewing.simulated_viewers import Viewing
from evenlight.method.contrast.curve_lookup import loss_at

# The worst stretches of a video weigh more in its quality than its mean (Rimac-Drlje, Vranjes & Zagar 2009):
# 1 would be the mean, infinity the worst frame alone. 4 is a choice between, usual where what can be seen is
# pooled (Quick 1974).
POOLING_EXPONENT = 4.0
RATINGS = np.arange(LOWEST_RATING, HIGHEST_RATING + 1)


def pooled_loss(curves: LossCurves, factors: Array, seconds: float | None = None) -> float:
    """Return the contrast loss of a whole video: the Minkowski mean of its frames' 𝓛_c, exponent 4.

    A frame weighs as much as it has visible contrast, and as long as it is shown: what is lost of a moment
    without detail is no loss to anybody.

    Parameters
    ----------
    curves : LossCurves
        Of the video's N frames.
    factors : array, (N,)
        b of each.
    seconds : float, optional
        How much of it is seen, from its beginning [s].

    Returns
    -------
    float
        In [0, 1]; 0 where nothing is visible anyway.
    """
    loss = np.minimum(loss_at(curves, factors), 1.0)
    weight = curves.visible_contrast * curves.durations
    if seconds is not None:
        weight = np.where(curves.times - curves.times[0] < seconds, weight, 0.0)
    if not weight.sum() > 0:
        return 0.0
    return float(np.average(loss**POOLING_EXPONENT, weights=weight) ** (1 / POOLING_EXPONENT))


class DetailViews:
    """What each version of some sequences loses of its visible contrast.

    Parameters
    ----------
    stimuli : sequence of LoadedStimulus
        The sequences, with their loss curves.

    Raises
    ------
    InputError
        If loss curves are missing, or are not those of the track.
    """

    def __init__(self, stimuli: Sequence[LoadedStimulus]) -> None:
        self._stimuli = {stimulus.name: stimulus for stimulus in stimuli}
        self._curves = {stimulus.name: _curves_of(stimulus) for stimulus in stimuli}
        self._known: dict[tuple[str, Version, float | None], float] = {}

    @property
    def losses(self) -> dict[tuple[str, Version], float]:
        """Pooled contrast loss of each whole sequence in each version."""
        return {(name, version): self._lost(name, version) for name in self._stimuli for version in Version}

    def of(self, planned: PlannedTrial) -> float:
        """Return the pooled contrast loss of what a trial shows."""
        return self._lost(planned.sequence, planned.versions[0], planned.seconds)

    def _lost(self, sequence: str, version: Version, seconds: float | None = None) -> float:
        """Return the pooled contrast loss of a version, computed once."""
        key = (sequence, version, seconds)
        if key not in self._known:
            factors = self._stimuli[sequence].factors(version)
            self._known[key] = pooled_loss(self._curves[sequence], factors, seconds)
        return self._known[key]


def _curves_of(stimulus: LoadedStimulus) -> LossCurves:
    """Return the loss curves of a sequence; refuse those of another track."""
    curves, track = stimulus.curves(), stimulus.track
    if curves.n_frames != len(track.factors):
        raise InputError(
            f"{stimulus.folder}: its loss curves are of {curves.n_frames} frames, its track of "
            f"{len(track.factors)}; make both with one run of `evenlight optimize`"
        )
    lowest = min(float(track.factors.min()), stimulus.stimulus.baseline_factor)
    if lowest < curves.factors[0] * (1 - 1e-9):
        raise InputError(
            f"{stimulus.folder}: its loss curves begin at the factor {curves.factors[0]:g}, and it is dimmed "
            f"to {lowest:g}; make them with --min-factor {lowest:g}"
        )
    return curves


@dataclass(frozen=True, slots=True)
class RatingPopulation:
    """Of whom simulated raters are drawn; all figures are choices.

    The unit of the scale is the share of visible contrast that is kept, 1 - sensitivity · pooled loss.
    """

    # what the median person wants kept for a 2, 3, 4 and 5
    cuts: tuple[float, float, float, float] = (0.78, 0.86, 0.925, 0.985)
    leniency_sd: float = 0.045  # standard deviation between persons of a common shift of all four
    spread_sd: float = 0.2  # standard deviation between persons of the logarithm of how far apart they lie
    sensitivity: float = 1.0  # how much a loss counts for the median person
    sensitivity_sd: float = 0.25  # standard deviation of its logarithm
    noise: float = 0.04  # standard deviation from trial to trial
    lapse: tuple[float, float] = (1.5, 60.0)  # Beta parameters of the share of trials that are rated blindly


@dataclass(frozen=True, slots=True)
class RatingObserver:
    """A rater whose truth is known."""

    cuts: tuple[float, float, float, float]  # what must be kept for a 2, 3, 4 and 5, rising
    sensitivity: float  # how much a loss counts
    noise: float  # standard deviation from trial to trial, above 0
    lapse_rate: float  # share of trials that are rated blindly, each rating as often

    def probabilities(self, loss: float) -> Array:
        """Return how often a video of some pooled loss is rated 1 to 5, (5,).

        >>> RatingObserver((0.4, 0.6, 0.8, 0.9), 1.0, 0.05, 0.0).probabilities(0.2).round(3).tolist()
        [0.0, 0.0, 0.5, 0.477, 0.023]
        """
        kept = 1 - self.sensitivity * loss
        at_least = special.ndtr((kept - np.array(self.cuts)) / self.noise)
        seen = -np.diff(np.concatenate([[1.0], at_least, [0.0]]))
        return np.asarray((1 - self.lapse_rate) * seen + self.lapse_rate / len(RATINGS))

    def answer(self, loss: float, rng: np.random.Generator) -> int:
        """Return the rating of a video.

        Parameters
        ----------
        loss : float
            Its pooled contrast loss, from `DetailViews`.
        rng : numpy.random.Generator
            Chance, of this trial alone.
        """
        if rng.random() < self.lapse_rate:
            return int(rng.choice(RATINGS))
        felt = 1 - self.sensitivity * loss + self.noise * float(rng.standard_normal())
        return LOWEST_RATING + sum(felt >= cut for cut in self.cuts)


def draw_rater(rng: np.random.Generator, population: RatingPopulation | None = None) -> RatingObserver:
    """Return a rater drawn from a population.

    Parameters
    ----------
    rng : numpy.random.Generator
        Chance.
    population : RatingPopulation, optional
        How raters differ.
    """
    people = population or RatingPopulation()
    shift, spread, sensitivity = rng.standard_normal(3)
    middle = float(np.mean(people.cuts))
    apart = float(np.exp(people.spread_sd * spread))
    first, second, third, fourth = (
        middle + people.leniency_sd * float(shift) + apart * (cut - middle) for cut in people.cuts
    )
    return RatingObserver(
        cuts=(first, second, third, fourth),
        sensitivity=float(people.sensitivity * np.exp(people.sensitivity_sd * sensitivity)),
        noise=people.noise,
        lapse_rate=min(float(rng.beta(*people.lapse)), MAX_LAPSE_RATE),
    )


@dataclass(frozen=True, slots=True)
class RatingViewing(Viewing):
    """Detail rating: answers are ratings from 1 to 5."""

    views: DetailViews
    population: RatingPopulation = field(default_factory=RatingPopulation)
    purposes: tuple[Purpose, Purpose] = (Purpose.RATER, Purpose.RATINGS)

    def draw(self, rng: np.random.Generator) -> RatingObserver:
        """Return a rater."""
        return draw_rater(rng, self.population)

    def answer(self, person: RatingObserver, planned: PlannedTrial, rng: np.random.Generator) -> int:
        """Return the rating of a video."""
        return person.answer(self.views.of(planned), rng)

    def truth(self, person: RatingObserver) -> dict[str, Any]:
        """Return a rater's traits, and how often each version gets each rating from them."""
        versions = [
            {
                "sequence": name,
                "version": version.value,
                "rating_probabilities": person.probabilities(loss).tolist(),
            }
            for (name, version), loss in self.views.losses.items()
        ]
        return {**mapping_from_record(person), "versions": versions}

    def shared_truth(self) -> list[dict[str, Any]]:
        """Return what each version loses of its visible contrast."""
        return [
            {"sequence": name, "version": version.value, "pooled_contrast_loss": loss}
            for (name, version), loss in self.views.losses.items()
        ]

    def assumed(self, setting: SessionSetting) -> tuple[AssumedEffect, ...]:
        """Return by how much the population rates ours higher on the mean, sequence by sequence."""
        losses, people = self.views.losses, self.population_sample()

        def mean_rating(name: str, version: Version) -> float:
            each = [person.probabilities(losses[name, version]) @ RATINGS for person in people]
            return float(np.mean(each))

        return tuple(
            AssumedEffect(
                RATED,
                each.name,
                mean_rating(each.name, Version.OURS) - mean_rating(each.name, Version.BASELINE),
                "rating points",
            )
            for each in setting.stimuli
        )


def rating_viewing(setting: SessionSetting) -> RatingViewing:
    """Return what simulated raters see in a setting."""
    return RatingViewing(DetailViews(setting.stimuli))
