"""A calibration that can be asked, in Python: thresholds, psychometric functions, the rate limit."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from matplotlib.figure import Figure
from scipy import special

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.fit_report import write_calibration
from evenlight.analysis.calibration.inference_data import DRAWS, inference_data
from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    PsychometricFit,
    posterior_grid,
)
from evenlight.analysis.calibration.ramp_findings import calibration_drawings, first_lines
from evenlight.analysis.calibration.rate_limit.conditions import condition_of
from evenlight.analysis.report import KeyFigure
from evenlight.analysis.results import Result, write_drawing
from evenlight.data_schema.arguments import number, whole
from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.method.psychometric import (
    WIDTH_LOGITS,
    PsychometricFunction,
    rate_at,
    threshold_logit,
)

if TYPE_CHECKING:
    import pandas as pd

SAME_LUMINANCE = 0.01  # as a share: luminances are given with few digits
OF_A_LEVEL = ("participant_id", "screen", "factor", "luminance_cd_m2", "direction", "ramp_duration_s")


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class RampFit(Result):
    """What ramps and their answers say: thresholds of each participant, and the rate limit of all.

    `print(fit)` shows what came out; `fit.rate_limit(luminance)` is ΔL [cd/m^2/s] at luminances; `fit.save`
    writes `thresholds.csv`, `rate_limit.json`, `fit_summary.json` and both figures with their numbers.

    Attributes
    ----------
    calibration : Calibration
        Everything that was fitted.
    """

    made_by: ClassVar = "fit"
    calibration: Calibration

    @property
    def thresholds(self) -> pd.DataFrame:
        """The columns of `thresholds.csv`: a row for each participant and level, with credible intervals."""
        return self.to_frame()

    @property
    def rate_limit(self) -> RateLimit:
        """ΔL(L), the fastest change of luminance allowed, for `optimize` and `OnlineController`."""
        fitted = self.calibration.rate_limit.limit
        return dataclasses.replace(fitted, simulated=self.calibration.data.simulated)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of the results should know."""
        return self.calibration.warnings

    def threshold(self, proportion: float = 0.5) -> pd.DataFrame:
        """Return the rate that each participant notices in a proportion of the trials, at each level.

        Guesses and lapses do not count: at a proportion p the psychometric function is γ + (1 - γ - λ) p.
        (`thresholds` has the rate at which γ + (1 - γ) p is 75 %: guesses included, lapses not.)

        Parameters
        ----------
        proportion : float
            Between 0 and 1.

        Returns
        -------
        DataFrame
            A row for each participant and level: `participant_id`, `screen`, `factor`, `luminance_cd_m2`,
            `direction`, `ramp_duration_s`; `rate_cd_m2_s` with its 95 % credible interval, `ci_low` and
            `ci_high` [cd/m^2/s]; and `flag`, as in `thresholds`.

        Raises
        ------
        InputError
            If the proportion is not between 0 and 1.
        """
        import pandas as pd

        if not 0 < number("proportion", proportion) < 1:
            raise ArgumentError("proportion", f"must lie between 0 and 1, got {proportion}")
        rows = []
        for own in self.calibration.thresholds:
            level, function = mapping_from_record(own.threshold), own.fit.function
            rise = 1 - function.guess_rate - function.lapse_rate
            rate = float(rate_at(function.guess_rate + rise * proportion, function))
            ci_low, ci_high = _credible_interval(own.fit, proportion)
            found = {"rate_cd_m2_s": rate, "ci_low": ci_low, "ci_high": ci_high, "flag": level["flag"]}
            rows.append({name: level[name] for name in OF_A_LEVEL} | found)
        return pd.DataFrame(rows)

    def psychometric(
        self,
        participant: str | int,
        level: float,
        *,
        direction: str | None = None,
        ramp_duration: float | None = None,
    ) -> PsychometricFunction:
        """Return the psychometric function of a participant at a level.

        Parameters
        ----------
        participant : str or int
            As in `thresholds`.
        level : float
            Initial luminance of the ramps [cd/m^2], to 1 %.
        direction : {"down", "up"}, optional
            Where ramps of both were shown.
        ramp_duration : float, optional
            Where ramps of several durations were shown [s].

        Returns
        -------
        function
            `function(rate)` is the probability of the answer "yes" (of two intervals, of the right one) at
            rates [cd/m^2/s]. Its attributes: `threshold` [cd/m^2/s], where it is 75 % but for lapses;
            `slope` there, per unit of ln(rate); `guess_rate` and `lapse_rate`.

        Raises
        ------
        InputError
            If there is no such level, or several.
        """
        own = [fit for fit in self.calibration.thresholds if fit.threshold.participant_id == str(participant)]
        found = [
            fit
            for fit in own
            if abs(fit.threshold.luminance - level) <= SAME_LUMINANCE * level
            and direction in (None, fit.threshold.direction.value)
            and ramp_duration in (None, fit.threshold.ramp_duration)
        ]
        if not own:
            who = ", ".join(self.calibration.data.participant_ids)
            raise InputError(f"there is no participant {participant}; there are {who}")
        if len(found) != 1:
            there = "; ".join(
                f"{fit.threshold.luminance:.4g} cd/m^2, {condition_of(fit.threshold).words}"
                for fit in found or own
            )
            what = "several levels match" if found else "there is no level of"
            raise InputError(f"participant {participant}: {what} {level:g} cd/m^2; there are {there}")
        return found[0].fit.function

    def inference_data(self, draws: int = DRAWS, seed: int = 1) -> Any:
        """Return draws from the joint model's posterior, of curve and people together, for ArviZ.

        Needs the extra `bayes`. `evenlight fit --checks` writes it, and checks the model.

        Parameters
        ----------
        draws : int
            How many; they are independent.
        seed : int
            Of the random numbers.

        Returns
        -------
        arviz.InferenceData
            `posterior` has the rate limit [cd/m^2/s] at luminances, each participant's factor, width, guess
            and lapse rate, and the spreads; `log_likelihood` and `posterior_predictive` are of the answers of
            a participant at a level. Units and what is approximate are in the attributes.

        Raises
        ------
        InputError
            If ArviZ is not installed, or there is no joint model.
        """
        return inference_data(self.calibration, whole("draws", draws, 1), whole("seed", seed))

    @property
    def heading(self) -> str:
        """What it is, in a few words."""
        data = self.calibration.data
        people = len(data.participant_ids)
        who = f"{people} {'simulated ' * data.simulated}participant{'s' * (people > 1)}"
        return f"RampFit of {who}: {len(self.calibration.thresholds)} thresholds"

    @property
    def first_lines(self) -> tuple[str, tuple[KeyFigure, ...]]:
        """What came out, and the key figures."""
        return first_lines(self.calibration)

    @property
    def figures(self) -> Mapping[str, Figure]:
        """The figures `psychometric` and `rate_limit`."""
        drawn = calibration_drawings(self.calibration)
        return {own.name: own.figure for own in drawn}

    def to_frame(self) -> pd.DataFrame:
        """Return the thresholds, as in `thresholds.csv`."""
        import pandas as pd

        return pd.DataFrame([mapping_from_record(fit.threshold) for fit in self.calibration.thresholds])

    def write(self, folder: Path) -> None:
        """Write `thresholds.csv`, `rate_limit.json`, `fit_summary.json`, and each figure with its numbers."""
        write_calibration(self.calibration, folder, provenance_now())
        for drawing in calibration_drawings(self.calibration):
            write_drawing(folder, drawing)


def _credible_interval(fit: PsychometricFit, proportion: float) -> tuple[float, float]:
    """Return the 95 % credible interval of the rate at a proportion of the rise [cd/m^2/s]."""
    grid = posterior_grid(fit.counts)
    ln_threshold, ln_width, guess = np.ix_(*(axis.nodes for axis in grid.axes[:3]))
    distance = (special.logit(proportion) - threshold_logit(guess)) / WIDTH_LOGITS
    ln_rate = (ln_threshold + np.exp(ln_width) * distance).ravel()
    order = np.argsort(ln_rate)
    masses = grid.masses.sum(axis=3).ravel()[order]
    ends = np.interp((0.025, 0.975), np.cumsum(masses) - masses / 2, ln_rate[order])
    low, high = np.exp(ends).tolist()
    return low, high
