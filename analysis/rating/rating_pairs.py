"""Ratings by person: mean ratings of each version, and ours against the baseline, paired.

A participant's ratings of a version are averaged; the pair is the unit, because answers of one person are not
independent. Who lacks a version is left out of its pairs and stays in the model of all ratings. Intervals and
tests: docs/decisions/rating-inference.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial

import numpy as np

from evenlight.analysis.inference import exact_tests as exact
from evenlight.analysis.inference import paired_effects as effects
from evenlight.analysis.inference.exact_tests import ExactTest
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.analysis.rating.rating_power import ALPHA, LARGEST, POWER, fewest_pairs, smallest_difference
from evenlight.analysis.report import Cell, Section, Table
from evenlight.analysis.report_prose import section
from evenlight.analysis.rows import Rows, flag, p, p_with_holm, significant, with_interval
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import counted, in_words, participants, percent
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.arrays import Array, Integers
from evenlight.data_schema.recordings.rating_scale import exact as exactly
from evenlight.data_schema.recordings.viewing import RatingTrial, Version

POINTS, ALL = "rating points", "all"
NOBODY = "nobody has rated both versions"
ADJUSTED_T = "Student's t with two pseudo pairs (after Agresti & Min 2005)"
SIGN_FLIP = "exact sign-flip test of the mean difference"
SMALLEST = "smallest mean difference that would mostly be found"
MEAN = "mean difference, ours less baseline"
MID_P = "mean difference, mid-p, ours less baseline"
RANKS = "signed-rank sum, ours less baseline"
SUPERIORITY = "probability of superiority, ours less baseline"
D_Z = "Cohen's d_z, ours less baseline"
BISERIAL = "rank-biserial correlation, ours less baseline"
DROPPED = "signed-rank sum, zeros dropped"
ALIKE = "participants who rate ours alike"
ONE = Fraction(1)


MOST_WORK = 4e6  # of an exact test, n Σ |score|; beyond, in a fraction of a second's time, scores are rounded


@dataclass(frozen=True, slots=True)
class Sample:
    """A number of each person, exact: a mean rating, or a difference of two.

    Attributes
    ----------
    of : dict of str to Fraction
        By participant [rating points].
    unit : Fraction
        From one rating of the scale to the next [rating points].
    """

    of: Mapping[str, Fraction]
    unit: Fraction = ONE

    @property
    def values(self) -> Array:
        """The numbers [rating points]."""
        return np.array([float(value) for value in self.of.values()])

    @property
    def step(self) -> float:
        """The smallest difference that such means can show [rating points]."""
        return float(self._step)

    @property
    def scores(self) -> Integers:
        """The numbers in steps: whole, as exact tests need them."""
        return np.array([int(value / self._step) for value in self.of.values()], dtype=np.int64)

    @property
    def _step(self) -> Fraction:
        return self.unit / math.lcm(*((value / self.unit).denominator for value in self.of.values()))

    def for_tests(self, work: float = MOST_WORK) -> tuple[Sample, str]:
        """Return it in steps of which n Σ |score| is at most `work`, and that it is rounded, in words."""
        coarsest = Fraction(len(self.of) * sum(map(abs, self.of.values()))) / Fraction(work)
        if coarsest <= self._step:
            return self, ""
        power = Fraction(10) ** math.floor(math.log10(coarsest))
        step = next(nice * power for nice in (1, 2, 5, 10) if nice * power >= coarsest)
        rounded = {who: round(value / step) * step for who, value in self.of.items()}
        return Sample(rounded, step), f"exact tests of differences rounded to {float(step):g} points"


def mean_of(values: Sequence[Fraction | int]) -> Fraction:
    """Return an exact mean.

    >>> mean_of([3, 4])
    Fraction(7, 2)
    """
    return Fraction(sum(values)) / len(values)


def person_means(trials: Iterable[RatingTrial], unit: Fraction = ONE) -> Sample:
    """Return each person's mean rating; `unit` is that of the scale."""
    given: dict[str, list[Fraction]] = {}
    for trial in trials:
        given.setdefault(trial.participant_id, []).append(exactly(trial.rating))
    return Sample({who: mean_of(ratings) for who, ratings in given.items()}, unit)


def paired_ratings(trials: Iterable[RatingTrial], sequence: str, unit: Fraction = ONE) -> Sample:
    """Return ours less baseline of who rated both versions of a sequence."""
    own = [trial for trial in trials if trial.sequence == sequence]
    ours, baseline = (person_means(t for t in own if t.version is v).of for v in Version)
    return Sample({who: ours[who] - baseline[who] for who in ours if who in baseline}, unit)


def over_sequences(pairs: Iterable[Sample]) -> Sample:
    """Return each person's mean difference over the sequences of which they rated both versions."""
    own, pairs = dict[str, list[Fraction]](), list(pairs)
    for who, value in (item for pair in pairs for item in pair.of.items()):
        own.setdefault(who, []).append(value)
    return Sample({who: mean_of(values) for who, values in own.items()}, pairs[0].unit)


@dataclass(frozen=True, slots=True)
class Ratings:
    """The ratings of a data set: by version, and as pairs.

    Attributes
    ----------
    data : TaskData of RatingTrial
        Where they come from.
    sequences : tuple of str
        Designed or rated.
    means : mapping of (str, Version) to Sample
        Each person's mean rating of each version of a sequence.
    pairs : mapping of str to Sample
        Ours less baseline, of each sequence.
    rows : Rows
        What is found, added as it is computed.
    """

    data: TaskData[RatingTrial]
    sequences: tuple[str, ...]
    means: Mapping[tuple[str, Version], Sample]
    pairs: Mapping[str, Sample]
    rows: Rows = field(repr=False)

    def given(self, sequence: str, version: Version) -> list[float]:
        """Return all ratings of a version of a sequence."""
        own = (trial for trial in self.data.trials if trial.sequence == sequence)
        return [trial.rating for trial in own if trial.version is version]

    @property
    def largest(self) -> float:
        """The largest difference of two ratings on their scale [rating points]."""
        return float(self.data.scale.range)

    @property
    def shown(self) -> dict[str, Sample]:
        """The pairs of each sequence, and of all together where there are several."""
        several = len(self.pairs) > 1
        return {**self.pairs, ALL: over_sequences(self.pairs.values())} if several else dict(self.pairs)

    @property
    def names(self) -> dict[str, str]:
        """What tables call each of them."""
        return {name: "all (participants' means)" if name == ALL else in_words(name) for name in self.shown}

    @property
    def rated(self) -> list[str]:
        """The sequences with a rating; only they are in the model."""
        return [name for name in self.sequences if any(self.means[name, v].of for v in Version)]

    @property
    def unrated(self) -> list[str]:
        """The sequences of the design without a rating."""
        return [name for name in self.sequences if name not in self.rated]

    @property
    def incomplete(self) -> list[str]:
        """Who lacks a version of a sequence that was rated."""
        everybody = {who for name in self.rated for v in Version for who in self.means[name, v].of}
        return sorted(who for who in everybody if any(who not in self.pairs[name].of for name in self.rated))

    @property
    def n_people(self) -> int:
        """How many people rated."""
        return len({trial.participant_id for trial in self.data.trials})

    @property
    def people(self) -> str:
        """How many, in words."""
        return participants(self.n_people, self.data.simulated)


def ratings_of(data: TaskData[RatingTrial]) -> Ratings:
    """Return the ratings of a data set."""
    trials, unit = data.trials, data.scale.unit
    sequences = tuple(dict.fromkeys((*data.designed_sequences, *sorted({t.sequence for t in trials}))))
    means = {
        (name, v): person_means((t for t in trials if t.sequence == name and t.version is v), unit)
        for name in sequences
        for v in Version
    }
    pairs = {name: paired_ratings(trials, name, unit) for name in sequences}
    rows = Rows(Origin.SIMULATED if data.simulated else Origin.RECORDED)
    return Ratings(data, sequences, means, pairs, rows)


# What is said of the differences: unit and method. Where p is adjusted for the number of sequences, it is
# tested; the others stand beside.
ADJUSTED = {
    MEAN: (
        POINTS,
        f"primary: {SIGN_FLIP}, Holm over the sequences; interval: what it does not reject, joined with "
        f"{ADJUSTED_T}",
    ),
    MID_P: (POINTS, f"for comparison: {SIGN_FLIP} with mid-p (Lancaster 1961)"),
    RANKS: ("1", "for comparison: exact signed-rank test, zeros ranked (Pratt)"),
    SUPERIORITY: (
        "1",
        "for comparison: exact sign test; interval: what it does not reject, joined with the score interval "
        "(Tango 1998); ties count one half",
    ),
}
BESIDE = {
    D_Z: ("1", "mean over SD (n - 1) of the differences; interval: noncentral t"),
    BISERIAL: ("1", "signed ranks over all ranks; interval: U-statistic with two pseudo pairs"),
    DROPPED: ("1", "for comparison: exact signed-rank test, zeros dropped (Wilcoxon); p not adjusted"),
}


def compared_pairs(pair: Sample, largest: float = LARGEST) -> dict[str, Effect]:
    """Return effects of differences of at most the largest, with the p of the tests that go with them."""
    if not pair.of:
        return dict.fromkeys((*ADJUSTED, *BESIDE), Effect(None, flag=NOBODY))
    tested_pair, rounding = pair.for_tests()
    values, scores, step = pair.values, tested_pair.scores, tested_pair.step
    mean = effects.within(effects.exact_mean_difference(scores, step), -largest, largest)
    if rounding:
        mean = replace(mean, value=float(values.mean()))
    flipped, ranks = exact.sign_flip_test(scores), exact.signed_rank_test(scores)
    dropped, caution = exact.signed_rank_test(scores, exact.ZeroHandling.DROPPED), _caution(flipped)

    def tested(effect: Effect, test: ExactTest) -> Effect:
        words = dict.fromkeys(own for own in (effect.flag, caution, rounding) if own)
        return replace(effect, flag="; ".join(words), p_value=test.p_value)

    return {
        MEAN: tested(mean, flipped),
        MID_P: tested(Effect(mean.value, flag=mean.flag), exact.sign_flip_test(scores, mid_p=True)),
        RANKS: tested(Effect(ranks.statistic), ranks),
        SUPERIORITY: tested(effects.superiority(values), exact.sign_test(scores)),
        D_Z: effects.standardized_difference(values, step),
        BISERIAL: effects.rank_biserial(values, step),
        DROPPED: tested(Effect(dropped.statistic), dropped),
    }


def compare_versions(ratings: Ratings, seed: int) -> Section:
    """Add effects and tests of each sequence and of all together; return the section with two tables."""
    shown, add = ratings.shown, partial(ratings.rows.add, "differences")
    found = {name: compared_pairs(pair, ratings.largest) for name, pair in shown.items()}
    for what, (unit, method) in ADJUSTED.items():
        p_values = exact.holm([found[name][what].p_value for name in ratings.pairs])
        adjusted = dict(zip(ratings.pairs, p_values, strict=True))
        for name, pair in shown.items():
            add(name, what, unit, method, found[name][what], len(pair.of), p_adjusted=adjusted.get(name))
    for name, pair in shown.items():
        for what, (unit, method) in BESIDE.items():
            add(name, what, unit, method, found[name][what], len(pair.of))
        # The same draws for every sequence: those with as many pairs that scatter alike can show the same.
        _add_counts(ratings, name, np.random.default_rng(seed))
    sensitivity = {row.group: row for row in ratings.rows.of("sensitivity")}
    overall = sensitivity.pop(ALL, None)
    limits = [row.value for row in sensitivity.values() if row.value is not None]
    return section(
        "rating_effects",
        (_effects_table(ratings), _tests_table(ratings)),
        different=[in_words(name) for name in different_sequences(ratings) or ()],
        reach=list(dict.fromkeys(f"{end:.2g}" for end in (min(limits), max(limits)))) if limits else [],
        overall=significant(overall)[0],
        why_none=list(dict.fromkeys(row.flag for row in sensitivity.values())),
    )


def _add_counts(ratings: Ratings, name: str, rng: np.random.Generator) -> None:
    rows, pair = ratings.rows, ratings.shown[name]
    n, values = len(pair.of), pair.values
    for what, who in (
        ("participants who rate ours better", values > 0),
        (ALIKE, values == 0),
        ("participants who rate ours worse", values < 0),
    ):
        rows.add("differences", name, what, "1", "count", float(who.sum()), n)
    spread = float(values.std(ddof=1)) if n > 1 else 0.0
    smallest = smallest_difference(n, spread, rng, pair.step, ratings.largest) if n else None
    method = f"{SIGN_FLIP} at 5 %, power {percent(POWER, 0)}, with the spread that was found"
    why = "" if smallest is not None else _why_no_smallest(n, spread)
    rows.add("sensitivity", name, SMALLEST, POINTS, method, smallest, n, flag=why)


def _caution(test: ExactTest) -> str:
    if test.n_different == 0:
        return f"all {test.n} pairs alike: the test cannot speak for either side"
    few = f"only {test.n_different} of {test.n} pairs differ: p cannot come below {test.smallest_p:g}"
    return few if test.smallest_p > ALPHA else ""


def _why_no_smallest(n: int, spread: float) -> str:
    if not n:
        return NOBODY
    if n < fewest_pairs():
        return f"{counted(n, 'pair')}: p cannot come down to {ALPHA:g}"
    alike = f"all {n} differences are alike: no spread to compute with"
    return "no difference on the scale is large enough" if spread > 0 else alike


def different_sequences(ratings: Ratings) -> list[str] | None:
    """Return the sequences that differ beyond chance, after Holm's adjustment; None where none was tested."""
    means = {name: ratings.rows.find("differences", name, MEAN) for name in ratings.pairs}
    tested = {name: row.p_adjusted for name, row in means.items() if row and row.p_adjusted is not None}
    return [name for name, adjusted in tested.items() if adjusted <= ALPHA] if tested else None


def _effects_table(ratings: Ratings) -> Table:
    shown = {"mean": MEAN, "superiority": SUPERIORITY, "rank-biserial": BISERIAL, "d_z": D_Z}
    return ratings.rows.view(
        "Effect sizes, the track less baseline, with 95 % confidence intervals (CI): mean difference [rating "
        "points]; probability that a participant rates the track higher, ties counting one half (0.5: no "
        "effect); matched-pairs rank-biserial correlation; Cohen's d_z.",
        ratings.names,
        [("differences", what, with_interval) for what in shown.values()],
        ("sequence", *(own for name in shown for own in (name, "95 % CI"))),
    )


def _tests_table(ratings: Ratings) -> Table:
    shown = {"mid-p": MID_P, "p, ranks": RANKS, "p, signs": SUPERIORITY}
    return ratings.rows.view(
        "Primary: exact p of the mean difference (sign flips) of each sequence, adjusted for their number "
        "(Holm). For comparison: its mid-p, the signed ranks (zeros ranked, Pratt) and the signs. The row of "
        "all sequences together is one more test, not adjusted. Detectable: the smallest mean difference "
        "[rating points] that so many pairs, with this spread, show at 5 % with a power of "
        f"{100 * POWER:.0f} %.",
        ratings.names,
        [
            ("differences", MEAN, p_with_holm),
            *(("differences", what, p) for what in shown.values()),
            ("differences", ALIKE, _that_differ),
            ("sensitivity", SMALLEST, significant),
            ("differences", RANKS, flag),
        ],
        ("sequence", "p", "Holm", *shown, "pairs that differ", "detectable", "remark"),
    )


def _that_differ(alike: Statistic | None) -> tuple[Cell]:
    if alike is None or alike.value is None or alike.n is None:
        return (None,)
    return (f"{alike.n - int(alike.value)} of {alike.n}",)
