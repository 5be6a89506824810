"""Levels and coverage on other scales than 1 to 5, of people who are not made as the models have them.

7 points: everybody has cut points of their own, and answers scatter with heavy tails (Student's t, 3 degrees
of freedom). 0 to 100: a slider with skewed, bounded answers; people differ in how much of it they use, some
keep to whole tens. Their effects of the version differ, with a mean of 0 or not. The truth of a mean in
points is that of 40 000 people; that of the odds ratio, which such people do not have, is the fit of 1500.
The table of docs/decisions/rating-scales.md.

Run with `python benchmarks/studies/scale_levels.py [SETS]`: data sets of 17 people of each kind.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from operator import call

import numpy as np
from made_ratings import rating_trial
from numpy.typing import NDArray
from scipy import special
from studies import Mapped, run_study

from evenlight.analysis.inference.cumulative_link import fit_ordinal, shown_effect
from evenlight.analysis.inference.exact_tests import sign_flip_test
from evenlight.analysis.inference.paired_effects import Effect, exact_mean_difference
from evenlight.analysis.rating.rating_model import is_linear, likelihood_ratio, ordinal_data, rating_fits
from evenlight.analysis.rating.rating_pairs import over_sequences, paired_ratings
from evenlight.data_schema.recordings.viewing import PAPER_SEQUENCES, RatingTrial, Version

PEOPLE, MANY, SEED = 17, 40_000, 6
HEIGHTS = np.array([0.5, -0.5, 1.0, -1.0])  # of the sequences
Rng = np.random.Generator
Answers = Callable[[Rng, NDArray[np.float64]], NDArray[np.float64]]


def seven_points(rng: Rng, latent: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ratings 1 to 7 of what people (rows) feel: by cut points of their own."""
    people = len(latent)
    cuts = np.linspace(-3.0, 2.0, 6) * rng.lognormal(0.0, 0.4, (people, 1)) + rng.normal(0, 0.5, (people, 6))
    felt = latent + 0.9 * rng.standard_t(3, latent.shape)
    return 1.0 + np.sum(felt[..., None] > np.sort(cuts)[:, None, None, :], axis=-1)


def slider(rng: Rng, latent: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ratings 0 to 100 to a tenth, most of them above the middle; a third of the people use tens."""
    people = len(latent)
    felt = 0.8 + 0.7 * latent + 0.5 * rng.normal(size=latent.shape)
    given = 100 * special.expit(felt * rng.lognormal(0.0, 0.5, (people, 1, 1)))
    tens = rng.random((people, 1, 1)) < 1 / 3
    return np.where(tens, np.round(given, -1), np.round(given, 1))


SCALES: dict[str, Answers] = {"7 points": seven_points, "0 to 100": slider}


def drawn(answers: Answers, effect: float, people: int, rng: Rng) -> NDArray[np.float64]:
    """Return ratings (people, sequences, versions), ours first."""
    level, own = rng.normal(0, 1.2, (people, 1, 1)), rng.normal(effect, 0.6, (people, 1, 1))
    return answers(rng, level + HEIGHTS[:, None] + own * np.array([0.5, -0.5]))


def trials_of(ratings: NDArray[np.float64]) -> list[RatingTrial]:
    """Return them as trials, in counterbalanced orders."""
    return [
        rating_trial(f"{who:05}", sequence, version, float(ratings[who, k, v]), 1 + (who + k + v) % 2)
        for who in range(len(ratings))
        for k, sequence in enumerate(PAPER_SEQUENCES)
        for v, version in enumerate((Version.OURS, Version.BASELINE))
    ]


def said(trials: Sequence[RatingTrial]) -> dict[str, Effect]:
    """Return the effects of a data set, with their p."""
    overall = over_sequences(paired_ratings(trials, name) for name in PAPER_SEQUENCES)
    mean = exact_mean_difference(overall.scores, overall.step)
    fit, _ = rating_fits(trials, PAPER_SEQUENCES)
    unit = float(np.std([trial.rating for trial in trials])) if is_linear(trials) else 1.0
    version, place = (shown_effect(fit, effect).shown(unit.__mul__) for effect in fit.effects[:2])
    flips = Effect(mean.value, mean.ci_low, mean.ci_high, p_value=sign_flip_test(overall.scores).p_value)
    interaction, _ = likelihood_ratio(trials, PAPER_SEQUENCES, fit)
    return {"mean, sign flip": flips, "version": version, "place": place, "version x sequence": interaction}


def truths(answers: Answers, effect: float, seed: int = SEED) -> dict[str, float]:
    """Return what the effects of very many people are."""
    rng = np.random.default_rng(seed)
    many = drawn(answers, effect, MANY, rng)
    mean = float((many[..., 0] - many[..., 1]).mean()) if effect else 0.0
    odds = mean
    if effect and answers is seven_points:
        data = ordinal_data(trials_of(many[:1500]), PAPER_SEQUENCES, 0)
        odds = fit_ordinal(data, profiled=()).effects[0].estimate or 0.0
    return {"mean, sign flip": mean, "version": odds, "place": 0.0}


def shares(kind: str, effect: float, sets: int, seed: int = SEED) -> dict[str, tuple[float, float]]:
    """Return how often each test rejects at 5 %, and how often each interval holds the truth (nan: none)."""
    rng, true = np.random.default_rng(seed), truths(SCALES[kind], effect)
    found = [said(trials_of(drawn(SCALES[kind], effect, PEOPLE, rng))) for _ in range(sets)]
    told = {}
    for name in found[0]:
        own = [one[name] for one in found]
        rejected = np.mean([e.p_value is not None and e.p_value <= 0.05 + 1e-12 for e in own])
        held = [
            e.ci_low is None or e.ci_low <= true[name] <= (np.inf if e.ci_high is None else e.ci_high)
            for e in own
            if name in true
        ]
        told[name] = (float(rejected), float(np.mean(held)) if held else float("nan"))
    return told


def main(sets: int, mapped: Mapped = map) -> None:
    """Print levels and coverage for each kind of answers, without an effect and with one."""
    cases = [(kind, effect) for kind in SCALES for effect in (0.0, 0.8)]
    for (kind, effect), told in zip(
        cases, mapped(call, [partial(shares, *c, sets) for c in cases]), strict=True
    ):
        print(f"\n{kind}, {'no effect' if not effect else 'with an effect'}, {sets} sets of {PEOPLE} people")
        for name, (rejected, held) in told.items():
            error = 100 * np.sqrt(rejected * (1 - rejected) / sets)
            print(
                f"  {name}: rejects {100 * rejected:.1f} ± {error:.1f} %, holds {100 * held:.1f} %",
                flush=True,
            )


if __name__ == "__main__":
    run_study(__file__, sets=400)
