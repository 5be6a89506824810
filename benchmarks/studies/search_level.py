"""How often the search's tests err where nothing is to be found, and its intervals miss what is true.

Run with `python benchmarks/studies/search_level.py [EXPERIMENTS]`; each experiment is one of 17 people at 21
locations. 500 take about half an hour of one core. The tables of docs/decisions/search-inference.md.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from made_searches import SearchTruth, made_table
from scipy import integrate, stats
from studies import Mapped, run_study

from evenlight.analysis.inference.fixed_effects import FixedEffect
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
from evenlight.analysis.search.search_pairs import detection_change, exchanged, hazard_ratio, matched_pairs
from evenlight.analysis.search.search_trials import SearchTable

SEED = 11
# What each question asks has a known truth only in some populations: "over people" is about these locations,
# whose own effects a scatter of locations changes; "over locations" is about these people.
OVERALL, PAIRS = ("version (times)",), ("hazard ratio (Cox)", "rings found")
PEOPLE, LOCATIONS, BOTH = (f"brightness, over {what}" for what in ("people", "locations", "both"))
SCENARIOS: dict[str, tuple[SearchTruth, tuple[str, ...]]] = {
    "all alike": (SearchTruth(), (*OVERALL, *PAIRS, PEOPLE, LOCATIONS, BOTH)),
    "people differ in the version": (
        SearchTruth(version_sd=0.2),
        (*OVERALL, *PAIRS, PEOPLE, LOCATIONS, BOTH),
    ),
    "people differ in brightness": (SearchTruth(brightness_sd=0.6), (PEOPLE, BOTH)),
    "locations differ": (SearchTruth(location_sd=0.2), (LOCATIONS, BOTH)),
    "people and locations differ": (
        SearchTruth(version_sd=0.15, brightness_sd=0.4, location_sd=0.15),
        (BOTH,),
    ),
    "an effect": (
        SearchTruth(version=-0.1, brightness=-0.6, version_sd=0.15),
        (*OVERALL, *PAIRS, PEOPLE, LOCATIONS),
    ),
}


@dataclass(frozen=True, slots=True)
class Told:
    """What an experiment says of one truth: whether its interval held it; p against no effect."""

    held: bool | None
    p_value: float | None

    @property
    def rejected(self) -> bool:
        """Whether no effect is rejected at 5 %; a test that gives no p does not reject."""
        return self.p_value is not None and self.p_value <= 0.05


Question = Callable[[SearchTable, SearchTruth], dict[str, Told]]


def told(effect: FixedEffect | None, truth: float) -> Told:
    """Return what an effect says."""
    if effect is None or effect.ci_low is None or effect.ci_high is None:
        return Told(None, None)
    return Told(effect.ci_low <= truth <= effect.ci_high, effect.p_value)


def overall(table: SearchTable, truth: SearchTruth) -> dict[str, Told]:
    """The effect of the version; its mean over locations, as their brightness ratios average 0."""
    return {OVERALL[0]: told(effect_of(version_fit(table), VERSION), truth.version)}


def slopes(table: SearchTable, truth: SearchTruth) -> dict[str, Told]:
    """The interaction with brightness, over people, over locations, over both."""
    used = informative(table)
    people = effect_of(brightness_fit(used), BRIGHTNESS)
    ln_ratios = np.array([place.ln_ratio for place in table.locations], dtype=np.float64)
    line = line_over_locations(effects_by_location(used), ln_ratios)
    assert not isinstance(line, str)
    both = for_people_and_locations(people, line, truth.participants)
    return {
        PEOPLE: told(people, truth.brightness),
        LOCATIONS: told(line.slope, truth.brightness),
        BOTH: told(both, truth.brightness),
    }


def pairs(table: SearchTable, truth: SearchTruth) -> dict[str, Told]:
    """Who was found first (Cox), and how many were found."""
    both = matched_pairs(table)
    hazard, change = hazard_ratio(both), detection_change(both)
    true_hazard, true_change = true_pair_effects(truth)
    assert hazard.ci_low is not None
    assert hazard.ci_high is not None
    assert change.ci_low is not None
    assert change.ci_high is not None
    return {
        PAIRS[0]: Told(hazard.ci_low <= true_hazard <= hazard.ci_high, exchanged(both, both.first).p_value),
        PAIRS[1]: Told(change.ci_low <= true_change <= change.ci_high, change.p_value),
    }


@functools.cache
def true_pair_effects(truth: SearchTruth) -> tuple[float, float]:
    """Return ln(P(ours first) / P(baseline first)), and the difference of the shares found.

    Both as means over people, places and locations. A pair shares person and location; each of its times has
    a place of a ring, a half (the versions change places: their mean) and a trial of its own.
    """
    own_sd = float(np.hypot(truth.trial_sd, truth.spots_sd))
    shared, weights = np.polynomial.hermite_e.hermegauss(41)
    weights = weights / weights.sum()
    ours_first = base_first = found_ours = found_base = 0.0
    for x in truth.ln_ratios:
        spread = np.sqrt(truth.version_sd**2 + truth.location_sd**2 + (truth.brightness_sd * x) ** 2)
        for z, weight in zip(shared, weights, strict=True):
            limit = np.log(truth.time_limit / truth.middle) - truth.people_sd * z
            for half in (0.0, 1.0):
                ours = stats.norm(
                    truth.version + truth.brightness * x + truth.second_half * half, np.hypot(own_sd, spread)
                )
                base = stats.norm(truth.second_half * (1 - half), own_sd)
                share = weight / 2 / truth.ln_ratios.size
                ours_first += share * _before(ours, base, limit)
                base_first += share * _before(base, ours, limit)
                found_ours += share * ours.cdf(limit)
                found_base += share * base.cdf(limit)
    return float(np.log(ours_first / base_first)), float(found_ours - found_base)


def _before(one: stats.rv_frozen, other: stats.rv_frozen, limit: float) -> float:
    """Return the probability that one is found within the limit, and before the other."""
    return float(integrate.fixed_quad(lambda t: one.pdf(t) * other.sf(t), -6.0, limit, n=60)[0])


QUESTIONS: dict[Question, tuple[str, ...]] = {
    overall: OVERALL,
    slopes: (PEOPLE, LOCATIONS, BOTH),
    pairs: PAIRS,
}


def experiment(truth: SearchTruth, seed: tuple[int, int], asked: tuple[str, ...]) -> dict[str, Told]:
    """Return the answers of one experiment."""
    table = made_table(truth, np.random.default_rng(seed))
    found: dict[str, Told] = {}
    for question, names in QUESTIONS.items():
        if set(names) & set(asked):
            found |= question(table, truth)
    return {name: found[name] for name in asked}


def levels(
    run: Callable[..., dict[str, Told]],
    truth: Any,
    asked: tuple[str, ...],
    experiments: int,
    seed: int = SEED,
    mapped: Mapped = map,
) -> dict[str, tuple[float, float]]:
    """Return for each question how often p was at most 5 %, and how often the interval held the truth."""
    seeds = [(seed, number) for number in range(experiments)]
    every = [*mapped(functools.partial(run, truth, asked=asked), seeds)]
    return {
        name: (
            float(np.mean([one[name].rejected for one in every])),
            float(np.mean([bool(one[name].held) for one in every])),
        )
        for name in asked
    }


study = functools.partial(levels, experiment)


def print_levels(
    study: Callable[..., dict[str, tuple[float, float]]],
    scenarios: Mapping[str, Any],
    experiments: int,
    mapped: Mapped,
) -> None:
    """Print the table of some scenarios, each of a truth and what is asked."""
    error = np.sqrt(0.05 * 0.95 / experiments)
    print(f"{experiments} experiments; standard error of 5 %: {100 * error:.1f} %")
    print("| truth | of what | p <= 5 % | interval holds it |\n|---|---|---|---|")
    for scenario, (truth, asked) in scenarios.items():
        for name, (rejected, held) in study(truth, asked, experiments, mapped=mapped).items():
            print(f"| {scenario} | {name} | {100 * rejected:.1f} % | {100 * held:.1f} % |", flush=True)


def main(experiments: int, mapped: Mapped = map) -> None:
    """Print the table."""
    print_levels(study, SCENARIOS, experiments, mapped)


if __name__ == "__main__":
    run_study(__file__, experiments=500)
