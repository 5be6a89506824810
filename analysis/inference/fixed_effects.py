"""The maximum of a log-likelihood by Newton's method, its profiles, and the effects that they give."""

from __future__ import annotations

import enum
import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.analysis.inference.adaptive_quadrature import Likelihood
from evenlight.analysis.inference.mixed_designs import GroupedModel, NullDistribution
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.data_schema.arrays import Array

STEPS = 80
DECREMENT = 1e-9  # rise of the log-likelihood still to be had: far below what a test statistic shows
PROFILE_DECREMENT = 1e-6  # the same on the way to the ends of intervals: 1e-3 standard errors at most
SETTLED = 1e-3  # decrement that counts as none, where quadrature allows no better
LONGEST_STEP = 3.0  # of any parameter, in its own unit (log-odds, ln seconds, 1 / SD)
ROUNDING = 1e-9  # of a log-likelihood
FLATTEST = 1e-12  # curvature that counts as one: beyond, a direction runs to infinity
PROFILE_STEPS = 40
ABOVE_THE_TOP = 1e-3  # a profile higher by so much than the maximum shows that it was none
ROOT_TOLERANCE = 1e-4  # of the signed root of a profile: the interval's end to 1e-4 standard errors
LARGEST_LN_RATIO = math.log(1e6)  # an end of a ratio beyond is none: nobody's answers tell so much (choice)
FLAT = 100.0  # a standard error this large, over the range of its column, is that of an effect without bound


@dataclass(frozen=True, slots=True)
class Maximum:
    """Where a log-likelihood is largest.

    Attributes
    ----------
    parameters, likelihood : array (d,), Likelihood
        Where, and the likelihood there.
    converged : bool
        Whether next to nothing more is to be gained.
    """

    parameters: Array
    likelihood: Likelihood
    converged: bool


Objective = Callable[[Array], Likelihood]


def maximum(objective: Objective, start: Array, enough: float = DECREMENT) -> Maximum:
    """Return the maximum of a log-likelihood by Newton's method, made safe.

    The Hessian's positive eigenvalues change sign (Gill, Murray & Wright 1981, section 4.4.2), so that each
    step goes up; it is shortened until the value rises. Along a direction that runs to infinity the search
    ends where next to nothing (`enough`) is left to be gained.
    """
    best = Maximum(start, objective(start), False)
    for _ in range(STEPS):
        step, decrement = _ascent(best.likelihood)
        if decrement < enough:
            return Maximum(best.parameters, best.likelihood, True)
        step *= min(1.0, LONGEST_STEP / float(np.abs(step).max()))
        moved = _uphill(objective, best, step)
        if moved is None or moved.likelihood.value - best.likelihood.value < enough / 100:
            # Quadrature's own error is left: its value and its derivatives agree no further.
            return Maximum(best.parameters, best.likelihood, decrement < SETTLED)
        best = moved
    return best


def _ascent(likelihood: Likelihood) -> tuple[Array, float]:
    """Return Newton's step upwards, and what the quadratic model promises of it."""
    if not likelihood.gradient.size:
        return likelihood.gradient, 0.0
    curvature, directions = np.linalg.eigh(likelihood.hessian)
    along = directions.T @ likelihood.gradient
    step = along / np.maximum(np.abs(curvature), FLATTEST)
    return directions @ step, 0.5 * float(along @ step)


def _uphill(objective: Objective, at: Maximum, step: Array) -> Maximum | None:
    for _ in range(20):
        parameters = at.parameters + step
        likelihood = objective(parameters)
        if likelihood.value >= at.likelihood.value - ROUNDING:
            return Maximum(parameters, likelihood, False)
        step = step / 2
    return None


def walled(likelihood: Objective, first: int, furthest: float) -> Objective:
    """Return a log-likelihood with soft walls, beyond which its last parameters (those of Λ) only cost.

    A standard deviation that runs to infinity gains next to nothing on its way, slower and slower: the wall
    ends the walk, and the fit says so. What it costs is the squares of how far parameters lie beyond.

    Parameters
    ----------
    likelihood, first : callable, int
        The log-likelihood, and the first of the parameters with walls.
    furthest : float
        Where the walls stand, to both sides of 0.
    """

    def within_walls(parameters: Array) -> Likelihood:
        inside = likelihood(parameters)
        beyond = np.zeros_like(parameters)
        beyond[first:] = parameters[first:] - np.clip(parameters[first:], -furthest, furthest)
        if not beyond.any():
            return inside
        bend = np.diag(np.where(beyond != 0, 2.0, 0.0))
        value = inside.value - float(beyond @ beyond)
        return Likelihood(value, inside.gradient - 2 * beyond, inside.hessian - bend, scores=inside.scores)

    return within_walls


ProfileEnd = tuple[float | None, bool]  # where the statistic is critical, if it is; whether the search failed


class Profile:
    """The profile likelihood of one parameter: the others at their best for each of its values v.

    Parameters
    ----------
    objective, top : callable, Maximum
        The log-likelihood, and its maximum.
    index, scale : int, int or None
        Which parameter, θ_j = v; with a scale s it is held at v times another one, θ_j = v θ_s.
    """

    def __init__(self, objective: Objective, top: Maximum, index: int, scale: int | None = None) -> None:
        self.objective, self.top, self.index, self.scale = objective, top, index, scale
        self.estimate = float(top.parameters[index]) / self._unit(top.parameters)

    def _unit(self, parameters: Array) -> float:
        return 1.0 if self.scale is None else float(parameters[self.scale])

    def _insert(self, free: Array, value: float) -> Array:
        full = np.insert(free, self.index, 0.0)
        full[self.index] = value * self._unit(full)
        return full

    def standard_error(self, clustered: bool = False) -> float:
        """Return the standard error of v by the curvature of the likelihood, and the delta method.

        Clustered, it is that of the sandwich over participants (Huber 1967; White 1982), whose searches may
        be alike in ways that the model does not know.
        """
        parameters = self.top.parameters
        direction = np.zeros(parameters.size)
        direction[self.index] = 1.0
        if self.scale is not None:
            scale = parameters[self.scale]
            direction[self.index] = 1.0 / scale
            direction[self.scale] = -parameters[self.index] / scale**2
        curvature, axes = np.linalg.eigh(-self.top.likelihood.hessian)
        along = axes.T @ direction
        scores = self.top.likelihood.scores
        if clustered and scores is not None:
            influence = scores @ (axes @ (along / np.maximum(curvature, FLATTEST)))
            return float(np.sqrt(influence @ influence))
        return float(np.sqrt(np.sum(along**2 / np.maximum(curvature, FLATTEST))))

    def at(self, value: float, near: Array) -> tuple[float | None, float, Array]:
        """Return the likelihood ratio statistic at a value, its derivative, and where it was found.

        By the envelope theorem the profile's derivative is the likelihood's own. The statistic is None where
        the search for the rest did not converge, or came out above what was taken for the maximum.
        """

        def reduced(free: Array) -> Likelihood:
            full = self.objective(self._insert(free, value))
            gradient, hessian, aside = full.gradient, full.hessian, float(full.gradient[self.index])
            if self.scale is not None:
                basis = np.eye(gradient.size)
                basis[self.index, self.scale] = value
                gradient, hessian = basis.T @ gradient, basis.T @ hessian @ basis
            keep = np.delete(np.arange(gradient.size), self.index)
            return Likelihood(full.value, gradient[keep], hessian[np.ix_(keep, keep)], aside)

        found = maximum(reduced, np.delete(near, self.index), PROFILE_DECREMENT)
        parameters = self._insert(found.parameters, value)
        slope = -2.0 * found.likelihood.aside * self._unit(parameters)
        ratio = 2.0 * (self.top.likelihood.value - found.likelihood.value)
        sound = found.converged and ratio > -ABOVE_THE_TOP
        return max(ratio, 0.0) if sound else None, slope, parameters

    def end(self, side: int, critical: float, first: float, furthest: float) -> ProfileEnd:
        """Return where the statistic crosses a critical value, above (1) or below (-1) the estimate.

        The signed root of the statistic is nearly straight: Newton's method on it, kept between what is
        known to lie inside and outside.

        Parameters
        ----------
        side, critical : int, float
            -1 or 1; of the statistic.
        first, furthest : float
            First guess of the distance from the estimate; largest |value| tried.

        Returns
        -------
        value : float or None
            None where it is not crossed within `furthest`.
        lost : bool
            Whether the search did not come to an end.
        """
        wanted = float(np.sqrt(critical))
        inside, outside = self.estimate, side * np.inf
        value, near = float(self.estimate + side * first), self.top.parameters
        for _ in range(PROFILE_STEPS):
            if side * value > furthest:
                return None, False
            ratio, slope, near = self.at(value, near)
            if ratio is None:
                break
            root = float(np.sqrt(ratio))
            if abs(root - wanted) < ROOT_TOLERANCE:
                return value, False
            inside, outside = (value, outside) if root < wanted else (inside, value)
            promised = (wanted - root) * 2.0 * root / slope if slope * side > 0 else side * np.inf
            value = self._within(value + promised, value, inside, outside)
        return None, True

    def _within(self, wished: float, value: float, inside: float, outside: float) -> float:
        """Return the next value to try: the wished one if it lies between what is known, and not too far."""
        if np.isinf(outside):
            reach = abs(value - self.estimate)  # at most twice as far as before
            return float(np.clip(wished, value - reach, value + reach))
        if min(inside, outside) < wished < max(inside, outside):
            return wished
        return (inside + outside) / 2


class Flag(enum.Enum):
    """What a reader of an effect must know; the value says it in words. Each analysis has its own kinds."""


class FitFlag(Flag):
    """What a reader of a fit, or of one of its effects, must know."""

    NONE = ""
    NO_VARIATION = "all answers are the same: nothing can be estimated"
    NOTHING_OBSERVED = "nothing was ever found"
    NO_SCATTER = "the times leave no scatter to judge by: nothing can be estimated"
    SEPARATED = "no finite estimate: the answers separate perfectly"
    NOT_ESTIMABLE = "an effect cannot be told apart from the others"
    ONE_PARTICIPANT = "one participant: no participant effect, nothing said of other people"
    UNUSED_CATEGORIES = "categories that nobody used were left out"
    NOT_CONVERGED = "the model did not converge"
    TOO_FEW_PEOPLE = "too few participants for a test or an interval"
    NO_BOUNDS = "not bounded"
    NO_UPPER_BOUND = "runs to plus infinity, as the answers separate perfectly: it has no upper end"
    NO_LOWER_BOUND = "runs to minus infinity, as the answers separate perfectly: it has no lower end"
    RUNS_UP = "runs to plus infinity"
    RUNS_DOWN = "runs to minus infinity"
    LOST_LOWER = "the search for the lower end of the interval did not converge"
    LOST_UPPER = "the search for the upper end of the interval did not converge"
    LOST_TEST = "the search for the test's statistic did not converge"
    NO_LOWER = "the interval has no lower end"
    NO_UPPER = "the interval has no upper end"


SEPARATING = (FitFlag.SEPARATED, FitFlag.NO_UPPER_BOUND, FitFlag.NO_LOWER_BOUND)


def flags_in_words(flags: Iterable[Flag]) -> str:
    """Return flags as one remark; empty for none."""
    return "; ".join(flag.value for flag in flags)


@dataclass(frozen=True, slots=True)
class FixedEffect:
    """One effect of a likelihood model.

    Attributes
    ----------
    name : str
        Of its column.
    estimate : float or None
        Maximum of the likelihood, in the unit of the linear predictor; None where the data do not give it.
    standard_error : float or None
        From the curvature of the likelihood; None where there is none.
    ci_low, ci_high : float or None
        95 % confidence interval of the profile likelihood with small-sample correction; None for an end
        without bound, or unknown (`flags` say so).
    p_value : float or None
        Of the likelihood-ratio test against 0, with the same correction.
    df : float or None
        Degrees of freedom of that correction.
    flags : tuple of Flag
        Why it should be looked at, or is missing; empty for nothing.
    endless : bool
        Whether it runs to infinity.
    """

    name: str
    estimate: float | None = None
    standard_error: float | None = None
    ci_low: float | None = None
    ci_high: float | None = None
    p_value: float | None = None
    df: float | None = None
    flags: tuple[Flag, ...] = ()
    endless: bool = False

    def shown(
        self,
        change: Callable[[float], float] = lambda x: x,
        missing: str = "the data do not give it",
    ) -> Effect:
        """Return it as a row shows it.

        Parameters
        ----------
        change : callable
            Of the unit of the model to that of the row: `math.exp` where this is the logarithm of a ratio,
            of which ends beyond a million, or a millionth, are none.
        missing : str
            The flag where there is no estimate and no flag says why.
        """
        ends, flags = [self.estimate, self.ci_low, self.ci_high], self.flags
        if change is math.exp:
            beyond = [x is not None and abs(x) > LARGEST_LN_RATIO for x in ends]
            ends = [None if far else x for far, x in zip(beyond, ends, strict=True)]
            new = itertools.compress((FitFlag.NO_BOUNDS, FitFlag.NO_LOWER, FitFlag.NO_UPPER), beyond)
            flags = tuple(dict.fromkeys((*flags, *new)))
        value, low, high = (None if x is None else change(x) for x in ends)
        flag = flags_in_words(flags) or ("" if value is not None else missing)
        return Effect(value, low, high, flag, self.p_value)


def student_effect(
    name: str, estimate: float, error: float, df: float, flags: tuple[Flag, ...] = ()
) -> FixedEffect:
    """Return an effect with the interval and test of its standard error, by Student's t."""
    t = NullDistribution(df)
    half, p_value = t.quantile * error, t.p_value((estimate / error) ** 2)
    return FixedEffect(name, estimate, error, estimate - half, estimate + half, p_value, df, flags)


def fit_flags(
    effects: Sequence[FixedEffect], model: GroupedModel, top: Maximum, apart: bool = False
) -> list[FitFlag]:
    """Return what to know of a fit as a whole; apart: participants hardly vary within themselves."""
    found = {
        FitFlag.NOT_ESTIMABLE: not all(model.design.identifiable),
        FitFlag.SEPARATED: any(effect.endless for effect in effects),
        FitFlag.NOT_CONVERGED: apart or not top.converged,
    }
    return [flag for flag, holds in found.items() if holds]


def profiled_effect(
    name: str,
    profile: Profile,
    span: float,
    furthest: float,
    reference: NullDistribution,
    profiled: bool = True,
    sign: int = 1,
    clustered: bool = False,
) -> FixedEffect:
    """Return an effect with its interval and test.

    Parameters
    ----------
    name, profile : str, Profile
        Of the effect, and the likelihood along it.
    span, furthest : float
        Range of its column: how far the linear predictor moves by it; and the furthest that this is tried to
        move: beyond, an interval has no end.
    reference : NullDistribution
        What its test is compared with.
    profiled : bool
        Whether interval and test are by the profile likelihood; else by standard error and Student's t.
    sign : int
        -1 for minus the parameter: a cut point as an intercept.
    clustered : bool
        Whether interval and test are by the sandwich over participants, as many as the reference has units.
    """
    error, estimate = profile.standard_error(), profile.estimate
    unbounded = error * span > FLAT
    value, spread = (None, None) if unbounded else (sign * estimate, error)
    if reference.df < 1:
        flag = FitFlag.SEPARATED if unbounded else FitFlag.TOO_FEW_PEOPLE
        return FixedEffect(name, value, spread, flags=(flag,), endless=unbounded)
    if clustered and reference.units and not unbounded:
        error = profile.standard_error(clustered) * math.sqrt(reference.units / (reference.units - 1))
    if not (profiled or unbounded):
        return student_effect(name, sign * estimate, error, reference.df)
    critical, furthest = reference.critical, furthest / span
    first = max(abs(estimate) - furthest / 3, furthest / 10) if unbounded else np.sqrt(critical) * error
    found: list[ProfileEnd] = [
        (None, False) if unbounded and side * estimate > 0 else profile.end(side, critical, first, furthest)
        for side in (-1, 1)
    ]
    ratio = profile.at(0.0, profile.top.parameters)[0]
    ends = [(None if end is None else sign * end, lost) for end, lost in found[::sign]]
    flags = _flags(unbounded, sign * estimate, ends, ratio)
    low, high = (end for end, _ in ends)
    tested = None if ratio is None else reference.p_value(ratio)
    endless = unbounded and FitFlag.NO_BOUNDS not in flags
    return FixedEffect(name, value, spread, low, high, tested, reference.df, flags, endless)


def _flags(
    unbounded: bool, estimate: float, ends: list[ProfileEnd], ratio: float | None
) -> tuple[FitFlag, ...]:
    up = estimate > 0
    searches = (FitFlag.LOST_LOWER, FitFlag.LOST_UPPER)
    lost = [flag for (_, is_lost), flag in zip(ends, searches, strict=True) if is_lost]
    lost += [FitFlag.LOST_TEST] if ratio is None else []
    if lost:
        return (*[FitFlag.RUNS_UP if up else FitFlag.RUNS_DOWN] * unbounded, *lost)
    sides = (FitFlag.NO_LOWER, FitFlag.NO_UPPER)
    missing = tuple(flag for (end, _), flag in zip(ends, sides, strict=True) if end is None)
    if not unbounded:
        return missing
    one_side = FitFlag.NO_UPPER_BOUND if up else FitFlag.NO_LOWER_BOUND
    return (FitFlag.NO_BOUNDS if len(missing) == 2 else one_side,)
