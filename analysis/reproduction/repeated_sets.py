"""How estimates scatter over many simulated data sets, beside what is true of the simulated population.

Of each data set only the primary estimate is taken, with its test: the mean difference of ratings (exact sign
flips), the share choosing ours (exact binomial), and the ratio of search times (log-normal model, by the
standard error).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from evenlight.analysis.comparison.comparison_shares import count_choices, estimate_share
from evenlight.analysis.inference.binomial_tests import ALPHA, DEFAULT_MARGIN
from evenlight.analysis.inference.exact_tests import sign_flip_test
from evenlight.analysis.rating.rating_pairs import paired_ratings
from evenlight.analysis.reproduction.published_effects import PublishedEffect, published_effect
from evenlight.analysis.search.search_models import version_effect
from evenlight.analysis.search.search_trials import search_table
from evenlight.analysis.session_loading import TaskData, task_data_of
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.assumed_effect import CHOSEN, RATED, TIME_RATIO, AssumedEffect
from evenlight.data_schema.recordings.ramp import Trial
from evenlight.method.one_blas_thread import one_blas_thread

NO_EFFECT = {RATED: 0.0, CHOSEN: 0.5, TIME_RATIO: 1.0}
Estimate = tuple[float, float]  # the effect, and p


class ViewingRepeater(Protocol):
    """Who answers a viewing experiment many times."""

    def __call__(
        self, task: str, stimuli: Path, people: tuple[int, int], display: str, sets: int
    ) -> tuple[tuple[AssumedEffect, ...], tuple[tuple[Trial, ...], ...]]:
        """Return what is true of the population, and the trials of data sets.

        Parameters
        ----------
        task, stimuli : str, Path
            Which experiment; a folder with a track per sequence.
        people : (int, int)
            How many, and the seed of the first data set.
        display : str
            Name or file of the display of those tracks.
        sets : int
            How many data sets.
        """


@dataclass(frozen=True, slots=True, eq=False)
class RepeatedEffect:
    """An effect that is assumed, and how it is estimated from S data sets.

    Attributes
    ----------
    assumed : AssumedEffect
        At the geometry of the reproduction.
    as_picture : float or None
        What is assumed where the sequences are a small picture.
    estimates, p_values : array (S,)
        Of each data set; NaN where it gives none.
    unmasked : float or None
        Of a choice: what would be assumed if the content's changes hid nothing.
    """

    assumed: AssumedEffect
    as_picture: float | None
    estimates: Array
    p_values: Array
    unmasked: float | None = None

    @property
    def published(self) -> PublishedEffect:
        """What the paper says of it."""
        return published_effect(self.assumed.what, self.assumed.group)

    @property
    def no_effect(self) -> float:
        """The value that means no difference between the versions."""
        return NO_EFFECT[self.assumed.what]

    @property
    def shown(self) -> float:
        """The estimate of the first data set, which the report shows."""
        return float(self.estimates[0])

    @property
    def mean(self) -> float:
        """Mean of the estimates that there are."""
        return float(np.nanmean(self.estimates))

    @property
    def significant(self) -> float:
        """Share of the data sets whose test is significant at 5 %."""
        return float(np.mean(self.p_values <= ALPHA))

    @property
    def share_of_published_sign(self) -> float | None:
        """Share of the data sets whose estimate has the published sign; None where none is published."""
        sign = self.published.sign
        return None if sign is None else float(np.mean(np.sign(self.estimates - self.no_effect) == sign))

    def middle(self) -> tuple[float, float]:
        """Return the ends of the middle 95 % of the estimates."""
        low, high = np.nanquantile(self.estimates, [0.025, 0.975])
        return float(low), float(high)


def repeated_effects(
    task: str,
    assumed: Sequence[AssumedEffect],
    sets: Sequence[Sequence[Trial]],
    of_pictures: Sequence[AssumedEffect] = (),
    mapped: Callable[..., Iterable[Any]] = map,
) -> list[RepeatedEffect]:
    """Return each assumed effect of a task with its estimates.

    Parameters
    ----------
    task, assumed : str, sequence of AssumedEffect
        Which experiment, and what is true of its population.
    sets : sequence of sequences of Trial
        The data sets.
    of_pictures : sequence of AssumedEffect
        What is true where the sequences are a small picture.
    mapped : callable, optional
        `map`, or one that shares the data sets among processes and keeps their order.
    """
    estimated = [effect for effect in assumed if effect.what in NO_EFFECT]
    groups = [effect.group for effect in estimated]
    found = np.array([*mapped(partial(_estimates, task, groups), sets)]).reshape(-1, len(groups), 2)
    pictures = {(effect.what, effect.group): effect.value for effect in of_pictures}
    others = {effect.group: effect.value for effect in assumed if effect.what not in NO_EFFECT}
    return [
        RepeatedEffect(
            assumed=effect,
            as_picture=pictures.get((effect.what, effect.group)),
            estimates=found[:, k, 0],
            p_values=found[:, k, 1],
            unmasked=others.get(effect.group),
        )
        for k, effect in enumerate(estimated)
    ]


@one_blas_thread
def _estimates(task: str, groups: Sequence[str], trials: Sequence[Any]) -> list[Estimate]:
    """Return the estimates of a data set."""
    return [*_ESTIMATES[task](trials, groups)]


def _ratings(trials: Sequence[Any], groups: Sequence[str]) -> Iterator[Estimate]:
    """Yield the mean difference of each sequence's ratings [rating points]."""
    for name in groups:
        pairs = paired_ratings(trials, name)
        yield float(pairs.values.mean()), sign_flip_test(pairs.scores).p_value


def _choices(trials: Sequence[Any], groups: Sequence[str]) -> Iterator[Estimate]:
    """Yield how often ours was chosen of each sequence."""
    for name in groups:
        choices = count_choices(trial for trial in trials if trial.sequence == name)
        yield choices.share, estimate_share(choices, DEFAULT_MARGIN).p_value


def _searches(trials: Sequence[Any], groups: Sequence[str]) -> Iterator[Estimate]:
    """Yield the ratio of search times of each sequence, or of the locations on one side."""
    data: TaskData[Any] = task_data_of("search", trials, simulated=True)
    table, _ = search_table(data)
    sequences = np.array([place.sequence for place in table.locations])
    sides = np.array([side.value for side in table.sides])
    for group in groups:
        effect = version_effect(table.some(((sequences == group) | (sides == group))[table.location]), False)
        ratio = math.nan if effect.estimate is None else math.exp(effect.estimate)
        yield ratio, math.nan if effect.p_value is None else effect.p_value


_ESTIMATES: dict[str, Callable[[Sequence[Any], Sequence[str]], Iterator[Estimate]]] = {
    "rating": _ratings,
    "comparison": _choices,
    "search": _searches,
}
