"""How often the measure that raters go by is in the 95 % set, and how many others with it.

Run by hand, some minutes: `python tests/recovery/measure_recovery.py`. The figures are those of
docs/decisions/fitting-the-measure.md. Losses of constant dimming are drawn from 0.02 to 0.1, candidates
differ by an SD of 0.4 of their logarithm, and ours loses about a quarter less, by an SD of 0.15.
"""

from __future__ import annotations

import numpy as np
from made_ratings import rating_trial
from studies import Mapped, run_study

from evenlight.analysis.rating.measure_candidates import Condition, measure_candidates
from evenlight.analysis.rating.measure_fit import fit_measure
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.viewing import RatingTrial, Version

STUDIES = ((17, 4, 1.0), (40, 8, 1.0))  # people, sequences, log-odds per SD of the loss
CANDIDATES = measure_candidates()
CUTS = np.array([-3.0, -1.5, 0.0, 1.5])
PLACE = 0.3  # log-odds of being shown first


def drawn_losses(rng: np.random.Generator, sequences: int, count: int) -> dict[Condition, Array]:
    """Return what each of some candidates says that each version loses."""
    losses = {}
    for number in range(sequences):
        constant = rng.uniform(0.02, 0.1) * np.exp(0.4 * rng.normal(size=count))
        losses[f"s{number}", Version.BASELINE] = constant
        kept = np.clip(0.75 + 0.15 * rng.normal(size=count), 0.2, 1.2)
        losses[f"s{number}", Version.OURS] = constant * kept
    return losses


def drawn_ratings(
    rng: np.random.Generator, loss: dict[Condition, float], people: int, strength: float
) -> list[RatingTrial]:
    """Return ratings by people who go by a loss, in orders that alternate."""
    unit, trials = float(np.std(list(loss.values()))), []
    for person in range(people):
        level = rng.normal()
        for (name, version), lost in loss.items():
            first = (version is Version.OURS) == ((person + int(name[1:])) % 2 == 0)
            scale = level - strength * lost / unit + PLACE * first + rng.logistic()
            rating = 1 + int(np.sum(scale > CUTS))
            trials.append(rating_trial(f"{person:03}", name, version, rating, 1 if first else 2))
    return trials


def study(
    people: int, sequences: int, strength: float, rng: np.random.Generator
) -> tuple[int, dict[Condition, Array], list[RatingTrial]]:
    """Return which candidate people go by, what each candidate says is lost, and their ratings."""
    losses = drawn_losses(rng, sequences, len(CANDIDATES))
    truth = int(rng.integers(len(CANDIDATES)))
    own = {condition: float(loss[truth]) for condition, loss in losses.items()}
    return truth, losses, drawn_ratings(rng, own, people, strength)


def recovered(drawn: tuple[int, dict[Condition, Array], list[RatingTrial]]) -> tuple[bool, bool, int]:
    """Return whether the truth is in the set, whether it is best, and how large the set is."""
    truth, losses, ratings = drawn
    fit = fit_measure(ratings, losses, CANDIDATES)
    possible = [one.candidate for one in fit.possible]
    return CANDIDATES[truth] in possible, fit.best.candidate == CANDIDATES[truth], len(possible)


def main(studies: int, mapped: Mapped = map) -> None:
    """Print, for each kind of study, how often the truth is in the set, best, and how large the set is."""
    rng = np.random.default_rng(2)  # all is drawn here, in order; what is drawn, and fitted there, is a task
    for kind in STUDIES:
        people, sequences, strength = kind
        found = mapped(recovered, (study(*kind, rng) for _ in range(studies)))
        held, best, size = np.sum([*found], axis=0)
        words = f"{people} people, {sequences} sequences, {strength:g} per SD"
        print(f"{words}: in the set {held}, best {best} of {studies}; {size / studies:.0f} candidates in it")


if __name__ == "__main__":
    run_study(__file__, studies=30)
