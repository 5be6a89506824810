"""The pooled model of all comparisons: mixed logistic regression with participants who differ (Section 4.3).

    logit P(ours chosen) = preference_i + leaning · s,    s = 1 if ours came first, -1 if second,

the preference of participant i normal about the population's. Whether ours is chosen more often than by a
coin is the question whether the population's preference is 0; s takes out a leaning to an interval, where the
order is not balanced.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evenlight.analysis.comparison.comparison_counts import OURS_FIRST
from evenlight.analysis.inference.cumulative_link import OrdinalData, OrdinalFit, fit_ordinal
from evenlight.data_schema.viewing import ComparisonTrial

PREFERENCE = "ours chosen by a person in the middle"
LEANING = "first chosen by a person in the middle"
METHOD = "mixed logistic regression, participant random; likelihood ratio, profile interval"


def choice_model(trials: Sequence[ComparisonTrial]) -> OrdinalFit:
    """Return the fitted model; without the leaning where ours came always in the same interval.

    Parameters
    ----------
    trials : sequence of ComparisonTrial
        All of them, at least one.
    """
    order = np.array([[1.0 if trial.ours_interval == OURS_FIRST else -1.0] for trial in trials])
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
