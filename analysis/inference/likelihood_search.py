"""The maximum of a log-likelihood by Newton's method, and intervals of its profile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evenlight.analysis.inference.adaptive_quadrature import Likelihood
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
    """Return where the likelihood has risen along a step; None where it does not."""
    for _ in range(20):
        parameters = at.parameters + step
        likelihood = objective(parameters)
        if likelihood.value >= at.likelihood.value - ROUNDING:
            return Maximum(parameters, likelihood, False)
        step = step / 2
    return None


@dataclass(frozen=True, slots=True)
class WalledLikelihood:
    """A log-likelihood with soft walls, beyond which its last parameters (those of Λ) only cost.

    A standard deviation that runs to infinity gains next to nothing on its way, slower and slower: the wall
    ends the walk, and the fit says so.

    Attributes
    ----------
    likelihood, first : callable, int
        The log-likelihood, and the first of the parameters with walls.
    furthest : float
        Where the walls stand, to both sides of 0.
    """

    likelihood: Objective
    first: int
    furthest: float

    def __call__(self, parameters: Array) -> Likelihood:
        """Return the likelihood less the squares of how far the parameters lie beyond their walls."""
        inside = self.likelihood(parameters)
        beyond = np.zeros_like(parameters)
        walled = parameters[self.first :]
        beyond[self.first :] = walled - np.clip(walled, -self.furthest, self.furthest)
        if not beyond.any():
            return inside
        bend = np.diag(np.where(beyond != 0, 2.0, 0.0))
        value = inside.value - float(beyond @ beyond)
        return Likelihood(value, inside.gradient - 2 * beyond, inside.hessian - bend)


@dataclass(frozen=True, slots=True)
class HeldParameter:
    """One parameter θ_j held at v, or at v times another, θ_s: the rest stays free.

    Attributes
    ----------
    index, scale : int, int or None
        j, and s; None for θ_j = v itself.
    """

    index: int
    scale: int | None = None

    def insert(self, free: Array, value: float) -> Array:
        """Return all parameters from the free ones and v."""
        full = np.insert(free, self.index, 0.0)
        full[self.index] = value * (1.0 if self.scale is None else full[self.scale])
        return full

    def reduce(self, full: Likelihood, value: float) -> Likelihood:
        """Return the likelihood as a function of the free parameters."""
        gradient, hessian = full.gradient, full.hessian
        aside = float(gradient[self.index])
        if self.scale is not None:
            basis = np.eye(gradient.size)
            basis[self.index, self.scale] = value
            gradient, hessian = basis.T @ gradient, basis.T @ hessian @ basis
        keep = np.delete(np.arange(gradient.size), self.index)
        return Likelihood(full.value, gradient[keep], hessian[np.ix_(keep, keep)], aside)

    def value(self, parameters: Array) -> float:
        """Return v."""
        scale = 1.0 if self.scale is None else float(parameters[self.scale])
        return float(parameters[self.index]) / scale


@dataclass(frozen=True, slots=True)
class ProfileEnd:
    """An end of an interval.

    Attributes
    ----------
    value : float or None
        Where the statistic crosses its critical value; None where it was not found to.
    lost : bool
        Whether the search for it failed; otherwise None says that it is not crossed.
    """

    value: float | None
    lost: bool = False


class Profile:
    """The profile likelihood of one parameter: the others at their best for each of its values."""

    def __init__(self, objective: Objective, top: Maximum, held: HeldParameter) -> None:
        self.objective, self.top, self.held = objective, top, held
        self.estimate = held.value(top.parameters)

    def at(self, value: float, near: Array) -> tuple[float | None, float, Array]:
        """Return the likelihood ratio statistic at a value, its derivative, and where it was found.

        By the envelope theorem the profile's derivative is the likelihood's own. The statistic is None where
        the search for the rest did not converge, or came out above what was taken for the maximum.
        """
        held = self.held

        def reduced(free: Array) -> Likelihood:
            return held.reduce(self.objective(held.insert(free, value)), value)

        found = maximum(reduced, np.delete(near, held.index), PROFILE_DECREMENT)
        full = held.insert(found.parameters, value)
        speed = 1.0 if held.scale is None else float(full[held.scale])
        ratio = 2.0 * (self.top.likelihood.value - found.likelihood.value)
        sound = found.converged and ratio > -ABOVE_THE_TOP
        return max(ratio, 0.0) if sound else None, -2.0 * found.likelihood.aside * speed, full

    def ratio(self, value: float) -> float | None:
        """Return the likelihood ratio statistic of the hypothesis that the parameter has a value, if any."""
        return self.at(value, self.top.parameters)[0]

    def end(self, side: int, critical: float, first: float, furthest: float) -> ProfileEnd:
        """Return where the statistic crosses a critical value, above (1) or below (-1) the estimate.

        The signed root of the statistic is nearly straight: Newton's method on it, kept between what is
        known to lie inside and outside.

        Parameters
        ----------
        side : int
            -1 or 1.
        critical : float
            Of the statistic.
        first : float
            First guess of the distance from the estimate.
        furthest : float
            Largest |value| tried.

        Returns
        -------
        ProfileEnd
            None where it is not crossed within `furthest`; lost where the search does not come to an end.
        """
        wanted = float(np.sqrt(critical))
        inside, outside = self.estimate, side * np.inf
        value, near = float(self.estimate + side * first), self.top.parameters
        for _ in range(PROFILE_STEPS):
            if side * value > furthest:
                return ProfileEnd(None)
            ratio, slope, near = self.at(value, near)
            if ratio is None:
                break
            root = float(np.sqrt(ratio))
            if abs(root - wanted) < ROOT_TOLERANCE:
                return ProfileEnd(value)
            inside, outside = (value, outside) if root < wanted else (inside, value)
            promised = (wanted - root) * 2.0 * root / slope if slope * side > 0 else side * np.inf
            value = self._within(value + promised, value, inside, outside)
        return ProfileEnd(None, lost=True)

    def _within(self, wished: float, value: float, inside: float, outside: float) -> float:
        """Return the next value to try: the wished one if it lies between what is known, and not too far."""
        if np.isinf(outside):
            reach = abs(value - self.estimate)  # at most twice as far as before
            return float(np.clip(wished, value - reach, value + reach))
        if min(inside, outside) < wished < max(inside, outside):
            return wished
        return (inside + outside) / 2
