"""Gains of the controller chosen for given content, within margins of stability.

By the circle criterion (`online.stability_margins`) what counts for stability is the sum
κ = s · (K_p + K_i / 2 + 2 K_d) of gains per frame: below 1 the loop is stable, and 1 / κ is its gain margin.
So the gains are sought on triangles: κ at most what the gain margin allows, shared out between the three
terms. Of those with enough phase margin, the ones win under which the loss of the content, run through the
controller with its rate limit, stays nearest to the target; and of those that are as good but for a few
percent, the gentlest. See docs/decisions/controller-tuning.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.quantities import check_limits, quantity
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_and_slope
from evenlight.method.online.control_curves import ControlledTrack, control_curves
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.online.stability_margins import FrameGains, Margins, frame_gains, margins

DIVISIONS = 6  # of each side of the first triangle of shares
SIZES = (1.0, 0.5, 0.25, 0.1, 0.03, 0.01)  # κ as shares of the largest that is allowed
REFINEMENTS = 5  # times that the steps of the search are halved about the best gains
AS_GOOD = 1.02  # of the least error: gains that leave no more are as good
SAME_FACTOR = 1e-6  # two factors nearer to each other tell no slope

Shares = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class MarginRequirements:
    """What tuned gains must keep."""

    gain_margin: float = quantity("1", "least gain margin; 2 is 6 dB", above=1.0, default=2.0)
    phase_margin: float = quantity("deg", "least phase margin", minimum=0.0, maximum=90.0, default=45.0)
    quantile: float = quantity(
        "1",
        "quantile of the frames' steepest slopes at which both margins are",
        minimum=0.0,
        maximum=1.0,
        default=0.99,
    )

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class TuningResult:
    """Gains that suit some content.

    Attributes
    ----------
    settings : ControllerSettings
        With the gains that were found; its `gain_rate` is that of the settings it began with.
    slope : float
        s, at which the margins are.
    margins, margins_before : Margins
        Of the gains found, and of those it began with.
    error, error_before : float
        Root mean square over time of loss - target, with either.
    tries : int
        Runs of the controller over the content.
    """

    settings: ControllerSettings
    slope: float
    margins: Margins
    margins_before: Margins
    error: float
    error_before: float
    tries: int


def content_slopes(curves: LossCurves, target_loss: float, lowest_factor: float) -> Array:
    """Return for each frame the steepest slope that its loss has as seen from the factor of the target.

    The circle criterion asks for the sector that holds the loss about its rest: the secants from the factor
    at which the frame has the target loss to any other factor, the tangent there among them.

    Parameters
    ----------
    curves : LossCurves
        Of N frames.
    target_loss : float
        c_r.
    lowest_factor : float
        Lower bound of the factor.

    Returns
    -------
    array, (N,)
        [loss per factor], 0 for a frame that loses nothing.
    """
    rest = np.maximum(factor_at_loss(curves, np.full(curves.n_frames, target_loss)), lowest_factor)
    loss = loss_and_slope(curves, rest)[0]
    knots = curves.factors >= lowest_factor
    way = rest[:, None] - curves.factors[knots]
    apart = np.abs(way) > SAME_FACTOR
    secant = (curves.loss[:, knots] - loss[:, None]) / np.where(apart, way, 1.0)
    return np.asarray(np.where(apart, secant, 0.0).max(axis=1))


def tune(
    curves: LossCurves,
    controller: Controller,
    start_factor: float | None = None,
    luminance: Array | None = None,
    demands: MarginRequirements = MarginRequirements(),
) -> TuningResult:
    """Return the gains that keep content nearest to the target, within margins and the rate limit.

    Parameters
    ----------
    curves : LossCurves
        The content.
    controller : Controller
        Target, bounds, rate limit; and the gains that it has now.
    start_factor, luminance : optional
        As in `control_curves`.
    demands : MarginRequirements
        The margins.
    """
    settings, duration = controller.settings, float(np.median(curves.durations))
    slopes = content_slopes(curves, settings.target_loss, settings.lowest_factor)
    slope = max(float(np.quantile(slopes, demands.quantile)), 1e-3)  # content that loses nothing has none
    gain_rate = settings.gain_rate or 1 / duration

    def settings_of(gains: FrameGains) -> ControllerSettings:
        frames = gain_rate * duration
        return replace(
            settings,
            proportional=gains.proportional,
            integral=gains.integral / frames,
            derivative=gains.derivative * frames,
        )

    def error_with(chosen: ControllerSettings) -> float:
        track = control_curves(curves, replace(controller, settings=chosen), start_factor, luminance)
        return rms_error(track)

    search = _Search(demands, slope, lambda gains: error_with(settings_of(gains)))
    found = search.best()
    chosen = settings_of(found.gains)
    return TuningResult(
        settings=chosen,
        slope=slope,
        margins=margins(frame_gains(chosen, duration), slope),
        margins_before=margins(frame_gains(settings, duration), slope),
        error=found.error,
        error_before=error_with(settings),
        tries=search.tries,
    )


def rms_error(track: ControlledTrack) -> float:
    """Return the root mean square over time of what the loss is from the target."""
    return math.sqrt(float(track.time_share @ (track.contrast_loss - track.targets) ** 2))


@dataclass(frozen=True, slots=True)
class _Trial:
    """Gains by their size κ and shares, and the error that they leave."""

    size: float
    shares: Shares
    gains: FrameGains
    error: float


class _Search:
    """Looks for the gains with the least error: over triangles, then about the best with halved steps."""

    def __init__(
        self, demands: MarginRequirements, slope: float, error_of: Callable[[FrameGains], float]
    ) -> None:
        self._demands, self._slope, self._error_of = demands, slope, error_of
        self._tried: list[_Trial] = []

    @property
    def tries(self) -> int:
        """Runs of the controller that it took."""
        return len(self._tried)

    def best(self) -> _Trial:
        """Return the best gains found."""
        largest = 1 / self._demands.gain_margin
        found = _Trial(0.0, (0.0, 0.0, 0.0), FrameGains(0.0, 0.0, 0.0), math.inf)
        for share in SIZES:
            for shares in _triangle(DIVISIONS):
                found = self._better(found, share * largest, shares)
        step, ratio = 0.5 / DIVISIONS, math.sqrt(2)
        for _ in range(REFINEMENTS):
            centre = found
            for size, shares in _around(centre, step, ratio):
                found = self._better(found, min(size, largest), shares)
            if found is centre:
                step, ratio = step / 2, math.sqrt(ratio)
        # Gains that chase every flicker of the content swing between the ends of the rate limit for nothing.
        return min((one for one in self._tried if one.error <= AS_GOOD * found.error), key=lambda f: f.size)

    def _better(self, best: _Trial, size: float, shares: Shares) -> _Trial:
        """Return the better of the best so far and some gains, if these have the phase margin."""
        total = size / self._slope
        gains = FrameGains(shares[0] * total, 2 * shares[1] * total, shares[2] * total / 2)
        left = margins(gains, self._slope).phase_margin
        if left is not None and left < self._demands.phase_margin:
            return best
        now = _Trial(size, shares, gains, self._error_of(gains))
        self._tried.append(now)
        return now if now.error < best.error else best


def _triangle(divisions: int) -> Iterator[Shares]:
    """Yield shares of three terms that add up to 1, in equal steps; none without an integral part.

    Without one no content is brought to its target.

    >>> list(_triangle(2))
    [(0.5, 0.5, 0.0), (0.0, 0.5, 0.5), (0.0, 1.0, 0.0)]
    """
    for integral in range(1, divisions + 1):
        for derivative in range(divisions - integral + 1):
            rest = divisions - integral - derivative
            yield rest / divisions, integral / divisions, derivative / divisions


def _around(centre: _Trial, step: float, ratio: float) -> Iterator[tuple[float, Shares]]:
    """Yield sizes and shares next to some: larger, smaller, and from each term to each other."""
    yield centre.size * ratio, centre.shares
    yield centre.size / ratio, centre.shares
    for giver in range(3):
        for taker in range(3):
            if giver != taker:
                moved = min(step, centre.shares[giver])
                shares = list(centre.shares)
                shares[giver] -= moved
                shares[taker] += moved
                if shares[1] > 0:
                    yield centre.size, (shares[0], shares[1], shares[2])
