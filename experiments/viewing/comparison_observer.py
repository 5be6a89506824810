"""Simulated participants of artifact comparison: they see brightness change with the thresholds of the ramps.

Which of two versions of a video showed a change in brightness? Each stretch of 5 s gives some evidence, the
d' of the fastest change in it by the person's own psychometric function of two intervals, and noise of
standard deviation 1; the version with the strongest evidence is chosen. The baseline's brightness does not
change, so it has only noise. Both have changes of their content, which hide those of the modulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy import special

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.assumed_effect import CHOSEN, CHOSEN_UNMASKED, AssumedEffect
from evenlight.data_schema.recordings.ramp import Direction, Procedure, Response
from evenlight.data_schema.recordings.viewing import Version
from evenlight.experiments.chance import Purpose
from evenlight.experiments.ramp.ramp_observer import (
    MEDIAN_RATE_LIMIT,
    ObserverPopulation,
    SimulatedObserver,
    draw_observer,
)
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.sessions.task import SessionSetting
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.experiments.viewing.brightness_changes import (
    STRETCH,
    BrightnessChanges,
    LuminanceCourse,
    changes_in_thresholds,
    luminance_course,
)
from evenlight.experiments.viewing.simulated_viewers import Viewing
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.psychometric import WIDTH_LOGITS, PsychometricFunction, threshold_logit
from evenlight.method.rate_limit import rate_limit_at

REFERENCE_LUMINANCE = 50.0  # [cd/m^2] any within a rate limit's range: thresholds keep their ratios elsewhere


@dataclass(frozen=True, slots=True)
class ComparisonPopulation:
    """Of whom simulated participants are drawn."""

    eyes: ObserverPopulation = field(default_factory=ObserverPopulation)  # how their thresholds differ
    # how much the content's own changes hide: beside one of c thresholds, the threshold of the modulation's
    # rises by sqrt(1 + (masking · c)²), so that by Weber's law for rates a change must be `masking` times as
    # fast as the content's. 0 for no masking. 1 is a choice: with it the four sequences are told apart from
    # their baselines about as rarely as in the paper (docs/decisions/simulated-viewers.md).
    masking: float = 1.0
    # standard deviation between persons of a leaning to the first interval, in units of d' (choice)
    bias_sd: float = 0.2


@dataclass(frozen=True, slots=True)
class ComparisonObserver:
    """A participant whose truth is known."""

    eye: SimulatedObserver  # as in the ramp experiment
    masking: float = 0.0  # how much the content's own changes hide
    bias: float = 0.0  # leaning to the first interval, in units of d'

    def thresholds(self, luminance: Array, direction: Direction, span: float) -> Array:
        """Return the two-interval thresholds of ramps [cd/m^2/s]; arguments as of `Thresholds`."""
        function = self._function(direction, span)
        ratio = rate_limit_at(self.eye.limit, luminance) / rate_limit_at(self.eye.limit, REFERENCE_LUMINANCE)
        return np.asarray(function.threshold * ratio)

    def evidence(self, course: LuminanceCourse, seconds: float | None = None) -> Array:
        """Return d' of each stretch of a video, (stretches,), masked by its content's own changes."""
        return self.evidence_of(changes_in_thresholds(course, self.thresholds, seconds))

    def evidence_of(self, changes: BrightnessChanges) -> Array:
        """Return d' of each stretch, given its changes in multiples of this person's threshold."""
        raised = np.hypot(1.0, self.masking * changes.content)
        return d_prime(changes.modulated / raised, self._function(Direction.DOWN, STRETCH))

    @property
    def threshold(self) -> float:
        """Two-interval threshold at the reference luminance [cd/m^2/s]; others are in proportion."""
        return self._function(Direction.DOWN, STRETCH).threshold

    def answer(self, evidence: Array, ours_interval: int, rng: np.random.Generator) -> Response:
        """Return which of the two versions is said to have changed in brightness.

        Parameters
        ----------
        evidence : array, (stretches,)
            d' of the modulated version, from `evidence`.
        ours_interval : int
            Which of the two is the modulated version, 1 or 2.
        rng : numpy.random.Generator
            Chance, of this trial alone.
        """
        noise = rng.standard_normal((2, len(evidence)))
        blind, coin = rng.random(2)
        ours, baseline = float(np.max(evidence + noise[0])), float(np.max(noise[1]))
        first, second = (ours, baseline) if ours_interval == 1 else (baseline, ours)
        says_first = coin < 0.5 if blind < self.eye.lapse_rate else first + self.bias > second
        return Response.FIRST if says_first else Response.SECOND

    def _function(self, direction: Direction, span: float) -> PsychometricFunction:
        """Return the two-interval function of ramps of a duration, at the reference luminance."""
        return self.eye.function_at(REFERENCE_LUMINANCE, Procedure.TWO_INTERVAL, direction, span)


def d_prime(multiples: Array, function: PsychometricFunction) -> Array:
    """Return d' of changes given in multiples of a two-interval threshold; lapses are left out.

    P(right) of who looks is 1/2 + F/2, F the rise of the psychometric function, and Φ(d'/√2) as well.

    >>> from evenlight.method.psychometric import WIDTH_LOGITS, PsychometricFunction
    >>> d_prime(np.array([0.0, 1.0]), PsychometricFunction(2.0, 1.6, guess_rate=0.5)).round(3).tolist()
    [0.0, 0.954]
    """
    with np.errstate(divide="ignore"):  # ln 0: no change, no evidence
        logit = threshold_logit(function.guess_rate) + WIDTH_LOGITS * np.log(multiples) / function.width
    wrong = np.maximum(special.expit(-logit) / 2, np.finfo(float).tiny)
    return np.asarray(-np.sqrt(2) * special.ndtri(wrong)) + 0.0  # not -0


def draw_comparer(
    limit: RateLimit, rng: np.random.Generator, population: ComparisonPopulation | None = None
) -> ComparisonObserver:
    """Return a participant drawn from a population.

    Parameters
    ----------
    limit : RateLimit
        The median person's yes/no threshold over luminance.
    rng : numpy.random.Generator
        Chance.
    population : ComparisonPopulation, optional
        How participants differ.
    """
    people = population or ComparisonPopulation()
    eye = draw_observer(limit, (), rng, people.eyes)
    return ComparisonObserver(eye, people.masking, float(people.bias_sd * rng.standard_normal()))


def chance_of_choice(evidence: Array) -> float:
    """Return how often the version with some evidence is chosen, without lapses and leanings.

    P(max(d'_k + ε_k) > max ε_j), all ε standard normal: one minus the integral over x of the probability that
    all d'_k + ε_k lie below x, against the density of the other maximum.

    >>> round(chance_of_choice(np.zeros(12)), 9)
    0.5
    >>> round(chance_of_choice(np.array([0.954])), 3)  # one stretch: a single choice of two intervals
    0.75
    """
    x = np.linspace(-8.0, 8.0 + float(np.max(evidence, initial=0.0)), 4001)
    n = len(evidence)
    below = np.prod(special.ndtr(x[:, None] - evidence), axis=1)
    density = n * np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi) * special.ndtr(x) ** (n - 1)
    return float(1 - np.trapezoid(below * density, x))


class ChangeViews:
    """How strongly some sequences change in brightness, as they are compared in their two versions.

    A person's thresholds are those of anybody, times a factor: so a sequence's changes are computed once.

    Parameters
    ----------
    stimuli : sequence of LoadedStimulus
        The sequences.
    display : Display
        What they are shown on.
    """

    def __init__(self, stimuli: Sequence[LoadedStimulus], display: Display) -> None:
        self.courses = {
            stimulus.name: luminance_course(stimulus.track, stimulus.factors(Version.OURS), display)
            for stimulus in stimuli
        }
        self._known: dict[tuple[Any, ...], BrightnessChanges] = {}

    def changes(
        self, person: ComparisonObserver, sequence: str, seconds: float | None = None
    ) -> BrightnessChanges:
        """Return the changes of a sequence's modulated version as a person sees them; the other has none.

        Parameters
        ----------
        person, sequence : ComparisonObserver, str
            Who sees what.
        seconds : float, optional
            How much of it is seen, from its beginning [s].
        """
        eye = person.eye
        anybody = ComparisonObserver(
            SimulatedObserver(eye.limit, 1.0, {}, 1.0, 0.0, 0.0, eye.amount_share, eye.up_ratio)
        )
        key = (sequence, seconds, eye.limit.name, eye.amount_share, eye.up_ratio)
        if key not in self._known:
            self._known[key] = changes_in_thresholds(self.courses[sequence], anybody.thresholds, seconds)
        known, keenness = self._known[key], anybody.threshold / person.threshold
        return BrightnessChanges(keenness * known.modulated, keenness * known.content)


@dataclass(frozen=True, slots=True)
class ComparisonViewing(Viewing):
    """Artifact comparison: answers are `Response.FIRST` and `Response.SECOND`."""

    views: ChangeViews
    limit: RateLimit
    population: ComparisonPopulation = field(default_factory=ComparisonPopulation)
    purposes: tuple[Purpose, Purpose] = (Purpose.COMPARER, Purpose.COMPARISONS)

    def draw(self, rng: np.random.Generator) -> ComparisonObserver:
        """Return a participant."""
        return draw_comparer(self.limit, rng, self.population)

    def answer(self, person: ComparisonObserver, planned: PlannedTrial, rng: np.random.Generator) -> Response:
        """Return which version is said to have changed in brightness."""
        changes = self.views.changes(person, planned.sequence, planned.seconds)
        return person.answer(person.evidence_of(changes), planned.ours_interval, rng)

    def truth(self, person: ComparisonObserver) -> dict[str, Any]:
        """Return a participant's traits, and how often they would choose each modulated version."""
        sequences = [
            {"sequence": name, "chosen_without_lapses": chance_of_choice(self._evidence(person, name))}
            for name in self.views.courses
        ]
        eye = {"sensitivity": person.eye.sensitivity, "lapse_rate": person.eye.lapse_rate}
        return {**eye, "masking": person.masking, "bias": person.bias, "sequences": sequences}

    def shared_truth(self) -> list[dict[str, Any]]:
        """Return whose thresholds the median person's are; how strong a change is depends on who sees it."""
        return [{"rate_limit": self.limit.name}]

    def assumed(self, setting: SessionSetting) -> tuple[AssumedEffect, ...]:
        """Return how often the population chooses ours, lapses included, and if nothing hid its changes."""
        people = self.population_sample()
        unmasked = [replace(person, masking=0.0) for person in people]
        return tuple(
            AssumedEffect(what, name, float(np.mean([self._chance(person, name) for person in who])), "1")
            for what, who in ((CHOSEN, people), (CHOSEN_UNMASKED, unmasked))
            for name in self.views.courses
        )

    def _chance(self, person: ComparisonObserver, name: str) -> float:
        """Return how often a person chooses the modulated version, which comes first as often as second."""
        evidence = self._evidence(person, name)
        sees = np.mean([chance_of_choice(evidence + leaning) for leaning in (person.bias, -person.bias)])
        return float((1 - person.eye.lapse_rate) * sees + person.eye.lapse_rate / 2)

    def _evidence(self, person: ComparisonObserver, name: str) -> Array:
        return person.evidence_of(self.views.changes(person, name))


def comparison_viewing(setting: SessionSetting) -> ComparisonViewing:
    """Return what simulated participants of a comparison see in a setting."""
    return ComparisonViewing(
        ChangeViews(setting.stimuli, setting.display), load_rate_limit(MEDIAN_RATE_LIMIT)
    )
