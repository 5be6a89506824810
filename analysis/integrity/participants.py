"""Participants who found nothing, always gave one answer, or whose answers are swapped."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import special, stats

from evenlight.analysis.integrity.answers import Answers
from evenlight.analysis.integrity.concern import LEVEL, Concern, ConcernKind, noun_of
from evenlight.analysis.wording import first_few
from evenlight.data_schema.arrays import Array, Mask
from evenlight.data_schema.recordings.ramp import Procedure, RampTrial

FEWEST_SEARCHES = 4  # fewer without success happen
FEWEST_OTHERS = 5  # participants who show what the one who is swapped should do
AS_FAR = 0.5  # of the others' difference, on the other side


def nothing_found(answers: Answers) -> tuple[Concern, ...]:
    """Return who never found anything, while the others did; or that nobody did."""
    known = ~np.isnan(answers.found)
    searches, found = _per_person(answers, known, known), _per_person(answers, known, answers.found == 1)
    if not searches.sum():
        return ()
    if not found.sum():
        words = f"nobody found anything in {int(searches.sum())} searches"
        return (Concern(ConcernKind.NOTHING_FOUND, words, threatens=True),)
    others = (found.sum() - found) / np.maximum(searches.sum() - searches, 1)
    chance = np.where(searches > 0, (1 - others) ** searches, 1.0)
    never = (found == 0) & (searches >= FEWEST_SEARCHES) & (chance < LEVEL / np.count_nonzero(searches))
    return _named(answers, never, ConcernKind.NOTHING_FOUND, "never found anything", searches, "searches")


def one_answer(answers: Answers) -> tuple[Concern, ...]:
    """Return who always gave the same answer, whatever was shown, if that is not chance.

    By chance a participant does so as often as people who share their answers out as each of the others do;
    either one is too improbable for that, or so many of them are.
    """
    known = (answers.given >= 0) & (answers.shown >= 0)
    if not known.any():
        return ()
    who, given = answers.participant[known], answers.given[known]
    counts = np.zeros((len(answers.people), int(given.max()) + 1))
    np.add.at(counts, (who, given), 1)
    n = counts.sum(axis=1)
    several = np.zeros(n.size, dtype=bool)
    pairs = np.unique(np.stack([who, answers.shown[known]]), axis=1)[0]
    several[np.flatnonzero(np.bincount(pairs, minlength=n.size) > 1)] = True
    always = several & (counts.max(axis=1) == n)
    chance = _chance_of_one_answer(counts)
    people = int(np.count_nonzero(several))
    expected = float(chance[several].mean()) if people else 0.0
    together = float(special.bdtrc(np.count_nonzero(always) - 1, people, expected)) if always.any() else 1.0
    if together >= LEVEL:
        always &= chance < LEVEL / max(people, 1)
    return _named(
        answers, always, ConcernKind.ONE_ANSWER, "always gave the same answer", n, noun_of(answers.task)
    )


def _chance_of_one_answer(counts: Array) -> Array:
    """Return how probable it is that each participant's answers are all alike, (people,).

    Parameters
    ----------
    counts : array (people, answers)
        How often each gave each answer. The others are those who gave several; their shares are kept off 0
        and 1 by one answer like everybody's.
    """
    n = counts.sum(axis=1)
    varied = counts.max(axis=1) < n
    chance: Array = 2 * 0.5**n  # no task offers fewer than two answers
    if varied.any():
        shares = (counts[varied] + counts.sum(axis=0) / n.sum()) / (n[varied, None] + 1)
        chance = np.array([(shares**own).sum() for own in n]) / len(shares)
    return chance


def swapped_versions(answers: Answers) -> tuple[Concern, ...]:
    """Return whose difference between the versions is as clear as the others', the other way round.

    A participant's score is the mean over items of the own difference times the others', over the root mean
    square of the others': their mean difference where it is the same for all items. It must lie beyond the
    one-sided prediction limit of the others' scores (Student's t), at least half as far from 0 as they do, on
    the other side, and the others must differ from 0 at all.
    """
    scores = _scores(_differences(answers))
    known = ~np.isnan(scores)
    n = int(known.sum())
    if n <= FEWEST_OTHERS:
        return ()
    swapped = np.zeros(scores.size, dtype=bool)
    for k in np.flatnonzero(known & (scores < 0)):
        others = scores[known & (np.arange(scores.size) != k)]
        mean, error = float(others.mean()), float(others.std(ddof=1))
        clear = mean > 0 and _upper_t(mean * math.sqrt(n - 1), error, n - 2) < LEVEL
        apart = _upper_t((mean - scores[k]) / math.sqrt(1 + 1 / (n - 1)), error, n - 2) < LEVEL / n
        swapped[k] = clear and apart and scores[k] <= -AS_FAR * mean
    words = "answered as if the versions were swapped"
    own = _per_person(answers, ~np.isnan(answers.answer), np.ones(answers.answer.size, bool))
    return _named(answers, swapped, ConcernKind.SWAPPED, words, own, noun_of(answers.task), threatens=True)


def _differences(answers: Answers) -> Array:
    """Return ours less the baseline, (people, items); NaN where one is missing."""
    shape = (len(answers.people), len(answers.items))
    cell = answers.participant * shape[1] + answers.item

    def mean(chosen: Mask) -> Array:
        count = np.bincount(cell[chosen], minlength=shape[0] * shape[1])
        total = np.bincount(cell[chosen], weights=answers.answer[chosen], minlength=count.size)
        return np.where(count > 0, total / np.maximum(count, 1), math.nan).reshape(shape)

    known = ~np.isnan(answers.answer)
    if np.isnan(answers.ours).all():
        return mean(known) - 0.5  # one of two was chosen
    return mean(known & (answers.ours == 1)) - mean(known & (answers.ours == 0))


def _scores(differences: Array) -> Array:
    """Return how far each participant goes the others' way, (people,); NaN where that is unknown."""
    known = ~np.isnan(differences)
    own = np.where(known, differences, 0.0)
    count = known.sum(axis=0) - known
    others = (own.sum(axis=0) - own) / np.maximum(count, 1)
    both = known & (count > 0)
    size = np.sqrt((others**2 * both).sum(axis=1) / np.maximum(both.sum(axis=1), 1))
    score = (own * others * both).sum(axis=1) / np.maximum(both.sum(axis=1), 1)
    return np.where(size > 0, score / np.where(size > 0, size, 1.0), math.nan)


def _upper_t(distance: float, error: float, degrees: int) -> float:
    """Return the one-sided p of a distance from 0 with this standard error."""
    if error <= 0:
        return 0.0 if distance > 0 else 1.0
    return float(special.stdtr(degrees, -distance / error))


def swapped_ramps(trials: Sequence[RampTrial]) -> tuple[Concern, ...]:
    """Return who reports fast ramps less often than slow ones, or mostly chooses the wrong interval.

    Both tests are one-sided, at the level of the whole data set over the number of participants.
    """
    people: dict[str, list[RampTrial]] = {}
    for trial in trials:
        people.setdefault(trial.participant_id, []).append(trial)
    wrong, falling = [], []
    for who, own in people.items():
        two = [trial.success for trial in own if trial.procedure is Procedure.TWO_INTERVAL]
        if two and float(special.bdtr(sum(two), len(two), 0.5)) < LEVEL / len(people):
            wrong.append(f"{who} (right in {sum(two)} of {len(two)})")
        if _falling_p([t for t in own if t.procedure is Procedure.YES_NO]) < LEVEL / len(people):
            falling.append(who)
    said = {"chose the wrong interval more often than the right one": wrong,
            "reported fast ramps less often than slow ones": falling}  # fmt: skip
    return tuple(
        Concern(ConcernKind.SWAPPED, f"{_people(who)} {words}, as if the keys were swapped", threatens=True)
        for words, who in said.items()
        if who
    )


def _falling_p(trials: Sequence[RampTrial]) -> float:
    """Return the one-sided p of a yes rate that falls with the rate, at the levels of one participant.

    Ranks of the rates, with the answers exchanged within each level.
    """
    levels: dict[Any, list[RampTrial]] = {}
    for trial in trials:
        key = (trial.screen, trial.factor, trial.direction, trial.duration)
        levels.setdefault(key, []).append(trial)
    excess = variance = 0.0
    for own in levels.values():
        ranks = stats.rankdata([trial.rate for trial in own])
        yes = np.array([trial.success for trial in own], dtype=np.float64)
        excess += float((ranks - ranks.mean()) @ yes)
        variance += float(ranks.var() * yes.var()) * len(own) ** 2 / max(len(own) - 1, 1)
    return float(special.ndtr(excess / math.sqrt(variance))) if variance > 0 else 1.0


def _per_person(answers: Answers, known: Mask, values: Mask) -> Array:
    """Return the sum of known values of each participant."""
    weights = np.where(known, values, 0).astype(np.float64)
    return np.bincount(answers.participant, weights=weights, minlength=len(answers.people)).astype(np.float64)


def _people(names: Sequence[str]) -> str:
    """Return participants in words."""
    return f"participant{'s' * (len(names) > 1)} {first_few(names)}"


def _named(
    answers: Answers,
    chosen: Mask,
    kind: ConcernKind,
    words: str,
    counts: Array,
    noun: str,
    *,
    threatens: bool = False,
) -> tuple[Concern, ...]:
    """Return a concern about some participants, with how many answers each has given; none about nobody."""
    names = [f"{answers.people[k]} ({counts[k]:.0f} {noun})" for k in np.flatnonzero(chosen)]
    return (Concern(kind, f"{_people(names)} {words}", threatens),) if names else ()
