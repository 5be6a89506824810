"""Checks of the order of trials, and of participants: each looks at the table of a task's trials.

Where trials are exchanged at random, a sum over them has a known mean and variance (sampling without
replacement), and is compared with the normal distribution. Of the halves of a session it is the sum, over the
later half, of the answers less the mean of all to that item and version. Adaptive ramps cannot be exchanged,
as what is shown depends on the answers before: of ramps it is the drift of the thresholds that says whether a
session changed (`calibration/psychometric/thresholds.py`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd
from scipy import special, stats

from evenlight.analysis.integrity.concern import LEVEL, Concern, ConcernKind, noun_of
from evenlight.analysis.wording import first_few, p_in_words, percent
from evenlight.data_schema.arrays import Array

FEWEST_SEARCHES = 4  # fewer without success happen
FEWEST_OTHERS = 5  # participants who show what the one who is swapped should do
AS_FAR = 0.5  # of the others' difference, on the other side
FEWEST_PAIRS = 4  # fewer show no effect either
NEARLY = 0.8  # share of pairs in one order from which on the rest is too few to tell (choice)
SEVERAL = 8  # sessions from which on the common part of what practice does can be taken out
FEWEST_RAMPS = 100  # fewer answers may depend on the rate and not show it
FALLS, RISES = -3.09, 1.64  # standard errors: at `LEVEL`, and not even at 5 %; both one-sided
NO_VARIANCE = 1e-12  # what rounding leaves of none
Concerns = Iterator[Concern]
CHANGES = {
    "rating": "the ratings of the later half are {0:.2g} points {1}",
    "comparison": "the track is chosen {4:.0f} points {2} in the later half",
    "search": "searches of the later half take {3:.2f} times as long",
}
ANY_CHANGE = "the answers of the later half are {0:.2g} {1}"


def one_order(table: pd.DataFrame, task: str) -> Concerns:
    """Tell whether the order of the versions is nearly always the same, over all pairs or of some items."""
    pairs = table[table.second.notna()]
    where, most = usual_order(pairs.second)
    items = [(own.words.iloc[0], own.second) for _, own in pairs.groupby("item")]
    fixed = [words for words, second in items if usual_order(second, LEVEL / len(items))[0]]
    if where:
        share = f"all {most}" if most == len(pairs) else f"{most} of {len(pairs)}"
        clause = f"the track was shown {where} in {share} pairs"
    else:
        clause = f"of {first_few(fixed)} one version always came first, or nearly"
    if where or fixed:
        clause = f"in the {noun_of(task)} {clause}"
        words = f"{clause}, so that an effect of the version and one of the order cannot be told apart"
        short = f"{clause}, so order and version cannot be told apart"
        yield Concern(ConcernKind.VERSION_ORDER, words, threatens=True, short=short)


def usual_order(second: pd.Series[float], level: float | None = None) -> tuple[str, int]:
    """Return where ours came in all pairs, or clearly more than by chance nearly all; and in how many.

    The level is that of a one-sided exact test; without it, one order throughout is enough.
    """
    n, count = len(second), int(second.sum())
    most = max(count, n - count)
    chance = float(special.bdtrc(most - 1, n, 0.5))  # P(as many or more | either order is as likely)
    if n < FEWEST_PAIRS or most < NEARLY * n or (chance > (level or LEVEL) and (level or most < n)):
        return "", 0
    return ("second" if 2 * count > n else "first"), most


def differing_halves(table: pd.DataFrame, task: str) -> Concerns:
    """Tell which sessions have halves that differ, and whether all have.

    People search faster where they have been before: what is common to all searchers is taken out, and it is
    for the analysis, whose model has it.
    """
    own = table.groupby("session").session
    table = table.assign(later=2 * own.cumcount() + 1 > own.transform("size"))  # not the middle one
    known = table[table.answer.notna() & table.timed]
    cells = known.groupby(["item", "ours"], dropna=False).answer
    known = known.assign(left_over=known.answer - cells.transform("mean"))
    halves = _halves(known)
    if task == "search":
        if len(halves) < SEVERAL:
            return
        common = np.median([excess / weight for excess, weight, _ in halves.values()])
        halves = _halves(known.assign(left_over=known.left_over - common * known.later))
    yield from _beyond_chance({f"in session {name} ": own for name, own in halves.items()}, task)
    if task != "search" and len(halves) > 1:
        yield from _beyond_chance({"over all sessions ": np.sum(list(halves.values()), axis=0)}, task)


def _halves(known: pd.DataFrame) -> dict[str, Array]:
    """Compare the later half of each session with the earlier one, where chance could make them differ.

    Returns the sum of the later half less its mean by chance, what divides that to give the difference of the
    halves, and its variance by chance.
    """
    found = {}
    for name, own in known.groupby("session", sort=False):
        later = own.later.to_numpy(np.float64)
        excess, variance = _exchanged(later, own.left_over.to_numpy())
        found[str(name)] = np.array([excess, later.size * later.var(), variance])
    return {name: sums for name, sums in found.items() if sums[2] > NO_VARIANCE}


def _exchanged(x: Array, y: Array) -> tuple[float, float]:
    """Return Σ xy less its mean, and its variance, over all ways to exchange the y."""
    variance = x.var() * y.var() * x.size**2 / max(x.size - 1, 1)
    return float((x - x.mean()) @ y), float(variance)


def _beyond_chance(halves: Mapping[str, Array], task: str) -> Concerns:
    words = []
    for where, (excess, weight, variance) in halves.items():
        p = float(2 * special.ndtr(-abs(excess) / math.sqrt(variance)))
        if p < LEVEL / len(halves):
            change = excess / weight
            way = ("higher", "more often") if change > 0 else ("lower", "less often")
            times = math.exp(change) if task == "search" else 0.0
            said = CHANGES.get(task, ANY_CHANGE).format(abs(change), *way, times, 100 * abs(change))
            words.append(f"{where}{said} ({p_in_words(p)})")
    if words:
        yield Concern(ConcernKind.HALVES, first_few(words, 3))


def nothing_found(table: pd.DataFrame, task: str) -> Concerns:
    """Tell who never found anything, while the others did; or that nobody did."""
    own = table[table.found.notna()].groupby("participant", sort=False).found
    searches, found = own.size(), own.sum()
    if len(found) and not found.any():
        words = f"nobody found anything in {searches.sum()} searches"
        yield Concern(ConcernKind.NOTHING_FOUND, words, threatens=True)
        return
    others = (found.sum() - found) / (searches.sum() - searches).clip(lower=1)
    clear = (1 - others) ** searches < LEVEL / max(len(found), 1)
    never = searches[(found == 0) & (searches >= FEWEST_SEARCHES) & clear]
    names = [f"{who} ({n} searches)" for who, n in never.items()]
    yield from _of_people(ConcernKind.NOTHING_FOUND, names, "never found anything")


def one_answer(table: pd.DataFrame, task: str) -> Concerns:
    """Tell who always gave the same answer, whatever was shown, if that is not chance.

    By chance a participant does so as often as people who share their answers out as each of the others do;
    either one is too improbable for that, or so many of them are.
    """
    known = table[(table.given >= 0) & (table.shown >= 0)]
    counts = pd.crosstab(known.participant, known.given)
    several = known.groupby("participant").shown.nunique() > 1
    n = counts.sum(axis=1)
    varied = counts[counts.max(axis=1) < n]
    always = several & ~several.index.isin(varied.index)
    if not always.any():
        return
    chance = 2 * 0.5**n  # no task offers fewer than two answers
    if len(varied):  # their shares are kept off 0 and 1 by one answer like everybody's
        shares = (varied + counts.sum() / n.sum()).div(varied.sum(axis=1) + 1, axis=0).to_numpy()
        chance = n.map(lambda answers: (shares**answers).sum() / len(shares))
    together = special.bdtrc(always.sum() - 1, several.sum(), chance[several].mean())
    if together >= LEVEL:
        always &= chance < LEVEL / several.sum()
    names = [f"{who} ({count} {noun_of(task)})" for who, count in n[always].items()]
    yield from _of_people(ConcernKind.ONE_ANSWER, names, "always gave the same answer")


def swapped_versions(table: pd.DataFrame, task: str) -> Concerns:
    """Tell whose difference between the versions is as clear as the others', the other way round.

    A participant's score is the mean over items of the own difference times the others', over the root mean
    square of the others': their mean difference where it is the same for all items. It must lie beyond the
    one-sided prediction limit of the others' scores (Student's t), at least half as far from 0 as they do, on
    the other side, and the others must differ from 0 at all.
    """
    known = table[table.answer.notna()]
    scores, answers = _scores(known), known.groupby("participant").size()
    if (n := len(scores)) <= FEWEST_OTHERS:
        return
    others = np.array([np.delete(scores.to_numpy(), k) for k in range(n)])
    mean, error = others.mean(axis=1), np.maximum(others.std(axis=1, ddof=1), NO_VARIANCE)
    clear = special.stdtr(n - 2, -mean * math.sqrt(n - 1) / error) < LEVEL
    apart = special.stdtr(n - 2, (scores - mean) / math.sqrt(1 + 1 / (n - 1)) / error) < LEVEL / n
    other_way = (mean > 0) & (scores <= -AS_FAR * mean)
    swapped = [f"{who} ({answers[who]} {noun_of(task)})" for who in scores.index[clear & apart & other_way]]
    words = "answered as if the versions were swapped"
    yield from _of_people(ConcernKind.SWAPPED, swapped, words, True)


def _scores(known: pd.DataFrame) -> pd.Series[float]:
    """Return how far each participant goes the others' way, where that is known."""
    both = bool(known.ours.isna().all())  # are shown, and one is chosen
    ours, baseline = (
        known[(known.ours == version) | both].pivot_table("answer", "participant", "item")
        for version in (1, 0)
    )
    own = (ours - (0.5 if both else baseline)).reindex(known.participant.unique())
    count = own.notna().sum() - own.notna()
    others = ((own.sum() - own.fillna(0.0)) / count.where(count > 0)).where(own.notna())
    size = (others**2).mean(axis=1) ** 0.5
    return ((own * others).mean(axis=1) / size)[size > 0]


def swapped_keys(table: pd.DataFrame, task: str) -> Concerns:
    """Tell whether fast ramps are reported less often than slow ones, or mostly the wrong interval is chosen.

    All answers together are tested first, then those of each participant; both tests are one-sided.
    """
    ramps = table[table.counted]
    right, asked = ramps.answer[ramps.two], ramps[~ramps.two]
    if len(right) and special.bdtr(right.sum(), len(right), 0.5) < LEVEL:
        words = f"the wrong interval is chosen in {percent(1 - right.mean(), 0)} of {len(right)} ramps"
        yield Concern(ConcernKind.SWAPPED, f"{words} (are first and second exchanged?)", threatens=True)
        return
    if _rise(asked) < FALLS:
        words = f"fast ramps are reported less often than slow ones: {_halves_of_rates(asked)}"
        yield Concern(ConcernKind.SWAPPED, f"{words} (are yes and no exchanged?)", threatens=True)
        return
    level = LEVEL / max(table.participant.nunique(), 1)
    wrong, falling = [], []
    for who, own in ramps.groupby("participant", sort=False):
        right = own.answer[own.two]
        if len(right) and special.bdtr(right.sum(), len(right), 0.5) < level:
            wrong.append(f"{who} (right in {right.sum():.0f} of {len(right)})")
        if special.ndtr(_rise(own[~own.two])) < level:
            falling.append(str(who))
    for names, words in (
        (wrong, "chose the wrong interval more often than the right one"),
        (falling, "reported fast ramps less often than slow ones"),
    ):
        yield from _of_people(ConcernKind.SWAPPED, names, f"{words}, as if the keys were swapped", True)


def no_threshold(table: pd.DataFrame, task: str) -> Concerns:
    """Tell why no threshold can be in the answers: yes to nothing, one rate at each level, or any answer."""
    ramps, to_nothing = table[table.counted], table.answer[~table.counted & ~table.two]
    rise = _rise(ramps)
    if min(rise, *(_rise(own) for _, own in ramps.groupby("participant"))) < FALLS:
        return  # somebody's swapped keys, which say so
    if special.bdtrc(to_nothing.sum() - 1, len(to_nothing), 0.5) < LEVEL:
        nothing, something = (percent(answers.mean(), 0) for answers in (to_nothing, ramps.answer))
        words = (
            f"yes is said to {nothing} of {len(to_nothing)} trials without a change, and to {something} of "
            "the ramps (do the answers say yes, or that the answer was right?)"
        )
        yield Concern(ConcernKind.NO_THRESHOLD, words, threatens=True)
    elif len(ramps) and ramps.groupby("level").rate.nunique().max() == 1:
        words = "at each level all ramps have the same rate: a threshold needs several"
        yield Concern(ConcernKind.NO_THRESHOLD, words, threatens=True)
    elif len(ramps) >= FEWEST_RAMPS and rise < RISES and ramps.answer.nunique() > 1:
        words = f"the answers do not depend on the rate: {_halves_of_rates(ramps)}"
        words += " (do answers and ramps belong together?)"
        yield Concern(ConcernKind.NO_THRESHOLD, words, threatens=True)


def _rise(ramps: pd.DataFrame) -> float:
    """Return how clearly answers go with the rates' ranks at each person's levels, in standard errors."""
    levels = ramps.groupby(["participant", "level"])
    sums = [_exchanged(stats.rankdata(own.rate), own.answer.to_numpy()) for _, own in levels]
    excess, variance = np.sum(sums, axis=0) if sums else (0.0, 0.0)
    return float(excess / math.sqrt(variance)) if variance > 0 else 0.0


def _halves_of_rates(ramps: pd.DataFrame) -> str:
    rank = ramps.groupby("level").rate.rank(pct=True)
    said = "are right" if ramps.two.all() else "are noticed"
    fast, slow = (percent(ramps.answer[half].mean(), 0) for half in (rank > 0.5, rank <= 0.5))
    return f"{fast} of the faster half {said}, {slow} of the slower"


def _of_people(kind: ConcernKind, names: Sequence[str], words: str, threatens: bool = False) -> Concerns:
    if names:
        who = f"participant{'s' * (len(names) > 1)} {first_few(names)}"
        yield Concern(kind, f"{who} {words}", threatens)


CHECKS = (one_order, differing_halves, nothing_found, one_answer, swapped_versions)
CHECKS_OF_RAMPS = (one_order, nothing_found, one_answer, swapped_keys, no_threshold)
