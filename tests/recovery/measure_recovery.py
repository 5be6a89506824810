"""How often the measure that raters go by is in the 95 % set, and how many others with it.

Run by hand, some minutes: `python tests/recovery/measure_recovery.py`. The figures are those of
docs/decisions/fitting-the-measure.md. Losses of constant dimming are drawn from 0.02 to 0.1, candidates
differ by an SD of 0.4 of their logarithm, and ours loses about a quarter less, by an SD of 0.15.
"""

from __future__ import annotations

import numpy as np
from made_ratings import rating_trial

from evenlight.analysis.rating.measure_candidates import Condition, measure_candidates
from evenlight.analysis.rating.measure_fit import fit_measure
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.viewing import RatingTrial, Version

STUDIES = ((17, 4, 1.0), (40, 8, 1.0))  # people, sequences, log-odds per SD of the loss
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


def study(studies: int = 30, seed: int = 2) -> None:
    """Print, for each kind of study, how often the truth is in the set, best, and how large the set is."""
    candidates, rng = measure_candidates(), np.random.default_rng(seed)
    for people, sequences, strength in STUDIES:
        held = best = size = 0
        for _ in range(studies):
            losses = drawn_losses(rng, sequences, len(candidates))
            truth = int(rng.integers(len(candidates)))
            own = {condition: float(loss[truth]) for condition, loss in losses.items()}
            fit = fit_measure(drawn_ratings(rng, own, people, strength), losses, candidates)
            held += candidates[truth] in [one.candidate for one in fit.possible]
            best += fit.best.candidate == candidates[truth]
            size += len(fit.possible)
        kind = f"{people} people, {sequences} sequences, {strength:g} per SD"
        print(f"{kind}: in the set {held}, best {best} of {studies}; {size / studies:.0f} candidates in it")


if __name__ == "__main__":
    study()
