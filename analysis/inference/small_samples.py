"""What a likelihood ratio means with few participants: Student's t in place of the normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

LEVEL = 0.95  # of every interval


@dataclass(frozen=True, slots=True)
class Reference:
    """What a likelihood ratio statistic is compared with.

    In a normal model of m independent units with d degrees of freedom, whose variance is estimated by maximum
    likelihood, the statistic is an increasing function of Student's t: LR = m ln(1 + t² / d), exactly (e.g.
    Cox & Hinkley 1974, Theoretical Statistics, section 9.3). Units are participants for an effect that is
    tested against the differences between participants. `units` None takes t² = LR: a model without an
    estimated variance of its answers.

    Attributes
    ----------
    df : float
        d.
    units : float or None
        m.
    """

    df: float
    units: float | None = None

    @property
    def critical(self) -> float:
        """Statistic beyond which a two-sided test at 5 % rejects."""
        t_squared = float(special.stdtrit(self.df, (1 + LEVEL) / 2)) ** 2
        return t_squared if self.units is None else float(self.units * np.log1p(t_squared / self.df))

    def p_value(self, ratio: float) -> float:
        """Return the two-sided p value of a likelihood ratio statistic.

        >>> reference = Reference(df=16, units=17)
        >>> round(reference.p_value(reference.critical), 12)
        0.05
        """
        t_squared = ratio if self.units is None else self.df * np.expm1(min(ratio / self.units, 500.0))
        return float(2 * special.stdtr(self.df, -np.sqrt(t_squared)))

    @property
    def quantile(self) -> float:
        """Standard errors from the estimate to the end of a 95 % interval that goes by curvature."""
        return float(special.stdtrit(self.df, (1 + LEVEL) / 2))


@dataclass(frozen=True, slots=True)
class Sample:
    """What an effect is tested against.

    Attributes
    ----------
    groups : array (n,) of int
        Participant of each observation, 0 to P - 1.
    informative : int
        Observations that tell a value: all answers, or the times that are not censored.
    own_variance : bool
        Whether the scatter of single observations is estimated (times), or follows from the model (answers).
    """

    groups: NDArray[np.int64]
    informative: int
    own_variance: bool


def reference_of(design: NDArray[np.float64], index: int, sample: Sample, varies: bool = False) -> Reference:
    """Return what the test of one column of a design is compared with.

    An effect that differs between participants, or that depends on who took part, is tested against the
    differences between participants: Student's t with the participants' degrees of freedom. One that is seen
    within everybody: with those of the observations that are left. One participant says nothing of others,
    and is described by the observations alone.

    Parameters
    ----------
    design : array (n, k)
        All columns, with one of ones if the model has an intercept of its own.
    index : int
        The column tested.
    sample : Sample
        The observations.
    varies : bool
        Whether the effect itself differs between participants.
    """
    n_groups, k = int(sample.groups.max()) + 1, design.shape[1]
    if n_groups == 1:
        return Reference(sample.informative - k, sample.informative if sample.own_variance else None)
    if varies:
        return Reference(n_groups - 1, n_groups)
    between = between_directions(design, sample.groups)
    if weight_of_people(design, index, sample.groups) > 0.5:
        return Reference(n_groups - between, n_groups)
    units = sample.informative - n_groups
    return Reference(units - (k - between), units if sample.own_variance else None)


def weight_of_people(design: NDArray[np.float64], index: int, groups: NDArray[np.int64]) -> float:
    """Return by how much the differences between participants enter the variance of an effect.

    Var = (σ² + λ σ_u²) / Σ x̃² with what the other columns do not explain of the column, x̃, and
    λ = Σ_p (Σ x̃ of p)² / Σ x̃². 0: the effect is seen within everybody, and who they are cancels.

    >>> design = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
    >>> round(weight_of_people(design, 1, np.array([0, 0, 1, 1])), 12)
    0.0
    >>> round(weight_of_people(design, 1, np.array([0, 1, 0, 1])), 12)
    2.0
    """
    own = design @ np.linalg.inv(design.T @ design)[:, index]
    return float(np.sum(np.bincount(groups, weights=own) ** 2) / (own @ own))


def between_directions(design: NDArray[np.float64], groups: NDArray[np.int64]) -> int:
    """Return how many combinations of a design's columns compare participants rather than their answers.

    >>> design = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
    >>> between_directions(design, np.array([0, 0, 1, 1])), between_directions(design, np.array([0, 1, 0, 1]))
    (1, 2)
    """
    sums = np.stack([np.bincount(groups, weights=column) for column in design.T], axis=1)
    means = sums / np.sqrt(np.bincount(groups))[:, None]
    shares = linalg.eigh(means.T @ means, design.T @ design, eigvals_only=True)
    return int(np.sum(shares > 0.5))
