"""All results of the detail ratings in one record, from which rows, figures and words are made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenlight.analysis.inference.exact_tests import (
    ExactTest,
    ZeroHandling,
    holm,
    sign_flip_test,
    sign_test,
    signed_rank_test,
)
from evenlight.analysis.inference.paired_effects import (
    Effect,
    exact_mean_difference,
    rank_biserial,
    standardized_difference,
    superiority,
    within,
)
from evenlight.analysis.rating.rating_model import (
    InteractionTest,
    RatingModel,
    permuted_interaction,
    rating_model,
)
from evenlight.analysis.rating.rating_order import OrderEffects, order_effects
from evenlight.analysis.rating.rating_pairs import (
    PairedRatings,
    VersionRatings,
    incomplete,
    over_sequences,
    paired_ratings,
    sequences_in,
    version_ratings,
)
from evenlight.analysis.rating.rating_power import (
    ALPHA,
    LARGEST,
    DifferenceSpread,
    fewest_pairs,
    smallest_difference,
)
from evenlight.analysis.session_loading import TaskData
from evenlight.data_schema.recordings.viewing import RatingTrial, Version

NOBODY = "nobody has rated both versions"


@dataclass(frozen=True, slots=True)
class PairResult:
    """What the differences between the versions say of one sequence, or of all.

    Attributes
    ----------
    pairs : PairedRatings
        The differences.
    mean, d_z, superiority, rank_biserial : Effect
        Mean difference [rating points], Cohen's d_z, probability of superiority, rank-biserial correlation.
    flip, flip_mid_p, ranks, ranks_dropped, signs : ExactTest or None
        Sign-flip test of the mean, exact and mid-p; signed ranks with and without zeros; sign test. None
        without any pair.
    smallest : float or None
        Smallest mean difference that so many pairs would mostly find [rating points].
    """

    pairs: PairedRatings
    mean: Effect
    d_z: Effect
    superiority: Effect
    rank_biserial: Effect
    flip: ExactTest | None
    flip_mid_p: ExactTest | None
    ranks: ExactTest | None
    ranks_dropped: ExactTest | None
    signs: ExactTest | None
    smallest: float | None

    @property
    def caution(self) -> str:
        """What to note about its tests."""
        return NOBODY if self.flip is None else caution_of(self.flip)

    @property
    def why_no_smallest(self) -> str:
        """Why there is no smallest difference; empty if there is one."""
        if self.smallest is not None or self.flip is None:
            return "" if self.flip else NOBODY
        if self.flip.n < fewest_pairs():
            return f"{self.flip.n} pair{'s' * (self.flip.n != 1)}: p cannot come down to {ALPHA:g}"
        if not np.ptp(self.pairs.values) > 0:
            return f"all {self.flip.n} differences are alike: no spread to compute with"
        return "no difference on the scale is large enough"


@dataclass(frozen=True, slots=True)
class RatingResults:
    """What the ratings say.

    Attributes
    ----------
    sequences : tuple of str
        In the order of the design.
    participant_ids : tuple of str
        Everybody with a rating that counts.
    versions : dict of (str, Version) to VersionRatings
        All ratings of each version of each sequence.
    pairs : tuple of PairResult
        Of each sequence.
    overall : PairResult
        Of each participant's mean over the sequences.
    model : RatingModel
        Of all ratings.
    permuted : InteractionTest
        Whether the difference depends on the sequence, without a model.
    order : OrderEffects
        What the order does.
    simulated : bool
        Whether simulated participants answered.
    """

    sequences: tuple[str, ...]
    participant_ids: tuple[str, ...]
    versions: dict[tuple[str, Version], VersionRatings]
    pairs: tuple[PairResult, ...]
    overall: PairResult
    model: RatingModel
    permuted: InteractionTest
    order: OrderEffects
    simulated: bool

    @property
    def rated(self) -> tuple[str, ...]:
        """The sequences with a rating; only they are in the model."""
        return tuple(name for name in self.sequences if any(self.versions[name, v].ratings for v in Version))

    @property
    def unrated(self) -> tuple[str, ...]:
        """The sequences that were designed, and that nobody rated."""
        return tuple(name for name in self.sequences if name not in self.rated)

    @property
    def incomplete(self) -> tuple[str, ...]:
        """Participants who lack a version of a sequence that was rated."""
        return incomplete([result.pairs for result in self.pairs if result.pairs.name in self.rated])

    @property
    def different(self) -> tuple[str, ...]:
        """The sequences whose mean difference is significant at 5 % (exact test, Holm)."""
        tested = zip(self.pairs, self.adjusted, strict=True)
        return tuple(result.pairs.name for result, p in tested if p is not None and p <= ALPHA)

    @property
    def shown(self) -> tuple[PairResult, ...]:
        """What has a row in tables and figures; all sequences together only where there are several."""
        return (*self.pairs, self.overall) if len(self.pairs) > 1 else self.pairs

    @property
    def adjusted(self) -> tuple[float | None, ...]:
        """The exact p of each sequence's mean difference, adjusted for their number (Holm)."""
        return tuple(holm([None if result.flip is None else result.flip.p_value for result in self.pairs]))

    @property
    def people(self) -> str:
        """How many participants, in words."""
        n = len(self.participant_ids)
        return f"{n} {'simulated ' * self.simulated}participant{'s' * (n != 1)}"


def rating_results(data: TaskData[RatingTrial], seed: int) -> RatingResults:
    """Return what the ratings say.

    Parameters
    ----------
    data : TaskData of RatingTrial
        All sessions.
    seed : int
        Of the permutations, and of the experiments that are drawn for the smallest difference.
    """
    trials, sequences = data.trials, sequences_in(data)
    pairs = [paired_ratings(trials, name) for name in sequences]
    rated = [name for name in sequences if any(trial.sequence == name for trial in trials)]
    rng = np.random.default_rng(seed)
    return RatingResults(
        sequences=sequences,
        participant_ids=tuple(dict.fromkeys(trial.participant_id for trial in trials)),
        versions={(s, v): version_ratings(trials, s, v) for s in sequences for v in Version},
        # The same draws for every row: sequences with as many pairs that scatter alike can show the same.
        pairs=tuple(pair_result(pair, np.random.default_rng(seed)) for pair in pairs),
        overall=pair_result(over_sequences(pairs), np.random.default_rng(seed)),
        model=rating_model(trials, rated),
        permuted=permuted_interaction([pair for pair in pairs if pair.name in rated], rng),
        order=order_effects(trials, sequences, rng),
        simulated=data.simulated,
    )


def pair_result(pairs: PairedRatings, rng: np.random.Generator) -> PairResult:
    """Return effect sizes and tests of some differences."""
    if not pairs.participant_ids:
        none = Effect(None, flag=NOBODY)
        return PairResult(pairs, none, none, none, none, None, None, None, None, None, None)
    values, scores, step = pairs.values, pairs.scores, pairs.step
    several = values.size > 1
    spread = DifferenceSpread(values.size, float(values.std(ddof=1)) if several else 0.0, step)
    return PairResult(
        pairs=pairs,
        mean=within(exact_mean_difference(scores, step), -LARGEST, LARGEST),
        d_z=standardized_difference(values, step),
        superiority=superiority(values),
        rank_biserial=rank_biserial(values, step),
        flip=sign_flip_test(scores),
        flip_mid_p=sign_flip_test(scores, mid_p=True),
        ranks=signed_rank_test(scores),
        ranks_dropped=signed_rank_test(scores, ZeroHandling.DROPPED),
        signs=sign_test(scores),
        smallest=smallest_difference(spread, rng),
    )


def caution_of(test: ExactTest) -> str:
    """Return what to note about an exact test.

    >>> caution_of(ExactTest(statistic=2.0, p_value=0.5, n=17, n_different=2))
    'only 2 of 17 pairs differ: p cannot come below 0.5'
    """
    if test.n_different == 0:
        return f"all {test.n} pairs alike: the test cannot speak for either side"
    if test.smallest_p > ALPHA:
        return f"only {test.n_different} of {test.n} pairs differ: p cannot come below {test.smallest_p:g}"
    return ""
