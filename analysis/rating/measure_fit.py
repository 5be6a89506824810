"""Which measure of loss explains ratings best: one model of the ratings for each candidate.

In a cumulative-link mixed model each rating is explained by the sequence, by its place, by who gave it, and
by the loss that a candidate says the version has. So what counts is how much higher each sequence is rated in
the version that loses less; what people like about a sequence does not. A candidate stays possible where its
likelihood ratio to the best is within chi-squared's 95 %, with as many degrees of freedom as there are
choices, or as sequences tell (docs/decisions/fitting-the-measure.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from evenlight.analysis.inference.cumulative_link import OrdinalData, OrdinalFit, fit_ordinal, shown_effect
from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.rating.measure_candidates import Condition, MeasureCandidate
from evenlight.analysis.rating.rating_model import VERSION, ordinal_data
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.viewing import RatingTrial

FREE_CHOICES = 4  # bands, threshold, masking, pooling
LEVEL = 0.95
LOSS = "loss"


@dataclass(frozen=True, slots=True)
class FittedCandidate:
    """How well a candidate explains the ratings.

    Attributes
    ----------
    candidate : MeasureCandidate
        Which.
    log_likelihood : float
        Of the ratings.
    effect : FixedEffect
        Log-odds of a higher rating per standard deviation of its loss over what was shown.
    possible : bool
        Whether it is in the 95 % set.
    """

    candidate: MeasureCandidate
    log_likelihood: float
    effect: FixedEffect
    possible: bool = True


@dataclass(frozen=True, slots=True)
class MeasureFit:
    """What ratings say of the candidates.

    Attributes
    ----------
    candidates : tuple of FittedCandidate
        Best first.
    usual : FittedCandidate
        The measure that the optimizer uses by default.
    without : float
        Log-likelihood without any loss: sequence, place and participant alone.
    free : float
        Log-likelihood with an effect of the version of its own in each sequence: the most that any could
        have.
    reach : float
        By how much the log-likelihood may fall short of the best within the 95 % set.
    n_sequences, n, n_groups : int
        Sequences, ratings, participants.
    """

    candidates: tuple[FittedCandidate, ...]
    usual: FittedCandidate
    without: float
    free: float
    reach: float
    n_sequences: int
    n: int
    n_groups: int

    @property
    def best(self) -> FittedCandidate:
        """The candidate of the largest likelihood."""
        return self.candidates[0]

    @property
    def possible(self) -> tuple[FittedCandidate, ...]:
        """Those of the 95 % set."""
        return tuple(fitted for fitted in self.candidates if fitted.possible)

    @property
    def p_of_loss(self) -> float:
        """Of no candidate explaining anything, by the likelihood ratio of the best."""
        return _tail(self.best.log_likelihood - self.without, 1 + told_choices(self.n_sequences))

    @property
    def p_of_the_rest(self) -> float:
        """Of the best explaining all that the versions do, against an effect of its own in each sequence."""
        return _tail(self.free - self.best.log_likelihood, self.n_sequences - 1)


def told_choices(n_sequences: int) -> int:
    """Return how many free choices the ratings can tell: one less than the sequences have differences.

    A measure's losses may be in any unit, so of n differences between versions n - 1 ratios are left.
    """
    return min(FREE_CHOICES, n_sequences - 1)


def fit_measure(
    trials: Sequence[RatingTrial],
    losses: Mapping[Condition, Array],
    candidates: Sequence[MeasureCandidate],
) -> MeasureFit:
    """Fit the ratings by each candidate.

    Parameters
    ----------
    trials : sequence of RatingTrial
        All that count.
    losses : mapping of (str, Version) to array (candidates,)
        Loss of each condition that was rated.
    candidates : sequence of MeasureCandidate
        In the order of the losses, the usual one first.

    Raises
    ------
    InputError
        If too little was rated to tell one measure from another.
    """
    sequences = tuple(dict.fromkeys(trial.sequence for trial in trials))
    if len(sequences) < 2:
        raise InputError(
            "the ratings are of one sequence: with two versions of it every measure fits alike; need two "
            "sequences or more"
        )
    table = np.array([losses[trial.sequence, trial.version] for trial in trials])
    plain = ordinal_data(trials, sequences)
    others = [k for k, name in enumerate(plain.names) if name != VERSION]
    without = replace(plain, design=plain.design[:, others], names=tuple(plain.names[k] for k in others))
    free = fit_ordinal(ordinal_data(trials, sequences, interaction=True), profiled=())
    fitted = [
        _fitted(candidate, without, table[:, k], list(losses.values()), k)
        for k, candidate in enumerate(candidates)
    ]
    usual = fitted[0]
    top = max(one.log_likelihood for one in fitted)
    reach = float(stats.chi2.ppf(LEVEL, told_choices(len(sequences)))) / 2
    marked = [replace(one, possible=top - one.log_likelihood <= reach) for one in fitted]
    return MeasureFit(
        candidates=tuple(sorted(marked, key=lambda one: -one.log_likelihood)),
        usual=replace(usual, possible=top - usual.log_likelihood <= reach),
        without=_likelihood(fit_ordinal(without, profiled=())),
        free=_likelihood(free),
        reach=reach,
        n_sequences=len(sequences),
        n=len(trials),
        n_groups=free.n_groups,
    )


def _fitted(
    candidate: MeasureCandidate, without: OrdinalData, loss: Array, conditions: list[Array], k: int
) -> FittedCandidate:
    """Return the fit of one candidate, its loss in units of its spread over the conditions."""
    unit = float(np.std([condition[k] for condition in conditions]))
    column = loss / unit if unit > 0 else np.zeros_like(loss)
    design = np.column_stack([column, without.design])
    fit = fit_ordinal(replace(without, design=design, names=(LOSS, *without.names)), profiled=())
    return FittedCandidate(candidate, _likelihood(fit), shown_effect(fit, fit.effects[0]))


def _likelihood(fit: OrdinalFit) -> float:
    """Return the log-likelihood of a fit; refuse ratings that have none."""
    if fit.log_likelihood is None:
        flags = "; ".join(flag.value for flag in fit.flags)
        raise InputError(f"the ratings tell no measure from another: {flags}")
    return fit.log_likelihood


def _tail(gain: float, df: int) -> float:
    """Return the p value of a gain in log-likelihood."""
    return float(stats.chi2.sf(2 * max(gain, 0.0), df))
