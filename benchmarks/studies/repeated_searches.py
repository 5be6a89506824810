"""How often the tests of repeated searches err where nothing is to be found, and their intervals miss.

Run with `python benchmarks/studies/repeated_searches.py [EXPERIMENTS]`. In each experiment 12 people search 6
locations several times in both versions, in random order. Their times are log-normal; people differ in level,
in what the version and brightness do, and by location in both; some searches reach the time limit, and some
end with a wrong answer. The table of docs/decisions/repeated-searches.md.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np
from made_searches import SearchTruth, made_locations
from numpy.typing import NDArray
from scipy import optimize, stats
from search_level import BOTH, LOCATIONS, Told, levels, print_levels, told
from studies import Mapped, run_study

from evenlight.analysis.inference.survival_curves import kaplan_meier
from evenlight.analysis.search.search_models import (
    BRIGHTNESS,
    VERSION,
    brightness_fit,
    effect_of,
    effects_by_location,
    for_people_and_locations,
    informative,
    line_over_locations,
    version_fit,
)
from evenlight.analysis.search.search_pairs import (
    clustered_share,
    detection_change,
    exchanged,
    hazard_ratio,
    matched_pairs,
)
from evenlight.analysis.search.search_trials import SearchTable

SEED = 43
QUESTIONS = (
    "version (times)",
    "brightness, over people",
    "at equal brightness",
    "one location",
    LOCATIONS,
    BOTH,
    "hazard ratio (Cox)",
    "found first (exact)",
    "rings found",
    "share found",
    "median",
)
(VERSIONS, PEOPLE, CHECK, PLACE, _, _, HAZARD, FIRST, CHANGE, SHARE, MEDIAN) = QUESTIONS


@dataclass(frozen=True, slots=True)
class RepeatedTruth:
    """What is true of people, locations, versions and searches; effects and scatters are in ln(time).

    `fewest` to `most` searches of a person at a location in a version, but `busiest` of the first person,
    if above 0; `middle` and `time_limit` in s; `person_location_sd` of the level, `three_way_sd` of the
    version's effect, of a person at a location.
    """

    people: int = 12
    locations: int = 6
    fewest: int = 8
    most: int = 8
    busiest: int = 0
    version: float = 0.0
    brightness: float = 0.0
    person_sd: float = 0.3
    version_sd: float = 0.0
    brightness_sd: float = 0.0
    location_sd: float = 0.0
    person_location_sd: float = 0.0
    three_way_sd: float = 0.0
    trial_sd: float = 0.5
    middle: float = 1.0
    time_limit: float = 2.5
    wrong: float = 0.05
    practice: float = -0.002


DIFFERENT = RepeatedTruth(version_sd=0.1, brightness_sd=0.2, person_location_sd=0.15, three_way_sd=0.08)
MODELS = (VERSIONS, PEOPLE, CHECK, PLACE)
PAIRS = (HAZARD, FIRST, CHANGE, SHARE, MEDIAN)
# Over locations, a slope has a truth of its own, which a scatter of locations changes for these very ones.
SCENARIOS: dict[str, tuple[RepeatedTruth, tuple[str, ...]]] = {
    "all alike": (RepeatedTruth(), QUESTIONS),
    "people differ": (DIFFERENT, (*MODELS, *PAIRS)),
    "twice each": (replace(DIFFERENT, fewest=2, most=2), (*MODELS, *PAIRS)),
    "2 to 16 each": (replace(DIFFERENT, fewest=2, most=16), (*MODELS, *PAIRS[:3])),
    "2 each, one 20": (replace(DIFFERENT, people=8, fewest=2, most=2, busiest=20), MODELS),
    "locations differ too": (replace(DIFFERENT, location_sd=0.15), (BOTH,)),
    "an effect": (replace(DIFFERENT, version=-0.1, brightness=-0.3), (VERSIONS, PEOPLE, PLACE)),
}


def repeated_table(truth: RepeatedTruth, rng: np.random.Generator) -> SearchTable:
    """Return the searches of people drawn at random."""
    people, places = truth.people, truth.locations
    grid = np.meshgrid(range(people), range(places), (0, 1), indexing="ij")
    own = rng.integers(truth.fewest, truth.most + 1, people)
    own[0] = truth.busiest or own[0]
    each = own[grid[0].ravel()]
    p, k, ours = (np.repeat(cell.ravel(), each) for cell in grid)
    order = rng.permutation(p.size)
    order = order[np.argsort(p[order], kind="stable")]
    p, k, ours = p[order], k[order], ours[order]
    index = np.arange(p.size) - np.searchsorted(p, p)
    cell = (p * places + k) * 2 + ours
    repetition = np.zeros(p.size, dtype=np.int64)
    for one in np.unique(cell):
        repetition[cell == one] = np.arange(np.count_nonzero(cell == one))

    def drawn(sd: float, *shape: int) -> NDArray[np.float64]:
        return sd * rng.standard_normal(shape)

    x = SearchTruth(locations=places).ln_ratios
    effect = truth.version + drawn(truth.version_sd, people)[:, None] + drawn(truth.location_sd, places)
    effect = effect + (truth.brightness + drawn(truth.brightness_sd, people)[:, None]) * x
    effect = effect + drawn(truth.three_way_sd, people, places)
    level = np.log(truth.middle) + drawn(truth.person_sd, people)[:, None] + np.linspace(-0.2, 0.2, places)
    level = level + drawn(truth.person_location_sd, people, places)
    ln_time = level[p, k] + effect[p, k] * ours + truth.practice * index + drawn(truth.trial_sd, p.size)
    found = (np.exp(ln_time) <= truth.time_limit) & (rng.random(p.size) >= truth.wrong)
    return SearchTable(
        locations=made_locations(SearchTruth(locations=places)),
        participants=tuple(f"{n + 1:02d}" for n in range(people)),
        participant=p.astype(np.int64),
        location=k.astype(np.int64),
        spot=k.astype(np.int64),
        session=p.astype(np.int64),
        ours=ours.astype(bool),
        times=np.minimum(np.exp(ln_time), truth.time_limit),
        found=found,
        correct=found,
        limits=np.full(p.size, truth.time_limit),
        visit=np.zeros(p.size),
        order=(index - index.mean()) / 10,
        repetition=repetition,
        gaps_known=False,
        repeated=True,
    )


def answers(truth: RepeatedTruth, seed: tuple[int, int], asked: tuple[str, ...]) -> dict[str, Told]:
    """Return what one experiment says."""
    table = repeated_table(truth, np.random.default_rng(seed))
    used = informative(table)
    light, x = brightness_fit(used), table.ln_ratios
    slope = effect_of(light, BRIGHTNESS)
    found: dict[str, Told] = {
        VERSIONS: told(effect_of(version_fit(used), VERSION), truth.version),
        PEOPLE: told(slope, truth.brightness),
        CHECK: told(effect_of(light, VERSION), truth.version),
        PLACE: told(effects_by_location(used)[0], truth.version + truth.brightness * float(x[0])),
    }
    if {LOCATIONS, BOTH} & set(asked):
        line = line_over_locations(effects_by_location(used, over_people=False), x)
        assert not isinstance(line, str)
        found[LOCATIONS] = told(line.slope, truth.brightness)
        found[BOTH] = told(for_people_and_locations(slope, line, truth.people), truth.brightness)
    if HAZARD in asked:
        pairs = matched_pairs(table)
        found[HAZARD] = told(hazard_ratio(pairs), 0.0)
        found[FIRST] = Told(None, exchanged(pairs, pairs.first).p_value)
        change = detection_change(pairs)
        found[CHANGE] = Told(change.ci_low <= 0 <= change.ci_high, change.p_value)
        own = table.some(~table.ours & (table.location == 0))
        share = clustered_share(own.found, own.participant)
        median = kaplan_meier(own.times, own.found, own.participant).median
        right, middle = true_cell(truth)
        found[SHARE] = Told(share.ci_low <= right <= share.ci_high, None)
        high = np.inf if median.ci_high is None else median.ci_high
        found[MEDIAN] = Told((median.ci_low or 0.0) <= middle <= high, None)
    return {name: found[name] for name in asked}


@functools.cache
def true_cell(truth: RepeatedTruth) -> tuple[float, float]:
    """Return the share found at the first location in the baseline, and the median time of the race there.

    Wrong answers come at the same times as right ones, so that the chance of a right one at any moment is a
    share 1 - wrong of both: S of the race is that of all times to this power.
    """
    index = np.arange(truth.most * truth.locations * 2)
    sd = np.sqrt(truth.person_sd**2 + truth.person_location_sd**2 + truth.trial_sd**2)
    middle = np.log(truth.middle) - 0.2 + truth.practice * index

    def ended(ln_time: float) -> float:
        return float(stats.norm.cdf((ln_time - middle) / sd).mean())

    half = 1 - 0.5 ** (1 / (1 - truth.wrong))
    median = float(np.exp(optimize.brentq(lambda ln_time: ended(ln_time) - half, -5.0, 5.0)))
    return (1 - truth.wrong) * ended(float(np.log(truth.time_limit))), median


study = functools.partial(levels, answers, seed=SEED)


def main(experiments: int, mapped: Mapped = map) -> None:
    """Print the table."""
    print_levels(study, SCENARIOS, experiments, mapped)


if __name__ == "__main__":
    run_study(__file__, experiments=400)
