"""Simulated participants of the three viewing experiments, drawn and asked in one way.

What somebody answers is a function of seed, participant and trial alone, so that participant k is the same
however many there are, and a session that was interrupted goes on as it would have.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.ramp import Response
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.rig import Actuator
from evenlight.data_schema.search import ORIENTATIONS, SearchDesign
from evenlight.data_schema.viewing import ComparisonDesign, RatingDesign
from evenlight.experiments.brightness_changes import ChangeViews
from evenlight.experiments.comparison_observer import (
    ComparisonObserver,
    ComparisonPopulation,
    chance_of_choice,
    draw_comparer,
)
from evenlight.experiments.keyed_chance import Purpose, generator_for
from evenlight.experiments.rating_observer import DetailViews, RatingObserver, RatingPopulation, draw_rater
from evenlight.experiments.ring_views import OffscreenPainter, RingViews, picture_side
from evenlight.experiments.search_observer import (
    SearchAnswer,
    SearchObserver,
    SearchPopulation,
    draw_searcher,
)
from evenlight.experiments.search_schedule import PlannedSearch
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.experiments.viewing_schedule import PlannedComparison, PlannedRating
from evenlight.method.preset_files import load_rate_limit
from evenlight.stimuli.landolt import Ring
from evenlight.stimuli.ring_place_files import PRACTICE_SIZE

POPULATION = "surace2025"  # whose rate limit is the median person's yes/no threshold
ViewingDesign = RatingDesign | ComparisonDesign | SearchDesign


class Viewing(Protocol):
    """What simulated participants of one experiment see, and of whom they are drawn."""

    @property
    def purposes(self) -> tuple[Purpose, Purpose]:
        """What the random numbers of a person, and of an answer, are for."""

    @property
    def population(self) -> Any:
        """How participants differ."""

    def draw(self, rng: np.random.Generator) -> Any:
        """Return a participant."""

    def answer(self, person: Any, planned: Any, rng: np.random.Generator) -> Any:
        """Return what a participant answers to a trial."""

    def truth(self, person: Any) -> dict[str, Any]:
        """Return what is true of a participant, for the file beside the data."""

    def shared_truth(self) -> list[dict[str, Any]]:
        """Return what is true of the stimuli, whoever sees them."""


@dataclass(frozen=True, slots=True)
class RatingViewing:
    """Detail rating: answers are ratings from 1 to 5."""

    views: DetailViews
    population: RatingPopulation = field(default_factory=RatingPopulation)
    purposes: tuple[Purpose, Purpose] = (Purpose.RATER, Purpose.RATINGS)

    def draw(self, rng: np.random.Generator) -> RatingObserver:
        """Return a rater."""
        return draw_rater(rng, self.population)

    def answer(self, person: RatingObserver, planned: PlannedRating, rng: np.random.Generator) -> int:
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


@dataclass(frozen=True, slots=True)
class ComparisonViewing:
    """Artifact comparison: answers are `Response.FIRST` and `Response.SECOND`."""

    views: ChangeViews
    limit: RateLimit
    population: ComparisonPopulation = field(default_factory=ComparisonPopulation)
    purposes: tuple[Purpose, Purpose] = (Purpose.COMPARER, Purpose.COMPARISONS)

    def draw(self, rng: np.random.Generator) -> ComparisonObserver:
        """Return a participant."""
        return draw_comparer(self.limit, rng, self.population)

    def answer(
        self, person: ComparisonObserver, planned: PlannedComparison, rng: np.random.Generator
    ) -> Response:
        """Return which version is said to have changed in brightness."""
        evidence = person.evidence(self.views.of(planned), planned.seconds)
        return person.answer(evidence, planned.ours_interval, rng)

    def truth(self, person: ComparisonObserver) -> dict[str, Any]:
        """Return a participant's traits, and how often they would choose each modulated version."""
        sequences = [
            {"sequence": name, "chosen_without_lapses": chance_of_choice(person.evidence(course))}
            for name, course in self.views.courses.items()
        ]
        eye = {"sensitivity": person.eye.sensitivity, "lapse_rate": person.eye.lapse_rate}
        return {**eye, "masking": person.masking, "bias": person.bias, "sequences": sequences}

    def shared_truth(self) -> list[dict[str, Any]]:
        """Return whose thresholds the median person's are; how strong a change is depends on who sees it."""
        return [{"rate_limit": self.limit.name}]


@dataclass(frozen=True, slots=True)
class SearchViewing:
    """Ring search: answers are `SearchAnswer`."""

    views: RingViews
    time_limit: float
    population: SearchPopulation = field(default_factory=SearchPopulation)
    purposes: tuple[Purpose, Purpose] = (Purpose.SEARCHER, Purpose.SEARCHES)

    def draw(self, rng: np.random.Generator) -> SearchObserver:
        """Return a participant."""
        return draw_searcher(rng, self.population)

    def answer(
        self, person: SearchObserver, planned: PlannedSearch, rng: np.random.Generator
    ) -> SearchAnswer:
        """Return what comes of a search."""
        return person.answer(self.views.of(planned), self.time_limit, rng)

    def truth(self, person: SearchObserver) -> dict[str, Any]:
        """Return a participant's traits."""
        names = ("slowness", "sensitivity", "guess_rate", "lapse_rate")
        return {name: getattr(person, name) for name in names}

    def shared_truth(self) -> list[dict[str, Any]]:
        """Return how visible each ring is at each brightness factor, before the person's own sensitivity."""
        return self.views.table()


class SimulatedViewer:
    """One simulated participant of a viewing experiment.

    Parameters
    ----------
    viewing : Viewing
        What is seen.
    session : (int, int)
        Seed, and the participant's place in the data set.
    person : record, optional
        Who it is; else drawn from the population, by seed and place.
    """

    def __init__(self, viewing: Any, session: tuple[int, int], person: Any = None) -> None:
        self.viewing, self._session = viewing, session
        self.person = person or viewing.draw(generator_for(*session, viewing.purposes[0]))

    def answer(self, planned: Any, trial_index: int) -> Any:
        """Return the answer to a trial, always the same one."""
        chance = generator_for(*self._session, self.viewing.purposes[1], trial_index)
        return self.viewing.answer(self.person, planned, chance)

    def truth(self) -> dict[str, Any]:
        """Return what is true of the participant."""
        true: dict[str, Any] = self.viewing.truth(self.person)
        return true


@contextmanager
def open_viewing(
    design: ViewingDesign,
    stimuli: Sequence[LoadedStimulus],
    display: Display,
    actuator: Actuator = Actuator.PIXELS,
) -> Iterator[Viewing]:
    """Yield what simulated participants of an experiment see; the kind of the design says which one.

    The actuator matters to a search only: where pixels make the brightness, nothing is darker than black.

    Raises
    ------
    InputError
        If the stimuli lack something; for a search, if the machine has no OpenGL.
    """
    if isinstance(design, RatingDesign):
        yield RatingViewing(DetailViews(stimuli))
    elif isinstance(design, ComparisonDesign):
        yield ComparisonViewing(ChangeViews(stimuli, display), load_rate_limit(POPULATION))
    else:
        largest = Ring(0.0, 0.0, PRACTICE_SIZE * design.ring_gap, design.ring_contrast, ORIENTATIONS[0])
        with OffscreenPainter(display, picture_side(largest, display)) as painter:
            yield SearchViewing(RingViews(painter, display, actuator), design.time_limit)
