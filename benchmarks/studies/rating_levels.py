"""Levels and coverage of what is tested over all ratings of 17 people: docs/decisions/rating-inference.md.

Run with `python benchmarks/studies/rating_levels.py [RUNS] [MODELS]`: experiments for the tests without a
model, and for the model, which takes about half a second each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from operator import call

import numpy as np
from made_ratings import Raters, drawn_ratings
from studies import Mapped, run_study

from evenlight.analysis.inference.cumulative_link import shown_effect
from evenlight.analysis.inference.exact_tests import sign_flip_test
from evenlight.analysis.inference.paired_effects import Effect, exact_mean_difference
from evenlight.analysis.rating.rating_model import likelihood_ratio, permuted_interaction, rating_fits
from evenlight.analysis.rating.rating_order import CARRY_OVER, PLACE, order_effects
from evenlight.analysis.rating.rating_pairs import over_sequences, paired_ratings
from evenlight.data_schema.recordings.viewing import PAPER_SEQUENCES, RatingTrial

PEOPLE = 17
SEED = 4
PEOPLE_LIKE = {  # all without an effect of the version on average
    "alike in the effect": Raters(),
    "with effects of their own, SD 0.8": Raters(effect_sd=0.8),
    "crowded at 4 and 5": Raters(cuts=(-7.0, -5.0, -3.0, 0.0)),
    "hardly using the scale": Raters(level_sd=0.5, cuts=(-6.0, -4.0, -2.5, 3.0)),
}


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a test and an interval said of an effect that is 0.

    Attributes
    ----------
    p_value : float or None
        Of the test.
    holds : bool or None
        Whether the interval holds 0; None without one.
    """

    p_value: float | None
    holds: bool | None = None


def outcome(effect: Effect, p_value: float | None) -> Outcome:
    """Return what was said of an effect that is 0."""
    if effect.ci_low is None or effect.ci_high is None:
        return Outcome(p_value)
    return Outcome(p_value, effect.ci_low <= 0 <= effect.ci_high)


def model_free(trials: list[RatingTrial], rng: np.random.Generator) -> dict[str, Outcome]:
    """Return what is said without a model."""
    pairs = [paired_ratings(trials, name) for name in PAPER_SEQUENCES]
    overall = over_sequences(pairs)
    order, by_sequence = order_effects(trials, PAPER_SEQUENCES, rng, permutations=399)
    place, carried, one = order[PLACE][0], order[CARRY_OVER][0], by_sequence["gym"][0]
    permuted, _ = permuted_interaction(pairs, rng, permutations=399)
    mean = exact_mean_difference(overall.scores, overall.step)
    return {
        "mean over sequences": outcome(mean, sign_flip_test(overall.scores).p_value),
        "mean over sequences, mid-p": outcome(mean, sign_flip_test(overall.scores, mid_p=True).p_value),
        "version x sequence, permuted": Outcome(permuted.p_value),
        "place": outcome(place, place.p_value),
        "carry-over": outcome(carried, carried.p_value),
        "order, one sequence": outcome(one, one.p_value),
    }


def model_based(trials: list[RatingTrial], rng: np.random.Generator) -> dict[str, Outcome]:
    """Return what the model says."""
    fit, alike = rating_fits(trials, PAPER_SEQUENCES)
    effects = {
        "version, model": shown_effect(fit, fit.effects[0]),
        "version, model, the same for all": alike.effects[0],
        "place, model": shown_effect(fit, fit.effects[1]),
    }
    said = {name: outcome(Effect(e.estimate, e.ci_low, e.ci_high), e.p_value) for name, e in effects.items()}
    return {
        **said,
        "version x sequence, likelihood ratio": Outcome(
            likelihood_ratio(trials, PAPER_SEQUENCES, fit)[0].p_value
        ),
    }


def shares(
    raters: Raters,
    runs: int,
    said: Callable[[list[RatingTrial], np.random.Generator], dict[str, Outcome]],
    seed: int = SEED,
) -> dict[str, tuple[float, float]]:
    """Return how often each test rejects at 5 %, and how often each interval holds 0 (nan without one)."""
    rng = np.random.default_rng(seed)
    found = [said(drawn_ratings(raters, PEOPLE, rng), rng) for _ in range(runs)]
    result = {}
    for name in found[0]:
        outcomes = [one[name] for one in found]
        rejected = [o.p_value is not None and o.p_value <= 0.05 + 1e-12 for o in outcomes]
        holds = [o.holds for o in outcomes if o.holds is not None]
        result[name] = (float(np.mean(rejected)), float(np.mean(holds)) if holds else float("nan"))
    return result


def main(runs: int, models: int, mapped: Mapped = map) -> None:
    """Print levels and coverage for each kind of people."""
    ways = ((model_free, runs), (model_based, models))
    cases = [partial(shares, raters, n, said) for raters in PEOPLE_LIKE.values() for said, n in ways if n]
    found = iter(mapped(call, cases))
    for kind in PEOPLE_LIKE:
        print(f"\n{kind}")
        for _, number in ways:
            for name, (level, held) in next(found).items() if number else ():
                print(
                    f"  {name}: level {100 * level:.1f} %, coverage {100 * held:.1f} % of {number}",
                    flush=True,
                )


if __name__ == "__main__":
    run_study(__file__, runs=4000, models=400)
