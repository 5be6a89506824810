"""How far the controller's loop is from ringing: gain and phase margin, peak of the sensitivity.

The loop, frame by frame (docs/decisions/controller-tuning.md). A frame's loss is measured at the factor of
the frame before, which for small changes is y_k = -s · b_{k-1} + content, with s = |d𝓛_c/db| the slope of its
loss curve. The controller answers b = C(z) · (y - target), with

    C(z) = K_p + K_i z / (z - 1) + K_d (z - 1) / z        (gains per frame),

so the open loop is L(z) = s · z^-d · C(z) with a delay of d = 1 frame.

Two facts make the margins plain. For d = 1 the real part of z^-1 C on the unit circle is a concave parabola
in cos ω, lowest at ω = π, where it is -(K_p + K_i / 2 + 2 K_d). So the gain margin has a closed form; and by
the circle criterion the loop is stable not only at any fixed slope below 1 / (K_p + K_i / 2 + 2 K_d) but also
while the slope changes between frames in any way below it, as it does where content changes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from evenlight.data_schema.arrays import Array
from evenlight.method.online.controller import ControllerSettings

FREQUENCIES = 4096  # at which the loop is looked at before a crossing or a peak is refined

Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class FrameGains:
    """Gains of the controller per frame.

    Attributes
    ----------
    proportional, integral, derivative : float
        K_p; K_i times the frame's duration; K_d over it: what `Controller.step` multiplies the error, its sum
        over frames, and its change from frame to frame by.
    delay : int
        Frames from a factor being shown to the answer to its loss; 1 as `Controller` is meant to be used.
    """

    proportional: float
    integral: float
    derivative: float
    delay: int = 1


@dataclass(frozen=True, slots=True)
class Margins:
    """How far a loop is from ringing, at a slope of the loss.

    Attributes
    ----------
    stable_slope : float
        Stable whatever content does while its slope stays below; inf for gains of 0.
    gain_margin : float
        How many times as steep the loss might be: `stable_slope` over the slope.
    phase_margin : float or None
        Phase that might be lost where the loop has a gain of 1 [degrees]; None if it has nowhere.
    sensitivity_peak : float
        Largest amplification of any wave in the content's loss; inf for a loop that is not stable.
    """

    stable_slope: float
    gain_margin: float
    phase_margin: float | None
    sensitivity_peak: float

    @property
    def gain_margin_db(self) -> float:
        """Gain margin [dB]."""
        return 20 * math.log10(self.gain_margin) if self.gain_margin > 0 else -math.inf


def frame_gains(settings: ControllerSettings, duration: float, delay: int = 1) -> FrameGains:
    """Return what a controller's gains are per frame of some duration [s].

    >>> frame_gains(ControllerSettings(0.1, 0.2, 0.01, 0.05, gain_rate=50.0), duration=0.04)
    FrameGains(proportional=0.2, integral=0.02, derivative=0.025, delay=1)
    """
    frames = 1.0 if settings.gain_rate is None else settings.gain_rate * duration
    return FrameGains(settings.proportional, settings.integral * frames, settings.derivative / frames, delay)


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
    return np.asarray(slope * control * z**-gains.delay)


def stable_slope(gains: FrameGains) -> float:
    """Return the slope up to which the loop is stable, however the slope changes (circle criterion).

    At a delay of one frame 1 / (K_p + K_i / 2 + 2 K_d), which no fixed slope above it survives either.

    >>> stable_slope(FrameGains(0.25, 0.25, 0.0625))
    2.0
    """
    if gains.delay == 1:
        lowest = -(gains.proportional + gains.integral / 2 + 2 * gains.derivative)
    else:
        lowest = float(open_loop(gains, 1.0, _frequencies()).real.min())
    return -1 / lowest if lowest < 0 else math.inf


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
