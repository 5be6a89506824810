"""Planning a viewing experiment: participants for a wanted power, by the tests of its analysis.

For ratings and comparisons these are the analysis's own. A search is tested by a quicker form of its model
(`viewing_plan_search.version_effect`): it knows how hard the locations are, and tests by the standard error.
Experiments are drawn from a stated truth and tested as real data are; where the outcomes can be enumerated
they are, and nothing is drawn. Beside the power stands how often the test finds what is not there.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from evenlight.analysis.inference.binomial_tests import clopper_pearson
from evenlight.data_schema.analysis_results import MOST_PARTICIPANTS, ViewingPlanRow
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import require_seed
from evenlight.method.one_blas_thread import one_blas_thread

BEYOND_TRIED = "beyond what was tried"
Exact = Callable[[ArrayLike], Array]  # power, by number of participants
NUMBERS = np.arange(2, MOST_PARTICIPANTS + 1)
INTERVAL = 1.96  # standard errors: 95 %
NEAR = 0.5  # share of the wanted power that some number tried must reach


@dataclass(frozen=True, slots=True)
class PlannedTest:
    """A test whose power is wanted.

    Attributes
    ----------
    name, key : str
        What is tested, and how; its p values among those that `Truth.p_values` gives.
    effect, effect_unit : float, str
        True effect with which the power is computed, and its unit.
    null : float
        Effect at which the test must not find anything: none, or one at the margin.
    level, margin : float, float or None
        Of the test, and of an equivalence test.
    exact, exact_error : callable or None
        Power and type I error by number of participants, where they can be enumerated.
    fewest : int
        Participants with whom the test can find anything at all.
    """

    name: str
    key: str
    effect: float
    effect_unit: str
    null: float
    level: float
    margin: float | None = None
    exact: Exact | None = None
    exact_error: Exact | None = None
    fewest: int = 2


class Truth(Protocol):
    """What is true of the people of a simulated experiment, and what its answers are tested for."""

    @property
    def tests(self) -> tuple[PlannedTest, ...]:
        """The tests whose power is wanted."""

    @property
    def in_words(self) -> str:
        """What is true, and where that comes from."""

    def p_values(
        self, effect: float, participants: int, runs: int, rng: np.random.Generator
    ) -> Mapping[str, Array]:
        """Return p values of simulated experiments, (runs,), by the key of the test."""


@dataclass(frozen=True, slots=True)
class ViewingRequest:
    """What is to be planned.

    Attributes
    ----------
    task, truth : str, Truth
        "rating", "comparison" or "search", and what is true.
    participants, power : tuple of int, float
        How many are tried, and the power that is wanted.
    runs, seed : int
        Simulated experiments for each number, and the seed of all random numbers.
    """

    task: str
    truth: Truth
    participants: tuple[int, ...]
    power: float = 0.8
    runs: int = 2000
    seed: int = 1

    def __post_init__(self) -> None:
        if not 0 < self.power < 1:
            raise InputError(f"power must lie between 0 and 1, got {self.power:g}")
        if not self.participants or not all(2 <= n <= MOST_PARTICIPANTS for n in self.participants):
            got = ",".join(map(str, self.participants)) or "none"
            raise InputError(f"participants must be numbers from 2 to {MOST_PARTICIPANTS}, got {got}")
        require_seed(self.seed)


@dataclass(frozen=True, slots=True)
class ViewingPlan:
    """A plan: a row for each test and number of participants."""

    request: ViewingRequest
    rows: tuple[ViewingPlanRow, ...]

    @property
    def tests(self) -> tuple[str, ...]:
        """The names of the tests, in order."""
        return tuple(dict.fromkeys(row.test for row in self.rows))

    def rows_of(self, test: str) -> tuple[ViewingPlanRow, ...]:
        """Return the rows of a test, fewest participants first."""
        return tuple(row for row in self.rows if row.test == test)


@dataclass(frozen=True, slots=True)
class _Batch:
    """Experiments of one size with one true effect: what is simulated at once."""

    request: ViewingRequest
    effect: float
    participants: int


@one_blas_thread
def _p_values(work: _Batch) -> Mapping[str, Array]:
    """Return the p values of simulated experiments; their seed depends on nothing but what they are."""
    request = work.request
    label = int.from_bytes(f"{request.task} {work.effect:.9g}".encode(), "big")
    rng = np.random.default_rng([request.seed, label, work.participants])
    return request.truth.p_values(work.effect, work.participants, request.runs, rng)


@dataclass(frozen=True, slots=True)
class _Share:
    """A share of experiments with its 95 % confidence interval."""

    value: float
    low: float
    high: float


def plan_viewing(
    request: ViewingRequest,
    mapped: Callable[..., Iterable[Any]] = map,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> ViewingPlan:
    """Return what so many participants would show.

    Parameters
    ----------
    request, mapped : ViewingRequest, and optional a callable
        What is to be planned, and a `map`, whose calls may run at once.
    report : callable, optional
        Called with what is done, and of how much.
    """
    tests = request.truth.tests
    numbers = sorted(request.participants)
    drawn = [test for test in tests if test.exact is None]
    effects = list(dict.fromkeys(e for test in drawn for e in (test.effect, test.null)))
    works = [_Batch(request, effect, n) for effect in effects for n in reversed(numbers)]
    found: dict[tuple[float, int], Mapping[str, Array]] = {}
    for work, p_values in zip(works, mapped(_p_values, works), strict=True):
        found[work.effect, work.participants] = p_values
        report(len(found), len(works))
    rows = []
    for test in tests:
        power, error = ([_share_of(test, at, n, found) for n in numbers] for at in (test.effect, test.null))
        needed = _needed(test, request, numbers, power)
        rows += [_row(request, test, n, power[k], error[k], needed) for k, n in enumerate(numbers)]
    return ViewingPlan(request, tuple(rows))


def _share_of(
    test: PlannedTest,
    effect: float,
    participants: int,
    found: Mapping[tuple[float, int], Mapping[str, Array]],
) -> _Share:
    """Return how often a test finds something at an effect."""
    if test.exact is not None and test.exact_error is not None:
        exact = test.exact if effect == test.effect else test.exact_error
        value = float(np.clip(exact(participants), 0.0, 1.0))
        return _Share(value, value, value)
    p_values = found[effect, participants][test.key]
    hits = int(np.sum(p_values <= test.level))
    return _Share(hits / p_values.size, *clopper_pearson(hits, p_values.size))


def _needed(
    test: PlannedTest, request: ViewingRequest, numbers: list[int], power: list[_Share]
) -> ParticipantsNeeded:
    """Return how many participants a test needs."""
    if test.exact is not None:
        return exactly_needed(test.exact, request.power)
    # With fewer than `fewest` the power is 0 whatever the effect: no point of a line.
    tried = [(n, share.value) for n, share in zip(numbers, power, strict=True) if n >= test.fewest]
    found = needed_by_line([n for n, _ in tried], [p for _, p in tried], request.runs, request.power)
    ends = (None if n is None else max(n, test.fewest) for n in (found.participants, found.low, found.high))
    return ParticipantsNeeded(*ends)


def _row(
    request: ViewingRequest,
    test: PlannedTest,
    participants: int,
    power: _Share,
    error: _Share,
    needed: ParticipantsNeeded,
) -> ViewingPlanRow:
    """Return a row of the plan."""
    return ViewingPlanRow(
        task=request.task,
        test=test.name,
        participants=participants,
        effect=test.effect,
        effect_unit=test.effect_unit,
        margin=test.margin,
        level=test.level,
        power=power.value,
        power_low=power.low,
        power_high=power.high,
        type_i_error=error.value,
        type_i_error_low=error.low,
        type_i_error_high=error.high,
        runs=request.runs if test.exact is None else 0,
        wanted_power=request.power,
        meets=power.value >= request.power,
        participants_needed=needed.participants,
        participants_needed_low=needed.low,
        participants_needed_high=needed.high,
    )


def in_words(plan: ViewingPlan) -> tuple[str, ...]:
    """Return what the plan comes to, a sentence for each test."""
    wanted = f"{100 * plan.request.power:g} % power"
    sentences = []
    for name in plan.tests:
        row = plan.rows_of(name)[-1]
        effect = f"{row.effect:g} {row.effect_unit}"
        within = "" if row.margin is None else f", margin {row.margin:g}"
        needed = f"{needed_in_words(row)} participants"
        if needed.startswith(BEYOND_TRIED):
            needed = f"participants {BEYOND_TRIED}"
        sentences.append(f"{name}: {needed} for {wanted} ({effect}{within})")
    return tuple(sentences)


def needed_in_words(row: ViewingPlanRow) -> str:
    """Return how many participants are needed, with the interval that the simulation leaves."""
    low, needed, high = row.participants_needed_low, row.participants_needed, row.participants_needed_high
    beyond = f"above {MOST_PARTICIPANTS}"
    if low is None:
        return BEYOND_TRIED if row.runs else beyond
    if low == needed == high:
        return str(needed)
    return f"{needed or beyond} ({low} to {high or beyond})"


@dataclass(frozen=True, slots=True)
class ParticipantsNeeded:
    """How many participants are needed, and its 95 % confidence interval; None beyond 1000 or the tried."""

    participants: int | None
    low: int | None
    high: int | None


def exactly_needed(power: Callable[[ArrayLike], NDArray[np.float64]], wanted: float) -> ParticipantsNeeded:
    """Return the number of participants from which on an exact power never falls below the wanted one."""
    lacking = np.flatnonzero(power(NUMBERS) < wanted)
    if lacking.size and lacking[-1] == NUMBERS.size - 1:
        return ParticipantsNeeded(None, None, None)
    number = int(NUMBERS[lacking[-1] + 1]) if lacking.size else int(NUMBERS[0])
    return ParticipantsNeeded(number, number, number)


def needed_by_line(
    participants: Sequence[int], power: Sequence[float], runs: int, wanted: float
) -> ParticipantsNeeded:
    """Return the number of participants at which simulated power reaches the wanted one.

    The power of a test of a mean is Φ(a + b √N): a probit regression on √N takes all numbers that were tried
    together, and its 95 % band gives the interval. Half an experiment is added to either side, so that powers
    of 0 and 1 stay finite. Far from the powers that were tried the line says nothing: if none reaches half
    of the wanted power there is no number; if all are halfway from it to 1, it is the fewest tried.

    Parameters
    ----------
    participants, power : sequence of int, sequence of float
        Numbers that were tried, and the share of experiments that found something.
    runs, wanted : int, float
        Experiments of each number, and the wanted power.

    >>> numbers = [10, 20, 40]
    >>> power = special.ndtr(0.5 * np.sqrt(numbers) - 1.96)
    >>> needed_by_line(numbers, power, 10**6, 0.8).participants  # (2.80 / 0.5)²
    32
    """
    import statsmodels.genmod.api as models  # half a second, and only needed here

    hits = np.asarray(power) * runs
    counts = np.column_stack([hits + 0.5, runs - hits + 0.5])
    too_high = min(power, default=0.0) >= (1 + wanted) / 2
    if len(participants) < 2 or np.ptp(power) == 0 or too_high:
        return _of_one(participants, power, wanted)
    if max(power) < NEAR * wanted:
        return ParticipantsNeeded(None, None, None)
    probit = models.families.Binomial(models.families.links.Probit())
    design = np.column_stack([np.ones(len(participants)), np.sqrt(participants)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of perfect separation: half an experiment keeps all finite
        fit = models.GLM(counts, design, family=probit).fit()
    at = np.column_stack([np.ones(NUMBERS.size), np.sqrt(NUMBERS)])
    line = at @ fit.params
    half = INTERVAL * np.sqrt(np.sum((at @ fit.cov_params()) * at, axis=1))
    return ParticipantsNeeded(
        *(_first(edge >= special.ndtri(wanted)) for edge in (line, line + half, line - half))
    )


def _of_one(participants: Sequence[int], power: Sequence[float], wanted: float) -> ParticipantsNeeded:
    """Return what powers say that give no line: the fewest that were tried, if they are enough."""
    if min(power, default=0.0) < wanted:
        return ParticipantsNeeded(None, None, None)
    fewest = min(participants)
    return ParticipantsNeeded(fewest, 2, fewest)


def _first(enough: NDArray[np.bool_]) -> int | None:
    """Return the first number that is enough."""
    found = np.flatnonzero(enough)
    return int(NUMBERS[found[0]]) if found.size else None
