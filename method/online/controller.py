"""The online controller (Section 6): a PID controller that holds the contrast loss near a target.

It knows nothing of the frames to come. Each frame is analysed before it is shown: its contrast loss at the
brightness of the frame before is the measurement, the brightness that it is shown with is the answer. So the
luminance on both sides of the step is known, and the rate limit can be kept without exception.
See docs/decisions/online-controller.md.
"""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.quantities import check_limits, quantity
from evenlight.method.rate_limit import ROUNDING, ScalarRateLimit, furthest_factor


@dataclass(frozen=True, slots=True)
class ControllerSettings:
    """Target, gains and bounds of a controller.

    Decision (docs/decisions/online-controller.md): the paper's gains count per frame; here they stand for
    frames of 1 / `gain_rate`, and act the same at any frame rate.
    """

    target_loss: float = quantity("1", "c_r, the contrast loss to hold", minimum=0.0, maximum=1.0)
    proportional: float = quantity(
        "1", "K_p, factor per contrast loss", minimum=0.0, default=0.2
    )  # the caption of the diagram
    integral: float = quantity("1", "K_i, factor per contrast loss and frame", minimum=0.0, default=0.01)
    derivative: float = quantity(
        "1", "K_d, factor per change of loss between frames", minimum=0.0, default=0.05
    )
    # 1 makes them gains per second. None: that of the video, so that more frames per second make it quicker.
    gain_rate: float | None = quantity("Hz", "frame rate that K_i and K_d are for", above=0.0, default=90.0)
    lowest_factor: float = quantity("1", "lowest brightness factor", above=0.0, maximum=1.0, default=0.2)
    highest_factor: float = quantity("1", "highest brightness factor", above=0.0, maximum=1.0, default=1.0)

    def __post_init__(self) -> None:
        check_limits(self)
        if not self.lowest_factor < self.highest_factor:
            raise ValueError(
                f"need lowest_factor < highest_factor, got {self.lowest_factor:g} and {self.highest_factor:g}"
            )


@dataclass(frozen=True, slots=True)
class FrameMeasurement:
    """What is measured of a frame before it is shown."""

    # c_y, its contrast loss at the factor of the frame before; of the first frame, at the factor it is to be
    # shown with
    loss: float
    luminance: float  # Ī, the luminance at factor 1 that the rate limit is about [cd/m^2]
    duration: float  # how long it will be shown [s]


@dataclass(frozen=True, slots=True)
class ControllerState:
    """The state of the controller at the frame that is being shown."""

    factor: float  # b that it is shown with
    integral: float  # what the integral term adds to the factor; it holds the starting factor too
    error: float  # c_y - c_r when its factor was chosen
    # of the frame, as in `FrameMeasurement`
    luminance: float
    duration: float
    # whether the rate limit or a bound kept its factor from where the controller wanted it
    limited: bool = False


@dataclass(frozen=True, slots=True)
class SteeredTarget:
    """A target that a governor has moved (`online.governor`)."""

    target_loss: float  # c_r, the contrast loss to hold now, in [0, 1]
    shift: float  # what the move of the target is expected to change the factor by; the integral takes it up


@dataclass(frozen=True, slots=True)
class Controller:
    """A PID controller of the brightness factor, within a rate limit and bounds."""

    settings: ControllerSettings  # target, gains and bounds
    rate_limit: ScalarRateLimit  # ΔL [cd/m^2/s] at a luminance b·Ī [cd/m^2]

    def start(self, factor: float, frame: FrameMeasurement) -> ControllerState:
        """Return the state at the first frame, shown with a given factor; there is no step to limit yet."""
        error = frame.loss - self.settings.target_loss
        integral = factor - self.settings.proportional * error  # so that the terms add up to the factor
        return ControllerState(factor, integral, error, frame.luminance, frame.duration)

    def step(
        self, state: ControllerState, frame: FrameMeasurement, aim: SteeredTarget | None = None
    ) -> ControllerState:
        """Return the state at the next frame: b = K_p e + K_i ∫e + K_d de/dt, as far as the limits let it.

        The integral takes up only as much as can act: while the factor is held back by the rate limit or by a
        bound, errors that push further are not remembered (anti-windup by conditional integration,
        Åström & Hägglund 1995).

        Parameters
        ----------
        state : ControllerState
            At the frame before.
        frame : FrameMeasurement
            The frame.
        aim : SteeredTarget, optional
            Where a governor has moved the target to; without it, the target of the settings.
        """
        settings, passed = self.settings, state.duration
        gain_rate = settings.gain_rate or 1 / passed
        error = frame.loss - (settings.target_loss if aim is None else aim.target_loss)
        slope = (error - state.error) / passed
        terms = settings.proportional * error + settings.derivative / gain_rate * slope + state.integral
        growth = settings.integral * gain_rate * passed * error + (0.0 if aim is None else aim.shift)
        wanted = terms + growth
        low, high = self._reach(state, frame, wanted)
        taken = min(growth, max(high - terms, 0.0)) if growth > 0 else max(growth, min(low - terms, 0.0))
        factor = min(max(wanted, low), high)  # not terms + taken, whose rounding would be a step of its own
        return ControllerState(
            factor,
            state.integral + taken,
            error,
            frame.luminance,
            frame.duration,
            limited=abs(factor - wanted) > ROUNDING,
        )

    def towards(self, state: ControllerState, frame: FrameMeasurement, goal: float) -> float:
        """Return the factor of the next frame that is nearest to a goal, within the limits."""
        low, high = self._reach(state, frame, goal)
        return min(max(goal, low), high)

    def _reach(self, state: ControllerState, frame: FrameMeasurement, wanted: float) -> tuple[float, float]:
        """Return the lowest and highest factor that the next frame may have, exact on the wanted side."""
        low, high = self.settings.lowest_factor, self.settings.highest_factor
        goal = min(max(wanted, low), high)
        luminance = (state.luminance, frame.luminance)
        furthest = furthest_factor(state.factor, goal, luminance, state.duration, self.rate_limit)
        furthest = min(max(furthest, low), high)  # rounding may leave it a hair beyond the goal
        return (low, furthest) if goal > state.factor else (furthest, high)
