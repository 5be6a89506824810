"""What the choice of the rate limit does to the optimizer's result on a clip: one analysis, many limits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from evenlight.analysis.calibration.choices.limit_choices import LimitChoices
from evenlight.analysis.report_prose import prose
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.choices import SolverName
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.optimizer.optimize import Problem, optimize, pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.solvers import make_solver
from evenlight.method.rate_limit import allowed_rate, modulation_rate
from evenlight.stimuli.sequences import built_in_sequence, open_video
from evenlight.stimuli.video.video_analysis import VideoAnalysis
from evenlight.stimuli.video.video_source import VideoSource, field_of_view_of
from evenlight.stimuli.video.viewing_geometry import seen_video

# The clip that serves where no other is given: the sun rises and sets again, as in the paper's timelapse.
DEFAULT_CLIP, DEFAULT_SIZE, DEFAULT_DURATION, DEFAULT_FPS = "sunrise", (384, 216), 20.0, 10.0


@dataclass(frozen=True, slots=True)
class ClipOutcome:
    """What the optimizer makes of a clip under one rate limit.

    Attributes
    ----------
    choice, factors : str, array (N,)
        Name of the limit among the choices, and the brightness track b.
    objective, gain : float
        Mean absolute difference of contrast loss between two frames, and how much less that is than under
        constant dimming, as a share; 0 where that has no difference.
    fastest : float
        Fastest luminance change [cd/m^2/s].
    share_of_limit, share_of_fitted : float
        Largest ratio of a step's rate to this limit, and to the fitted curve. The second is above 1 where a
        more permissive choice was made use of.
    time_at_limit : float
        Share of the steps within 1 % of this limit.
    """

    choice: str
    factors: Array
    objective: float
    gain: float
    fastest: float
    share_of_limit: float
    share_of_fitted: float
    time_at_limit: float


@dataclass(frozen=True, slots=True)
class ClipComparison:
    """The outcomes of all choices on one clip.

    Attributes
    ----------
    video, budget : str, float
        Name of the clip, and mean brightness factor.
    times : array (N,)
        Of the frames [s].
    objective_baseline : float
        Mean absolute difference of contrast loss between two frames at constant dimming.
    outcomes : tuple of ClipOutcome
        One per choice, in their order.
    """

    video: str
    budget: float
    times: Array
    objective_baseline: float
    outcomes: tuple[ClipOutcome, ...]

    def of(self, choice: str) -> ClipOutcome:
        """Return the outcome of a choice."""
        return next(outcome for outcome in self.outcomes if outcome.choice == choice)


def compare_on_clip(
    choices: LimitChoices, curves: LossCurves, budget: float, power_model: PowerModel
) -> ClipComparison:
    """Return what each choice of the rate limit does to the track of a clip.

    Parameters
    ----------
    choices, curves : LimitChoices, LossCurves
        The limits, the fitted one first; of the clip, on the display of the calibration.
    budget, power_model : float, PowerModel
        Mean brightness factor, and the panel; it changes nothing but what a watt is, as factors are counted.

    Raises
    ------
    InputError
        If no track can meet the budget.
    """
    fitted = _problem(curves, budget, choices.fitted.limit, power_model)
    baseline = fitted.objective(fitted.baseline())
    outcomes = []
    for choice in choices.choices:
        problem = _problem(curves, budget, choice.limit, power_model)
        solver = make_solver(SolverName.SPLITTING, np.random.default_rng(1))
        factors = optimize(problem, solver).factors
        outcomes.append(_outcome(choice.name, problem, fitted, factors, baseline))
    return ClipComparison(curves.video, budget, curves.times, baseline, tuple(outcomes))


def require_budget(budget: float) -> None:
    """Raise `InputError` if no clip could be dimmed to a mean brightness factor."""
    lowest = float(brightness_factors()[0])
    if not lowest <= budget <= 1:
        raise InputError(f"the budget must lie between {lowest:g} and 1, got {budget:g}")


def open_clip(name: str | None) -> VideoSource:
    """Return the clip of a name, or the default one: a sunrise, short and small."""
    if name is not None:
        return open_video(name)
    return built_in_sequence(DEFAULT_CLIP, DEFAULT_SIZE, DEFAULT_DURATION, DEFAULT_FPS)


def curves_of(source: VideoSource, display: Display, report: Callable[[int, int | None], None]) -> LossCurves:
    """Return the loss curves of a clip; `report` is called with the frames done and their total."""

    def watched() -> Iterator[Frame]:
        for done, frame in enumerate(source.frames(), start=1):
            yield frame
            report(done, source.n_frames)

    frames, geometry = seen_video(watched(), display, field_of_view_of(source), source.name)
    return VideoAnalysis().curves(frames, geometry, source.name)


def _problem(curves: LossCurves, budget: float, limit: RateLimit, power_model: PowerModel) -> Problem:
    """Return the problem of a clip under a limit."""
    return pose(curves, Request(budget, BudgetUnit.FACTOR, power_model, limit))


def _outcome(name: str, problem: Problem, fitted: Problem, factors: Array, baseline: float) -> ClipOutcome:
    """Return the figures of a track."""
    objective = problem.objective(factors)
    rate = np.abs(modulation_rate(factors, problem.luminance, problem.curves.durations))[:-1]
    allowed = allowed_rate(factors, problem.luminance, problem.rate_limit)[:-1]
    return ClipOutcome(
        choice=name,
        factors=factors,
        objective=objective,
        gain=1 - objective / baseline if baseline > 0 else 0.0,
        fastest=float(rate.max(initial=0.0)),
        share_of_limit=problem.rate_ratio(factors),
        share_of_fitted=fitted.rate_ratio(factors),
        time_at_limit=float(np.mean(rate >= 0.99 * allowed)) if rate.size else 0.0,
    )


def in_words(choices: LimitChoices, comparison: ClipComparison) -> str:
    """Return what the choice does on the clip, in a few sentences."""
    fitted, *others = comparison.outcomes
    by_gain = sorted(others, key=lambda outcome: outcome.gain)
    return prose(
        "fit_choices_on_clip",
        comparison=comparison,
        fitted=fitted,
        ends=(by_gain[0], max(others, key=lambda outcome: outcome.gain)) if others else (),
        boldest=max(others, key=lambda outcome: outcome.share_of_fitted, default=None),
        words={choice.name: choice.words for choice in choices.choices},
    )[0]
