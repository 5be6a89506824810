"""How far the controller's loop is from ringing, and its gains chosen for given content within such margins.

The loop, frame by frame (docs/decisions/online-controller.md). A frame's loss is measured at the factor of
the frame before, which for small changes is y_k = -s · b_{k-1} + content, with s = |d𝓛_c/db| the slope of its
loss curve. The controller answers b = C(z) · (y - target), with

    C(z) = K_p + K_i z / (z - 1) + K_d (z - 1) / z        (gains per frame),

so the open loop is L(z) = s · z^-1 · C(z): a frame's delay. The real part of z^-1 C on the
unit circle is a concave parabola in cos ω, lowest at ω = π, where it is -(K_p + K_i / 2 + 2 K_d). So the gain
margin has a closed form, 1 / κ with κ = s · (K_p + K_i / 2 + 2 K_d); and by the circle criterion the loop is
stable not only at any fixed slope with κ below 1, but also while the slope changes between frames in any way
below it, as it does where content changes.

Gains are sought on triangles: κ at most what the gain margin allows, shared out between the three terms. Of
those with enough phase margin, the ones win under which the loss of the content, run through the controller
with its rate limit, stays nearest to the target; and of those that are as good but for a few percent, the
gentlest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.quantities import check_limits, quantity
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_and_slope
from evenlight.method.online.control_curves import ControlledTrack, control_curves
from evenlight.method.online.controller import Controller, ControllerSettings

DIVISIONS = 6  # of each side of the first triangle of shares
SIZES = (1.0, 0.5, 0.25, 0.1, 0.03, 0.01)  # κ as shares of the largest that is allowed
REFINEMENTS = 5  # times that the steps of the search are halved about the best gains
AS_GOOD = 1.02  # of the least error: gains that leave no more are as good
SAME_FACTOR = 1e-6  # two factors nearer to each other tell no slope
Shares = tuple[float, float, float]
FREQUENCIES = 4096  # at which the loop is looked at before a crossing or a peak is refined
Complex = NDArray[np.complex128]


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
    """Gains that suit some content."""

    # with the gains that were found; its `gain_rate` is that of the settings it began with
    settings: ControllerSettings
    slope: float  # s, at which the margins are
    # of the gains found, and of those it began with
    margins: Margins
    margins_before: Margins
    tries: int  # runs of the controller over the content


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
    curves: LossCurves, controller: Controller, demands: MarginRequirements = MarginRequirements()
) -> TuningResult:
    """Return the gains that keep content nearest to the target, within margins and the rate limit.

    The rate limit is that at each frame's mean luminance; the first frame has the target loss.

    Parameters
    ----------
    curves : LossCurves
        The content.
    controller : Controller
        Target, bounds, rate limit; and the gains that it has now.
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

    def error_with(gains: FrameGains) -> float:
        return rms_error(control_curves(curves, replace(controller, settings=settings_of(gains))))

    search = _Search(demands, slope, error_with)
    chosen = settings_of(search.best().gains)
    return TuningResult(
        settings=chosen,
        slope=slope,
        margins=margins(frame_gains(chosen, duration), slope),
        margins_before=margins(frame_gains(settings, duration), slope),
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


@dataclass(frozen=True, slots=True)
class FrameGains:
    """Gains of the controller per frame."""

    # K_p; K_i times the frame's duration; K_d over it: what `Controller.step` multiplies the error, its sum
    # over frames, and its change from frame to frame by
    proportional: float
    integral: float
    derivative: float


@dataclass(frozen=True, slots=True)
class Margins:
    """How far a loop is from ringing, at a slope of the loss."""

    stable_slope: float  # stable whatever content does while its slope stays below; inf for gains of 0
    gain_margin: float  # how many times as steep the loss might be: `stable_slope` over the slope
    # phase that might be lost where the loop has a gain of 1 [degrees]; None if it has nowhere
    phase_margin: float | None
    # largest amplification of any wave in the content's loss; inf for a loop that is not stable
    sensitivity_peak: float

    @property
    def gain_margin_db(self) -> float:
        """Gain margin [dB]."""
        return 20 * math.log10(self.gain_margin) if self.gain_margin > 0 else -math.inf


def frame_gains(settings: ControllerSettings, duration: float) -> FrameGains:
    """Return what a controller's gains are per frame of some duration [s].

    >>> frame_gains(ControllerSettings(0.1, 0.2, 0.01, 0.05, gain_rate=50.0), duration=0.04)
    FrameGains(proportional=0.2, integral=0.02, derivative=0.025)
    """
    frames = 1.0 if settings.gain_rate is None else settings.gain_rate * duration
    return FrameGains(settings.proportional, settings.integral * frames, settings.derivative / frames)


def open_loop(gains: FrameGains, slope: float, frequency: Array) -> Complex:
    """Return L(e^jω) at some frequencies.

    Parameters
    ----------
    gains : FrameGains
        Of the controller.
    slope : float
        s = |d𝓛_c/db|.
    frequency : array
        ω, in (0, π] [radians per frame].
    """
    z = np.exp(1j * frequency)
    control = gains.proportional + gains.integral * z / (z - 1) + gains.derivative * (z - 1) / z
    return np.asarray(slope * control / z)


def stable_slope(gains: FrameGains) -> float:
    """Return the slope up to which the loop is stable, however the slope changes (circle criterion).

    It is 1 / (K_p + K_i / 2 + 2 K_d), which no fixed slope above it survives either.

    >>> stable_slope(FrameGains(0.25, 0.25, 0.0625))
    2.0
    """
    total = gains.proportional + gains.integral / 2 + 2 * gains.derivative
    return 1 / total if total > 0 else math.inf


def margins(gains: FrameGains, slope: float) -> Margins:
    """Return the margins of the loop at a slope s = |d𝓛_c/db| above 0."""
    steepest = stable_slope(gains)
    if steepest <= slope:
        return Margins(steepest, steepest / slope, _phase_margin(gains, slope), math.inf)
    return Margins(steepest, steepest / slope, _phase_margin(gains, slope), _sensitivity_peak(gains, slope))


def _frequencies(lowest: float = 1e-4) -> Array:
    """Return frequencies in equal ratios up to π, and in equal steps."""
    return np.union1d(np.geomspace(lowest, math.pi, FREQUENCIES), np.linspace(0, math.pi, FREQUENCIES)[1:])


def _phase_margin(gains: FrameGains, slope: float) -> float | None:
    """Return the least phase that is left before -180 degrees, where the loop has a gain of 1 [degrees]."""

    def log_gain(frequency: float) -> float:
        return math.log(max(abs(open_loop(gains, slope, np.array(frequency)).item()), 1e-300))

    # Below this the integral part alone is above 1, so that no crossing lies lower.
    grid = _frequencies(min(1e-4, 0.5 * slope * gains.integral) or 1e-4)
    above = np.abs(open_loop(gains, slope, grid)) > 1
    left: list[float] = []
    for k in np.flatnonzero(above[1:] != above[:-1]):
        crossing = float(brentq(log_gain, grid[k], grid[k + 1], xtol=1e-14))
        phase = float(np.angle(open_loop(gains, slope, np.array(crossing)), deg=True))
        left.append((phase + 180) % 360 if phase < 0 else phase - 180)
    return min(left) if left else None


def _sensitivity_peak(gains: FrameGains, slope: float) -> float:
    """Return the largest |1 / (1 + L)| of a stable loop."""

    def closeness(frequency: Array | float) -> Array:
        return np.abs(1 + open_loop(gains, slope, np.asarray(frequency)))

    grid = _frequencies()
    nearest = int(np.argmin(closeness(grid)))
    low, high = grid[max(nearest - 1, 0)], grid[min(nearest + 1, len(grid) - 1)]
    refined = minimize_scalar(lambda w: float(closeness(w)), bounds=(low, high), method="bounded")
    return 1 / min(float(refined.fun), float(closeness(grid).min()))
