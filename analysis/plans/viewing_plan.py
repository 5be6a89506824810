"""Planning a viewing experiment: participants for a wanted power.

Experiments are drawn from a stated truth and tested as `evenlight analyze` tests real data, a search in a
quicker form; beside the power stands how often a test finds what is not there. Where the outcomes can be
enumerated a test has its exact power, and nothing is drawn.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import optimize, special

from evenlight.analysis import figure_style as style
from evenlight.analysis.comparison.comparison_shares import equivalence_p, independent_error
from evenlight.analysis.inference.binomial_tests import (
    ALPHA,
    HALF,
    clopper_pearson,
    difference_power,
    equivalence_power,
)
from evenlight.analysis.inference.exact_tests import sign_flip_p_values
from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.inference.lognormal_times import CensoredTimes, fit_lognormal_times
from evenlight.analysis.plans.plan import Panel, Plan, frame_of, people_in_words, plan_figure
from evenlight.analysis.plans.questions import ComparisonTruth, RatingTruth, SearchTruth, Truth
from evenlight.analysis.rating.rating_power import LARGEST, fewest_pairs, likely_differences
from evenlight.analysis.report import KeyFigure
from evenlight.analysis.report_prose import prose
from evenlight.analysis.search.search_models import slowing
from evenlight.analysis.wording import of_track
from evenlight.data_schema.analysis_results import MOST_PARTICIPANTS, ViewingPlanRow
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.provenance import provenance_now
from evenlight.method.one_blas_thread import one_blas_thread

NUMBERS = np.arange(2, MOST_PARTICIPANTS + 1)
NEAR = 0.5  # share of the wanted power that some number tried must reach
NODES = 41  # of the normal distribution between participants
SEARCH_NODES = 5  # of the quadrature of a search: as assumed, p is that of nine to a millionth of itself
# Standard deviations of ln(time), as of simulated searchers (docs/decisions/simulated-viewers.md): of a
# search, between persons, between locations.
SEARCH_SD, PERSON_SD, LOCATION_SD = 0.6, 0.25, 0.4
Found = Mapping[tuple[float, int], Mapping[str, Array]]  # p values by effect and participants, and by test
Needed = tuple[int | None, int | None, int | None]  # participants, and the interval; None where not known


@dataclass(frozen=True, slots=True)
class PlannedTest:
    """A test whose power is wanted."""

    name: str  # what is tested, and how
    key: str  # its p values among those of an experiment
    effect: float  # true one with which the power is computed
    null: float  # the one at which nothing must be found
    level: float = ALPHA
    margin: float | None = None  # of an equivalence test
    exact: Callable[[ArrayLike, float, float], Array] | None = None  # power by participants, effect, level
    fewest: int = 2  # participants with whom it can find anything at all


def plan_viewing(
    truth: Truth,
    participants: Sequence[int],
    runs: int = 2000,
    seed: int = 1,
    mapped: Callable[..., Iterable[Any]] = map,
) -> Plan:
    """Return what so many participants would show, by so many simulated experiments of each number.

    `mapped` is a `map` over a list, whose calls may run at once.
    """
    draw_tests, _ = EXPERIMENTS[truth.task]
    tests, numbers = draw_tests(truth), sorted(participants)
    effects = dict.fromkeys(e for test in tests if not test.exact for e in (test.effect, test.null))
    works = [(truth, effect, (runs, n), seed) for effect in effects for n in reversed(numbers)]
    found = {
        (effect, n): own for (_, effect, (_, n), _), own in zip(works, mapped(_p_values, works), strict=True)
    }
    rows = []
    for test in tests:
        drawn = 0 if test.exact else runs
        power, error = ([_share(test, at, n, found) for n in numbers] for at in (test.effect, test.null))
        needed = _needed(test, numbers, [own[0] for own in power], drawn, truth.power)
        for n, held, erred in zip(numbers, power, error, strict=True):
            about = truth.task, test.name, n, test.effect, truth.unit, test.margin, test.level
            wanted = truth.power, held[0] >= truth.power
            rows.append(ViewingPlanRow(*about, *held, *erred, drawn, *wanted, *needed))
    return _plan(truth, tests, tuple(rows), runs, seed)


@one_blas_thread
def _p_values(work: tuple[Truth, float, tuple[int, int], int]) -> Mapping[str, Array]:
    """Return the p values of simulated experiments; their seed depends on nothing but what they are."""
    truth, effect, shape, seed = work
    label = int.from_bytes(f"{truth.task} {effect:.9g}".encode(), "big")
    _, p_values = EXPERIMENTS[truth.task]
    return p_values(truth, effect, shape, np.random.default_rng([seed, label, shape[1]]))


def _share(test: PlannedTest, effect: float, participants: int, found: Found) -> tuple[float, float, float]:
    """Return the share of experiments in which the test finds something, and its 95 % interval."""
    if test.exact is not None:
        return (float(np.clip(test.exact(participants, effect, test.level), 0.0, 1.0)),) * 3
    p_values = found[effect, participants][test.key]
    hits = int(np.sum(p_values <= test.level))
    return hits / p_values.size, *clopper_pearson(hits, p_values.size)


def _needed(
    test: PlannedTest, numbers: Sequence[int], power: Sequence[float], runs: int, wanted: float
) -> Needed:
    if test.exact is not None:
        lacking = np.flatnonzero(test.exact(NUMBERS, test.effect, test.level) < wanted)
        first = int(lacking[-1]) + 1 if lacking.size else 0  # from there on never below
        return (int(NUMBERS[first]) if first < NUMBERS.size else None,) * 3
    # With fewer than `fewest` the power is 0 whatever the effect: no point of a line.
    tried = [(n, share) for n, share in zip(numbers, power, strict=True) if n >= test.fewest]
    needed = needed_by_line([n for n, _ in tried], [share for _, share in tried], runs, wanted)
    middle, low, high = (None if n is None else max(n, test.fewest) for n in needed)
    return middle, low, high


def needed_by_line(participants: Sequence[int], power: Sequence[float], runs: int, wanted: float) -> Needed:
    """Return the number of participants at which simulated power reaches the wanted one, and its interval.

    The power of a test of a mean is Φ(a + b √N): a probit regression on √N takes all numbers that were tried
    together, and its 95 % band gives the interval. Half an experiment is added to either side, so that powers
    of 0 and 1 stay finite. Far from the powers that were tried the line says nothing: if none reaches half
    of the wanted power there is no number; if all are halfway from it to 1, it is the fewest tried.

    >>> numbers = [10, 20, 40]
    >>> power = special.ndtr(0.5 * np.sqrt(numbers) - 1.96)
    >>> needed_by_line(numbers, power, 10**6, 0.8)[0]  # (2.80 / 0.5)²
    32
    """
    import statsmodels.genmod.api as models  # half a second, and only needed here

    least, most = min(power, default=0.0), max(power, default=0.0)
    if len(participants) < 2 or least == most or least >= (1 + wanted) / 2:
        return (min(participants), 2, min(participants)) if least >= wanted else (None, None, None)
    if most < NEAR * wanted:
        return None, None, None
    hits = np.asarray(power) * runs
    probit = models.families.Binomial(models.families.links.Probit())
    design, at = (np.column_stack([np.ones(len(n)), np.sqrt(n)]) for n in (participants, NUMBERS))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of perfect separation: half an experiment keeps all finite
        fit = models.GLM(np.column_stack([hits + 0.5, runs - hits + 0.5]), design, family=probit).fit()
    line, half = at @ fit.params, 1.96 * np.sqrt(np.sum((at @ fit.cov_params()) * at, axis=1))
    enough = [np.flatnonzero(edge >= special.ndtri(wanted)) for edge in (line, line + half, line - half)]
    needed, low, high = (int(NUMBERS[found[0]]) if found.size else None for found in enough)
    return needed, low, high


def _plan(
    truth: Truth, tests: Sequence[PlannedTest], rows: tuple[ViewingPlanRow, ...], runs: int, seed: int
) -> Plan:
    """Return rows with their answer in words, and drawn: power, and below it the type I error."""
    wanted, title = f"{100 * truth.power:g} % power", f"{truth.title}: how many participants"
    needed = {row.test: people_in_words(row) for row in rows}
    answer = prose("plan_viewing", tests=tests, needed=needed, wanted=wanted, unit=of_track(truth.unit))
    (assumed,) = prose("plan_assumed", task=truth.task, truth=truth)
    kinds = {row.runs for row in rows}
    drawn = f"Simulated: {runs} experiments for each mark, bars 95 %" if any(kinds) else "Computed, not drawn"
    exact = "; marks without bars are exact" if len(kinds) > 1 else ""
    frame = frame_of(rows)
    frame[[f"{of}{end}" for of in ("power", "type_i_error") for end in ("", "_low", "_high")]] *= 100
    lines = {f"{test}: {people} for {wanted}": frame[frame.test == test] for test, people in needed.items()}
    panels = [
        [Panel("participants", "power", "power [% of experiments]", 100 * truth.power)],
        [Panel("participants", "type_i_error", "type I error [%]", 5.0)],
    ]
    with style.look():
        below = f"{drawn}{exact}. Assumed: {assumed}."
        figure, axes = plan_figure(title, below, lines, panels, [24.0, 9.0])
        for (own,) in panels:
            axes[own.y].set_ylim(0, max(12.0, 1.05 * frame[f"{own.y}_high"].max()))
    cards = tuple(KeyFigure(people, f"participants: {name}", wanted) for name, people in needed.items())
    about = {
        "task": truth.task,
        "power": truth.power,
        "runs": runs,
        "truth": asdict(truth),
        "truth_in_words": assumed,
    }
    said = (f"assumed: {assumed}", *answer)
    return Plan(title, rows, answer, said, cards[:4], about, provenance_now(seed), figure)


def _rating_tests(truth: RatingTruth) -> list[PlannedTest]:
    one = PlannedTest("difference, one sequence", "one", truth.difference, 0.0, fewest=fewest_pairs())
    if truth.sequences == 1:
        return [one]
    mean = replace(one, name=f"difference, mean of {truth.sequences} sequences", key="all")
    return [one, _first_of(one, truth.sequences), mean]


def _first_of(one: PlannedTest, sequences: int) -> PlannedTest:
    level = ALPHA / sequences
    name = f"{one.name} of {sequences} (the first step of Holm's correction)"
    return replace(one, name=name, level=level, fewest=fewest_pairs(level))


def _rating_p_values(
    truth: RatingTruth, effect: float, shape: tuple[int, int], rng: np.random.Generator
) -> Mapping[str, Array]:
    drawn = drawn_differences(truth, effect, shape, rng)
    return {"one": sign_flip_p_values(drawn[:, :, 0]), "all": sign_flip_p_values(drawn.sum(axis=2))}


def drawn_differences(
    truth: RatingTruth, effect: float, shape: tuple[int, int], rng: np.random.Generator
) -> NDArray[np.int64]:
    """Return differences of ratings, (runs, participants, sequences), of a mean and the true spread.

    Whole numbers of the distribution of largest entropy; a person's go together by a normal copula.
    """
    edges = np.cumsum(likely_differences(effect, truth.spread))[:-1]
    person, own = rng.standard_normal((*shape, 1)), rng.standard_normal((*shape, truth.sequences))
    normal = math.sqrt(truth.agreement) * person + math.sqrt(1 - truth.agreement) * own
    return np.asarray(np.searchsorted(edges, special.ndtr(normal)) - LARGEST, dtype=np.int64)


def _comparison_tests(truth: ComparisonTruth) -> list[PlannedTest]:
    once = truth.repetitions == 1  # several answers of one person depend on each other: nothing to enumerate
    margin, share = truth.margin, truth.true_share
    exact = difference_power if once else None
    one = PlannedTest("difference, one sequence", "one", share, HALF, exact=exact, fewest=fewest_pairs())

    def within(people: ArrayLike, effect: float, _level: float) -> Array:
        return equivalence_power(people, effect, margin)

    equal = PlannedTest(
        "equivalence, one sequence",
        "one equal",
        HALF,
        HALF + margin,
        margin=margin,
        exact=within if once else None,
    )
    if truth.sequences == 1:
        return [one, equal]
    every = f"all {truth.sequences} sequences"
    return [
        one,
        _first_of(one, truth.sequences),
        equal,
        replace(one, name=f"difference, {every}", key="all", exact=None),
        replace(equal, name=f"equivalence, {every}", key="all equal", exact=None),
    ]


def _comparison_p_values(
    truth: ComparisonTruth, effect: float, shape: tuple[int, int], rng: np.random.Generator
) -> Mapping[str, Array]:
    middle = person_in_the_middle(effect, truth.spread)
    share = special.expit(middle + truth.spread * rng.standard_normal(shape))  # of a person: in all sequences
    own = rng.binomial(truth.repetitions, share)
    others = rng.binomial((truth.sequences - 1) * truth.repetitions, share)
    found: dict[str, Array] = {}
    for name, chosen, sequences in (("one", own, 1), ("all", own + others, truth.sequences)):
        n = sequences * truth.repetitions
        found[name] = sign_flip_p_values(2 * chosen - n)
        found[f"{name} equal"] = clustered_equivalence(chosen / n, n, truth.margin)
    return found


def clustered_equivalence(shares: Array, answers: int, margin: float) -> Array:
    """Return p, (runs,), of the two one-sided t tests of `comparison_shares`, for many experiments at once.

    Participants have shares, (runs, participants), of so many answers each; a share within the margin of 1/2
    counts as 1/2. Where participants do not differ there is no standard error, no test, and p = 1.
    """
    people, share = shares.shape[1], shares.mean(axis=1)
    scatter = shares.std(axis=1, ddof=1) / math.sqrt(people)
    flat = scatter < 1e-12
    error = np.where(flat, 1.0, np.maximum(scatter, independent_error(share, people * answers)))
    return np.where(flat, 1.0, equivalence_p(share - HALF, error, people, margin))


def person_in_the_middle(share: float, spread: float) -> float:
    """Return the log-odds of a person in the middle, if the mean share of all people is `share`.

    >>> round(person_in_the_middle(0.75, 0.0), 9) == round(float(np.log(3)), 9)
    True
    """
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    weights = weights / weights.sum()

    def surplus(middle: float) -> float:
        return float(weights @ special.expit(middle + spread * nodes)) - share

    return 0.0 if share == HALF else float(optimize.brentq(surplus, -40.0, 40.0))


def _search_tests(truth: SearchTruth) -> list[PlannedTest]:
    where, margin = f"at {truth.locations} locations", truth.margin
    return [
        PlannedTest(f"faster, {where}", "faster", truth.ratio, 1.0),
        PlannedTest(f"not slower by the margin, {where}", "slower", 1.0, margin, margin=margin),
    ]


def _search_p_values(
    truth: SearchTruth, effect: float, shape: tuple[int, int], rng: np.random.Generator
) -> Mapping[str, Array]:
    found = [version_effect(truth, effect, shape[1], rng) for _ in range(shape[0])]
    slower = [slowing(one, math.log(truth.margin))[0] for one in found]
    return {
        "faster": np.array([1.0 if one.p_value is None else one.p_value for one in found]),
        "slower": np.array([1.0 if p is None else p for p in slower]),
    }


def version_effect(
    truth: SearchTruth, ratio: float, participants: int, rng: np.random.Generator
) -> FixedEffect:
    """Return the effect of ours on ln(time) that one simulated experiment finds.

    The model is that of the analysis (participants' intercepts and effects random, censored at the limit),
    but the locations' difficulty is known to it instead of estimated, and the test is by the standard error
    instead of the profile: a fit takes a thirtieth of the time, and p is the same to a tenth of itself.
    """
    ln_times, difficulty = (part.ravel() for part in drawn_searches(truth, ratio, participants, rng))
    ours = np.tile([0.0, 1.0], participants * truth.locations)
    data = CensoredTimes(
        times=np.exp(np.minimum(ln_times, 0.0)),
        observed=ln_times < 0.0,
        design=np.column_stack([ours, np.ones(ours.size), difficulty]),
        names=("ours", "intercept", "difficulty"),
        groups=np.repeat(np.arange(participants), 2 * truth.locations),
        slope_column=0,
    )
    return fit_lognormal_times(data, profiled=(), nodes=SEARCH_NODES).effects[0]


def drawn_searches(
    truth: SearchTruth, ratio: float, participants: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return ln(time / time limit) and the location's difficulty, (participants, locations, 2).

    Of the two versions the baseline is the first.
    """
    shape = (participants, truth.locations, 2)
    difficulty = np.broadcast_to(LOCATION_SD * rng.standard_normal((1, truth.locations, 1)), shape)
    person = PERSON_SD * rng.standard_normal((participants, 1, 1))
    effect = math.log(ratio) + truth.spread * rng.standard_normal((participants, 1, 1))
    scatter = math.hypot(SEARCH_SD, PERSON_SD, LOCATION_SD)
    middle = -scatter * float(special.ndtri(min(1 - truth.undetected, 1 - 1e-12)))
    noise = SEARCH_SD * rng.standard_normal(shape)
    return middle + difficulty + person + effect * np.array([0.0, 1.0]) + noise, difficulty


# Of each task its tests, and the p values by test, (runs,), of experiments of a shape (runs, participants).
EXPERIMENTS: dict[str, tuple[Callable[..., list[PlannedTest]], Callable[..., Mapping[str, Array]]]] = {
    "rating": (_rating_tests, _rating_p_values),
    "comparison": (_comparison_tests, _comparison_p_values),
    "search": (_search_tests, _search_p_values),
}
