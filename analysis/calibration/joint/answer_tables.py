"""What every participant's answers at every level say about their threshold: tables of log-likelihood.

A table runs over ln(threshold / L), evenly spaced, and over nodes of what is not the threshold: width, guess
and lapse rate. It is made once; the joint model then only shifts, smooths and adds up tables.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    MAX_GUESS,
    MAX_LAPSE,
    PsychometricPrior,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import (
    RampCounts,
    RampLevelKey,
    catch_counts,
    group_by_participant_and_level,
    joined_levels,
    level_order,
    ramp_counts,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.ramp import Procedure, RampTrial
from evenlight.method.psychometric import THRESHOLD_PROBABILITY, WIDTH_LOGITS

LARGEST_STEP = 0.07  # of ln(threshold): the narrowest functions that count rise over 0.4
SMALLEST_STEP = 0.02
BEYOND = 3.0  # ln units by which the grid goes past the rates tested; beyond, the likelihood is flat
WIDTHS = np.geomspace(0.4, 10.0, 15)
LAPSE_NODES, GUESS_NODES = 4, 3
LARGEST_LOGIT = 60.0  # F differs from 0 or 1 by 1e-26 there


@dataclass(frozen=True, slots=True)
class AnswerTables:
    """The log-likelihood of all answers, over thresholds and nodes of width, guess and lapse rate.

    Attributes
    ----------
    participants, levels : tuple of str, tuple of RampLevelKey
        P participants and C levels of the population, in the order of the tables.
    start, step : float
        First node of ln(threshold / L), and the distance of two.
    ln_likelihood : array (C, P, T, K)
        0 where a participant has no answers.
    all_alike : array (P,) of bool
        Whether a participant gave one answer only, or of two intervals was right by chance at best.
    ln_width, lapse_rate, ln_weight : array (P, K)
        What the K nodes of each participant are, and the prior mass of their guess and lapse rate.
    """

    participants: tuple[str, ...]
    levels: tuple[RampLevelKey, ...]
    start: float
    step: float
    ln_likelihood: Array
    all_alike: NDArray[np.bool_]
    ln_width: Array
    lapse_rate: Array
    ln_weight: Array

    @property
    def luminance(self) -> Array:
        """Each level's luminance [cd/m^2], shape (C,)."""
        return np.array([level.luminance for level in self.levels])

    def with_nodes(self, chosen: NDArray[np.intp]) -> AnswerTables:
        """Return the tables with some of each participant's nodes, by number, shape (P, fewer)."""
        take = np.take_along_axis
        return replace(
            self,
            ln_likelihood=take(self.ln_likelihood, chosen[None, :, None, :], axis=3),
            ln_width=take(self.ln_width, chosen, axis=1),
            lapse_rate=take(self.lapse_rate, chosen, axis=1),
            ln_weight=take(self.ln_weight, chosen, axis=1),
        )


def answer_tables(trials: Sequence[RampTrial], prior: PsychometricPrior | None = None) -> AnswerTables:
    """Return the tables of some trials, all of one task.

    Rates are taken relative to the luminance that they were shown at, and calibrations of one level are
    joined. Where thresholds grow as L^0.8 to L^1.2, one 2.5 % off the level's mean is so moved by 0.5 %.

    Parameters
    ----------
    trials : sequence of RampTrial
        Ramps and catch trials; of yes/no, the catch trials tell each participant's guess rate.
    prior : PsychometricPrior, optional
        Of guess and lapse rate.
    """
    prior = prior or PsychometricPrior()
    counts = _counts(trials)
    participants = tuple(dict.fromkeys(who for who, _ in counts))
    joined = joined_levels(level for _, level in counts)
    levels = tuple(sorted(set(joined.values()), key=level_order))
    relative = [np.log(own.rates / level.luminance) for (_, level), own in counts.items()]
    most = max(int(own.n_trials.sum()) for own in counts.values())
    step = float(np.clip(most**-0.5, SMALLEST_STEP, LARGEST_STEP))
    start = min(float(x[0]) for x in relative) - BEYOND
    nodes = np.arange(start, max(float(x[-1]) for x in relative) + BEYOND, step)
    first = {who: own for (who, _), own in reversed(counts.items())}
    grids = [_nuisance_nodes(first[who], prior) for who in participants]
    table = np.zeros((len(levels), len(participants), nodes.size, grids[0].shape[1]))
    for ((who, level), own), x in zip(counts.items(), relative, strict=True):
        place = levels.index(joined[level]), participants.index(who)
        table[place] += _ln_likelihood(own, x, nodes, grids[place[1]])
    ln_width, _, lapse, ln_weight = (np.array([grid[k] for grid in grids]) for k in range(4))
    alike = np.array(
        [_all_alike([own for (p, _), own in counts.items() if p == who]) for who in participants]
    )
    return AnswerTables(participants, levels, start, step, table, alike, ln_width, lapse, ln_weight)


def _counts(trials: Sequence[RampTrial]) -> dict[tuple[str, RampLevelKey], RampCounts]:
    """Return the answers to ramps by participant and level."""
    catches = catch_counts(trials)
    groups = group_by_participant_and_level(trial for trial in trials if not trial.is_catch)
    yes_no = any(level.procedure is Procedure.YES_NO for _, level in groups)
    return {
        key: ramp_counts(group, *(catches.get(key[0], (0, 0)) if yes_no else (0, 0)))
        for key, group in groups.items()
    }


def _all_alike(counts: Sequence[RampCounts]) -> bool:
    """Return whether a participant's answers leave their threshold open to one side."""
    yes = sum(int(own.n_yes.sum()) for own in counts)
    total = sum(int(own.n_trials.sum()) for own in counts)
    return yes == total or yes <= (counts[0].guess_rate or 0.0) * total


def _nuisance_nodes(counts: RampCounts, prior: PsychometricPrior) -> Array:
    """Return ln(width), guess rate, lapse rate and the logarithm of the latter two's mass, shape (4, K)."""
    guess = np.array([[counts.guess_rate or 0.0], [1.0]])
    if counts.guess_rate is None:
        a = prior.guess[0] + counts.catch_yes
        b = prior.guess[1] + counts.catch_trials - counts.catch_yes
        guess = _beta_nodes(a, b, MAX_GUESS, GUESS_NODES)
    lapse = _beta_nodes(*prior.lapse_after(counts.guess_rate), MAX_LAPSE, LAPSE_NODES)
    ln_width, g, m = np.meshgrid(np.log(WIDTHS), guess[0], lapse[0], indexing="ij")
    mass = np.broadcast_to(np.outer(guess[1], lapse[1]), ln_width.shape)
    return np.array([ln_width.ravel(), g.ravel(), m.ravel(), np.log(mass.ravel())])


def _beta_nodes(a: float, b: float, largest: float, size: int) -> Array:
    """Return nodes of a Beta density below a limit and their masses: Gauss-Legendre in its own quantiles."""
    z, weights = special.roots_legendre(size)
    share = float(special.betainc(a, b, largest))
    return np.array([special.betaincinv(a, b, share * (z + 1) / 2), weights / 2])


def _ln_likelihood(counts: RampCounts, x: Array, nodes: Array, nuisance: Array) -> Array:
    """Return the log-likelihood of one participant's answers at one level, shape (T, K).

    With odds s = F / (1 - F): ψ = (γ + (1 - λ)s) / (1 + s) and 1 - ψ = ((1 - γ) + λs) / (1 + s).
    """
    ln_width, g, m, _ = nuisance
    slope = WIDTH_LOGITS * np.exp(-ln_width)
    at_threshold = np.log((THRESHOLD_PROBABILITY - g) / (1 - THRESHOLD_PROBABILITY - m))
    total = np.zeros((nodes.size, ln_width.size))
    for place, n_yes, n_trials in zip(x, counts.n_yes, counts.n_trials, strict=True):
        logit = (place - nodes)[:, None] * slope + at_threshold
        odds = np.exp(np.clip(logit, -LARGEST_LOGIT, LARGEST_LOGIT))
        if n_yes:
            total += n_yes * np.log(g + (1 - m) * odds)
        if n_trials - n_yes:
            total += (n_trials - n_yes) * np.log((1 - g) + m * odds)
        total -= n_trials * np.log1p(odds)
    return total
