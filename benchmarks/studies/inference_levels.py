"""How often the primary tests err, and their intervals hold the truth: docs/decisions/inference-levels.md.

Ratings, answers and search times come from generators that share no code with the simulated viewers, and do
not fit the models of the analysis: ratings are rounded and clipped, with Laplace-distributed people and
Student-distributed noise; choices are beta-binomial; search times are Weibull, of people with gamma frailties
and uniform effects, cut off at a limit. Trials go the way of `evenlight analyze`; the first of each
population also goes through `task_findings` as a whole, and must print the same numbers.

Run with `python benchmarks/studies/inference_levels.py [SETS] [TASK …]`; 400 sets take about ten minutes of
one core, nearly all for the search. Seed 31. No test here permutes at random: all are exact, or by
likelihood.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from studies import Mapped, run_study

from evenlight.analysis.comparison.comparison_shares import count_choices, estimate_share
from evenlight.analysis.dataset_findings import AnalysisOptions, task_findings
from evenlight.analysis.inference.exact_tests import sign_flip_test
from evenlight.analysis.inference.paired_effects import exact_mean_difference
from evenlight.analysis.rating.rating_pairs import over_sequences, paired_ratings
from evenlight.analysis.search.search_models import brightness_fit, informative, people_slope
from evenlight.analysis.search.search_numbers import LIKE_PEOPLE, SLOPE
from evenlight.analysis.search.search_pairs import clustered_share
from evenlight.analysis.search.search_trials import search_table
from evenlight.analysis.session_loading import TaskData, task_data_of
from evenlight.data_schema.recordings.ramp import Response
from evenlight.data_schema.recordings.search import SearchTrial
from evenlight.data_schema.recordings.viewing import ComparisonTrial, RatingTrial, Version

SEED = 31
NAMES = ("library", "gym", "living_room", "basement")
PEOPLE = (17, 8)
LOCATIONS, LIMIT = 12, 30.0
LN_RATIOS = np.linspace(0.4, -0.4, LOCATIONS)
TYPICAL_TIMES = 16 * np.random.default_rng(SEED).weibull(3.0, (LOCATIONS, 2))  # [s] at each place of a ring
FOUND = "rings found, ours"


@dataclass(frozen=True, slots=True)
class Answer:
    """What is printed of one question: p of the test (nan without one), and the ends of the interval."""

    p_value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Population:
    """Whom trials are drawn from, and what is true of them.

    Attributes
    ----------
    task, name : str
        Of the experiment, and in the table.
    draw : callable
        Trials of so many people.
    asked : callable
        What the analysis prints of them, by question.
    null : float
        What the tests test.
    effect : float
        How much there is; 0 where the null hypothesis is true.
    truths : mapping of str to float
        By question.
    """

    task: str
    name: str
    draw: Callable[[int, float, np.random.Generator], tuple]
    asked: Callable[[TaskData], dict[str, Answer]]
    null: float
    effect: float
    truths: Mapping[str, float]


def ratings(people: int, effect: float, rng: np.random.Generator) -> tuple[RatingTrial, ...]:
    """Return ratings of four sequences in two versions: a line with heavy-tailed noise, rounded, clipped."""
    level = 3.3 + rng.laplace(0.0, 0.5, people)
    own = effect * rng.gamma(4.0, 0.25, people)  # nobody has an effect where there is none
    stretch = rng.uniform(0.7, 1.3, people)
    trials = []
    for who in range(people):
        for k, name in enumerate(NAMES):
            first = (who + k) % 2
            for version in Version:
                ours = version is Version.OURS
                felt = level[who] + 0.3 * (k - 1.5) + own[who] * ours + stretch[who] * 0.5 * rng.standard_t(4)
                trials.append(
                    RatingTrial(
                        f"{who:02d}", "01", 2 * k + (ours != first), name, version, 1,
                        1 if ours == first else 2, 0.5, int(np.clip(np.rint(felt), 1, 5)), 1.0, False,
                    )
                )  # fmt: skip
    return tuple(trials)


def choices(people: int, effect: float, rng: np.random.Generator) -> tuple[ComparisonTrial, ...]:
    """Return one answer of each to four sequences: beta-binomial, with an intra-class correlation of 0.2."""
    share, spread = 0.5 + effect, 4.0  # 1 / (1 + 4) = 0.2
    own = rng.beta(spread * share, spread * (1 - share), people)
    trials = []
    for who in range(people):
        for k, name in enumerate(NAMES):
            interval, ours = 1 + (who + k) % 2, rng.random() < own[who]
            said = Response.FIRST if ours == (interval == 1) else Response.SECOND
            trials.append(
                ComparisonTrial(
                    f"{who:02d}", "01", k, name, 1, interval, 0.5, 0.5, said, None, False
                )
            )  # fmt: skip
    return tuple(trials)


def searches(people: int, effect: float, rng: np.random.Generator) -> tuple[SearchTrial, ...]:
    """Return searches at 12 locations in both versions: Weibull times, frail people, cut off at 30 s."""
    frailty = rng.gamma(6.0, 1 / 6.0, people)
    slope = effect + rng.uniform(-0.5, 0.5, people)
    trials = []
    for who in range(people):
        for half in (0, 1):
            for place, k in enumerate(rng.permutation(LOCATIONS)):
                ours, spot = (who + k + half) % 2 == 0, (who // 2 + k + half) % 2
                scale = TYPICAL_TIMES[k, spot] / frailty[who] ** (1 / 1.6)
                time = scale * rng.weibull(1.6) * np.exp(slope[who] * LN_RATIOS[k] * ours)
                trials.append(searched(who, half, int(place), int(k), int(spot), bool(ours), float(time)))
    return tuple(trials)


def searched(
    who: int, half: int, place: int, k: int, spot: int, ours: bool, time: float
) -> SearchTrial:  # one value for each thing that was drawn
    """Return a search as a session records it."""
    found = time <= LIMIT
    return SearchTrial(
        participant_id=f"{who:02d}", session_id="01", trial_index=half * LOCATIONS + place,
        sequence=NAMES[k % 4], keypoint=f"spot{k:02d}",
        version=Version.OURS if ours else Version.BASELINE,
        factor=0.5 * float(np.exp(LN_RATIOS[k] if ours else 0.0)), ring_place=1 + spot, ring_azimuth=20.0,
        ring_altitude=-5.0, ring_gap=10.0, ring_contrast=-0.15, shown_contrast=-0.15, ring_orientation=90,
        background_luminance=20.0, gap_pixels=6.0, time_limit=LIMIT, found=found,
        search_time=min(time, LIMIT), reported_orientation=90 if found else None,
        response_time=1.0 if found else None, simulated=False, block=half + 1,
    )  # fmt: skip


def rating_answers(data: TaskData) -> dict[str, Answer]:
    """What is printed of ratings: the gym, all sequences."""
    pairs = {name: paired_ratings(data.trials, name) for name in NAMES}
    pairs["all"] = over_sequences(list(pairs.values()))
    said = {}
    for name in ("gym", "all"):
        scores = pairs[name].scores
        effect = exact_mean_difference(scores, pairs[name].step)
        said[name] = Answer(
            sign_flip_test(scores).p_value, max(effect.ci_low, -4.0), min(effect.ci_high, 4.0)
        )
    return said


def comparison_answers(data: TaskData) -> dict[str, Answer]:
    """What is printed of a comparison: the gym, all sequences."""
    said = {}
    for name, trials in (("gym", [t for t in data.trials if t.sequence == "gym"]), ("all", data.trials)):
        found = estimate_share(count_choices(trials), 0.15).difference
        ends = (np.nan if end is None else end for end in (found.ci_low, found.ci_high))
        said[name] = Answer(found.p_value, *ends)
    return said


def search_answers(data: TaskData) -> dict[str, Answer]:
    """What is printed of a search: the slope over people, and the share found."""
    table = search_table(data)[0]
    ours = table.some(table.ours)
    slope, share = (
        people_slope(brightness_fit(informative(table))),
        clustered_share(ours.found, ours.participant),
    )
    low = -np.inf if slope.ci_low is None else slope.ci_low
    high = np.inf if slope.ci_high is None else slope.ci_high
    p_value = np.nan if slope.p_value is None else slope.p_value
    return {SLOPE: Answer(p_value, low, high), FOUND: Answer(np.nan, share.ci_low, share.ci_high)}


ROWS = {  # where `task_findings` prints what was asked: table, group, what
    ("rating", "gym"): ("differences", "gym", "mean difference, ours less baseline"),
    ("rating", "all"): ("differences", "all", "mean difference, ours less baseline"),
    ("comparison", "gym"): ("shares", "gym", "ours chosen"),
    ("comparison", "all"): ("shares", "all", "ours chosen"),
    ("search", SLOPE): ("brightness", LIKE_PEOPLE, SLOPE),
    ("search", FOUND): ("detections", "all", FOUND),
}


def printed(task: str, data: TaskData) -> dict[str, Answer]:
    """Return the same answers as the rows of `task_findings`."""
    rows = task_findings(data, AnalysisOptions()).rows
    said = {}
    for (own, question), (table, group, what) in ROWS.items():
        if own == task:
            row = next(r for r in rows if (r.table, r.group, r.what) == (table, group, what))
            ends = (row.p_value, row.ci_low, row.ci_high)
            said[question] = Answer(*(np.nan if end is None else end for end in ends))
    return said


def mean_rating_differences(effect: float, many: float = 1.0) -> dict[str, float]:
    """Return the true mean differences of ratings, by many people: known to 0.005 / sqrt(many)."""
    if not effect:
        return {"gym": 0.0, "all": 0.0}
    trials = ratings(round(30_000 * many), effect, np.random.default_rng(SEED))
    said = {}
    for question in ("gym", "all"):
        own = [t for t in trials if question in ("all", t.sequence)]
        ours = np.array([t.version is Version.OURS for t in own])
        given = np.array([t.rating for t in own])
        said[question] = float(given[ours].mean() - given[~ours].mean())
    return said


def share_found(effect: float, many: float = 1.0) -> float:
    """Return the true share of rings found in ours, by many people: known to 0.003 / sqrt(many)."""
    trials = searches(round(2000 * many), effect, np.random.default_rng(SEED))
    return float(np.mean([t.found for t in trials if t.version is Version.OURS]))


def truths_of(task: str, effect: float, many: float = 1.0) -> dict[str, float]:
    """Return what is true of a population, by question."""
    if task == "rating":
        return mean_rating_differences(effect, many)
    if task == "comparison":
        return dict.fromkeys(("gym", "all"), 0.5 + effect)
    return {SLOPE: effect, FOUND: share_found(effect, many)}


TASKS: dict[str, tuple[Callable[..., tuple], Callable[[TaskData], dict[str, Answer]], dict[str, float]]] = {
    "rating": (ratings, rating_answers, {"no effect": 0.0, "effect": 0.5}),
    "comparison": (
        choices,
        comparison_answers,
        {"no effect": 0.0, "effect": 0.2, "nearly all ours": 0.45},
    ),
    "search": (searches, search_answers, {"no effect": 0.0, "effect": -0.8}),
}


def populations(tasks: Sequence[str], many: float = 1.0) -> Iterator[Population]:
    """Yield the populations of some tasks, with what is true of them by a share of the usual many people."""
    for task in tasks:
        draw, asked, effects = TASKS[task]
        null = 0.5 if task == "comparison" else 0.0
        for name, effect in effects.items():
            yield Population(task, name, draw, asked, null, effect, truths_of(task, effect, many))


@dataclass(frozen=True, slots=True)
class Rates:
    """How often p is below 5 %, how often the interval holds the truth, and how often both contradict."""

    rejected: float
    held: float
    contradictions: int


def answers_of(population: Population, people: int, run: int) -> dict[str, Answer]:
    """Return what is printed of a set; of the first it is compared with the report."""
    number = sum(map(ord, population.task + population.name))
    rng = np.random.default_rng([SEED, number, people, run])
    data = task_data_of(population.task, population.draw(people, population.effect, rng))
    said = population.asked(data)
    if run == 0:
        agree(said, printed(population.task, data))
    return said


def rates(population: Population, people: int, sets: int, mapped: Mapped = map) -> dict[str, Rates]:
    """Return the rates of so many sets of so many people, by question."""
    said = [*mapped(partial(answers_of, population, people), range(sets))]
    return {question: _rates([s[question] for s in said], population, truth)
            for question, truth in population.truths.items()}  # fmt: skip


def agree(said: Mapping[str, Answer], rows: Mapping[str, Answer]) -> None:
    """Refuse to go on if the report prints other numbers."""
    for question, one in said.items():
        own = [[a.p_value, *np.clip([a.low, a.high], -1e9, 1e9)] for a in (one, rows[question])]
        np.testing.assert_allclose(*own, rtol=1e-9, atol=1e-12, equal_nan=True, err_msg=question)


def _rates(answers: list[Answer], population: Population, truth: float) -> Rates:
    """Return the rates of one question."""
    p, low, high = np.array([(a.p_value, a.low, a.high) for a in answers], dtype=np.float64).T
    beside = (low > population.null) | (high < population.null)
    return Rates(
        rejected=float(np.mean(p < 0.05)) if np.isfinite(p).any() else float("nan"),
        held=float(np.mean((low <= truth) & (truth <= high))),
        contradictions=int(np.sum((p < 0.05) != beside)) if np.isfinite(p).any() else 0,
    )


def error(share: float, sets: int) -> float:
    """Return the Monte Carlo standard error of a share."""
    return float(np.sqrt(share * (1 - share) / sets))


def percent(share: float, sets: int) -> str:
    """Return a share with its Monte Carlo standard error; a dash for what was not tested."""
    return "–" if np.isnan(share) else f"{100 * share:.1f} ± {100 * error(share, sets):.1f} %"


def main(sets: int, tasks: Sequence[str], mapped: Mapped = map) -> None:
    """Print the table."""
    print(f"{sets} sets of each; ±: Monte Carlo standard error\n")
    columns = ("task", "question", "truth", "people", "p < 5 %", "interval holds it", "contradictions")
    print(f"| {' | '.join(columns)} |\n|" + "---|" * len(columns))
    for population in populations(tasks):
        for people in PEOPLE:
            for question, found in rates(population, people, sets, mapped).items():
                truth = f"{population.name}: {population.truths[question]:.3g}"
                cells = (percent(found.rejected, sets), percent(found.held, sets), str(found.contradictions))
                row = (population.task, question, truth, str(people), *cells)
                print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    run_study(
        __file__, lambda parser: parser.add_argument("tasks", nargs="*", default=tuple(TASKS)), sets=400
    )
