"""All results of the artifact comparison: each sequence, all answers, and what is wrong with them.

The pooled model of all answers is a mixed logistic regression (the paper's Section 4.3),

    logit P(ours chosen) = preference_i + leaning · s,    s = 1 if ours came first, -1 if second,

with the preference of participant i normal about the population's. Whether ours is chosen more often than by
a coin is the question whether the population's preference is 0; s takes out a bias to an interval, where the
order is not balanced.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.analysis.comparison.comparison_chance import (
    Consistency,
    SequenceDifferences,
    consistency_of,
    sequence_differences,
)
from evenlight.analysis.comparison.comparison_shares import (
    OURS_FIRST,
    ShareEstimate,
    chose_first,
    count_choices,
    estimate_share,
    sequences_in,
)
from evenlight.analysis.inference.binomial_tests import ALPHA
from evenlight.analysis.inference.cumulative_link import OrdinalData, OrdinalFit, fit_ordinal
from evenlight.analysis.inference.exact_tests import holm
from evenlight.analysis.integrity.version_order import confounded_order
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import first_few, spaced
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.viewing import ComparisonTrial

RARE = 0.2  # share of the rarer order below which the order counts as nearly constant: 3 of 17
PREFERENCE = "ours chosen by a person in the middle"
LEANING = "first chosen by a person in the middle"
METHOD = "mixed logistic regression, participant random; likelihood ratio, profile interval"


@dataclass(frozen=True, slots=True)
class IntervalOrder:
    """How often ours came first.

    Attributes
    ----------
    ours_first, trials : int
        How often, of how many.
    unknown : int
        Trials beside them of which it is not known.
    """

    ours_first: int
    trials: int
    unknown: int = 0

    @property
    def constant(self) -> bool:
        """Whether ours came always in the same interval, as far as that is known."""
        return self.trials + self.unknown > 0 and self.ours_first in (0, self.trials)

    @property
    def flag(self) -> str:
        """What the order makes of a share; empty where both orders are frequent enough."""
        if self.unknown:
            return (
                f"the interval of ours is unknown in {self.unknown} of {self.trials + self.unknown} "
                "trials: its choice cannot be told from a leaning to one interval"
            )
        rarer = min(self.ours_first, self.trials - self.ours_first)
        if rarer >= RARE * self.trials:
            return ""
        where = "first" if self.ours_first > rarer else "second"
        cause = "cannot be told" if self.constant else "can hardly be told"
        return (
            f"ours came {where} in {self.trials - rarer} of {self.trials} trials: its choice {cause} from a "
            "leaning to that interval"
        )


def order_of(trials: Iterable[ComparisonTrial]) -> IntervalOrder:
    """Return how often ours came first."""
    intervals = [None if trial.response is None else trial.ours_interval for trial in trials]
    first, unknown = intervals.count(OURS_FIRST), intervals.count(None)
    return IntervalOrder(first, len(intervals) - unknown, unknown)


@dataclass(frozen=True, slots=True)
class SequenceShare:
    """How often the modulated version of a sequence was chosen.

    Attributes
    ----------
    name : str
        Of the sequence.
    estimate : ShareEstimate or None
        None without an answer.
    p_holm, equivalence_holm : float or None
        The p of both tests, adjusted for the number of sequences.
    order : IntervalOrder
        How often the modulated version came first.
    """

    name: str
    estimate: ShareEstimate | None
    p_holm: float | None
    equivalence_holm: float | None
    order: IntervalOrder


@dataclass(frozen=True, slots=True)
class ComparisonResults:
    """All results of the artifact comparison.

    Attributes
    ----------
    data : TaskData
        What was analysed.
    margin : float
        Within which a share counts as equivalent to one half.
    sequences : tuple of SequenceShare
        In the order of the design.
    pooled : ShareEstimate
        Of all answers: share of the modulated version.
    first : ShareEstimate or None
        Of all answers whose order is known: share of the first of the two; None without any.
    differences : SequenceDifferences or None
        Between sequences; None for a single one.
    consistency : Consistency or None
        Of participants; None where nobody answered twice.
    order : IntervalOrder
        How often the modulated version came first, of all trials.
    model : OrdinalFit
        Of all answers.
    warnings : tuple of str
        What is wrong with the answers.
    """

    data: TaskData[ComparisonTrial]
    margin: float
    sequences: tuple[SequenceShare, ...]
    pooled: ShareEstimate
    first: ShareEstimate | None
    differences: SequenceDifferences | None
    consistency: Consistency | None
    order: IntervalOrder
    model: OrdinalFit
    warnings: tuple[str, ...]

    @property
    def people(self) -> int:
        """How many participants there are."""
        return len(self.pooled.choices.participants)

    @property
    def contradictory(self) -> bool:
        """Whether sequences differ, from one half or from each other: one share is then none of theirs."""
        return any(own.p_holm is not None and own.p_holm <= ALPHA for own in self.sequences) or (
            self.differences is not None and self.differences.p_value <= ALPHA
        )


def compare(data: TaskData[ComparisonTrial], seed: int, margin: float) -> ComparisonResults:
    """Return what an artifact comparison shows.

    Parameters
    ----------
    data : TaskData of ComparisonTrial
        The answers.
    seed : int
        Of the permutations.
    margin : float
        Within which a share counts as equivalent to one half.

    Raises
    ------
    InputError
        If there is no answer, or no such margin.
    """
    if not 0 < margin < 0.5:
        raise InputError(f"the margin about a share of 0.5 must lie between 0 and 0.5, got {margin:g}")
    trials = data.trials
    if not trials:
        raise InputError("no comparison counts: expected at least one that is neither practice nor flagged")
    names = sequences_in(data)
    answered = [name for name in names if any(trial.sequence == name for trial in trials)]
    sequences, order = _sequence_shares(trials, names, margin), order_of(trials)
    ordered = [trial for trial in trials if trial.response is not None]
    return ComparisonResults(
        data=data,
        margin=margin,
        sequences=sequences,
        pooled=_flagged(estimate_share(count_choices(trials), margin), order),
        first=_flagged(estimate_share(count_choices(ordered, chose_first), margin), order)
        if ordered
        else None,
        differences=sequence_differences(trials, answered, np.random.default_rng(seed)),
        consistency=consistency_of(count_choices(trials)),
        order=order,
        model=choice_model(trials),
        warnings=(*data.warnings, *_warnings(trials, names), *_order_warnings(data, sequences, order)),
    )


def _sequence_shares(
    trials: Sequence[ComparisonTrial], names: Sequence[str], margin: float
) -> tuple[SequenceShare, ...]:
    """Return the share of each sequence, its tests adjusted for their number."""
    own = {name: [trial for trial in trials if trial.sequence == name] for name in names}
    orders = {name: order_of(own[name]) for name in names}
    found = {
        name: _flagged(estimate_share(count_choices(own[name]), margin), orders[name]) if own[name] else None
        for name in names
    }
    different = holm([None if e is None else e.p_value for e in found.values()])
    equal = holm([None if e is None else e.equivalence_p for e in found.values()])
    return tuple(
        SequenceShare(name, found[name], different[k], equal[k], orders[name]) for k, name in enumerate(names)
    )


def _flagged(share: ShareEstimate, order: IntervalOrder) -> ShareEstimate:
    """Return a share with what the order makes of it."""
    flags = dict.fromkeys(words for words in (share.flag, order.flag) if words)
    return dataclasses.replace(share, flag="; ".join(flags))


def _order_warnings(
    data: TaskData[ComparisonTrial], sequences: Sequence[SequenceShare], order: IntervalOrder
) -> tuple[str, ...]:
    """Return where ours came always, or nearly always, in the same interval; what the gate says is said."""
    if confounded_order(data):
        return ()
    over_all = [f"over all sequences {order.flag}"] if order.flag else []
    own = [
        f"comparison of {spaced(s.name)}: {s.order.flag}"
        for s in sequences
        if s.order.flag and not s.order.unknown
    ]
    return (*over_all, *own)


def _warnings(trials: Sequence[ComparisonTrial], names: Sequence[str]) -> tuple[str, ...]:
    """Return which answers are missing."""
    people = sorted({trial.participant_id for trial in trials})
    cells = {(trial.participant_id, trial.sequence) for trial in trials}
    warnings = []
    for name in names:
        missing = [who for who in people if (who, name) not in cells]
        if missing:
            warnings.append(
                f"comparison of {spaced(name)}: no answer of {len(missing)} of {len(people)} participants "
                f"({first_few(missing)})"
            )
    return tuple(warnings)


def choice_model(trials: Sequence[ComparisonTrial]) -> OrdinalFit:
    """Return the fitted model; without the leaning where ours came always in the same interval.

    Parameters
    ----------
    trials : sequence of ComparisonTrial
        All of them, at least one.
    """
    leaning = {OURS_FIRST: 1.0, None: 0.0}
    order = np.array([[leaning.get(trial.ours_interval, -1.0)] for trial in trials])
    known = np.ptp(order) > 0
    who = sorted({trial.participant_id for trial in trials})
    place = {name: k for k, name in enumerate(who)}
    return fit_ordinal(
        OrdinalData(
            responses=np.array([trial.chose_ours for trial in trials], dtype=np.int64),
            n_categories=2,
            design=order if known else order[:, :0],
            names=(LEANING,) if known else (),
            groups=np.array([place[trial.participant_id] for trial in trials], dtype=np.int64),
        )
    )
