"""The online controller as an object: for a render loop of one's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.tracks.control_request import EVERY_PIXEL, LoopRequest
from evenlight.data_schema.arguments import positive
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.keywords import takes_fields_of, with_fields
from evenlight.method.choices import Device
from evenlight.method.contrast.critical_factor import tables_hold
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_and_slope
from evenlight.method.contrast.frame_analysis import FrameAnalyzer
from evenlight.method.contrast.loss_curves import analyze_frames, brightness_factors, make_frame_analysis
from evenlight.method.contrast.one_factor import OneFactorLoss
from evenlight.method.online.controller import (
    Controller,
    ControllerState,
    FrameMeasurement,
    SteeredTarget,
)
from evenlight.method.online.gain import GainMonitor, gain_warning
from evenlight.method.online.governor import (
    ContentCosts,
    FrameCost,
    GovernorState,
    first_factor,
    governor_of,
)
from evenlight.method.online.lookahead import (
    ForeseenFrame,
    LookaheadController,
    PlannedFrame,
)
from evenlight.method.power import power_per_factor
from evenlight.method.rate_limit import scalar_rate_limit
from evenlight.stimuli.video.frames_in_memory import frame_of
from evenlight.stimuli.video.viewing_geometry import ViewingGeometry, viewing_geometry


class OnlineController:
    """Dims frames as they come, knowing nothing of the frames to come (Section 6).

    Each frame is analysed before it is shown; its contrast loss at the brightness of the frame before is what
    a PID controller holds at the target. No step is faster than the rate limit. With a budget, a governor
    moves the target so that the mean over the horizon meets it.

    With `lookahead` another algorithm plans over the player's buffer, even one of 0 s, where only statistics
    of what came tell what comes: `push` takes frames before they are shown and returns the factors of those
    that are due, `finish` the rest.

    Parameters
    ----------
    {fields}

    Attributes
    ----------
    factor : float or None
        b of the frame that was analysed last; None before the first.
    loss : float or None
        Its contrast loss, at the factor of the frame before.
    target_loss : float
        c_r now.
    warnings : tuple of str
        Whether nothing was gained over the last horizon, by an estimate; empty before one has passed.

    Raises
    ------
    InputError
        If neither a target nor a budget is given, a value is out of its range, a preset or file is not there,
        or the rate limit was fitted on another display or is known too badly.

    Examples
    --------
    >>> import numpy as np
    >>> controller = OnlineController(target_loss=0.05, fps=90)
    >>> checks = np.indices((64, 64)).sum(axis=0) // 8 % 2 * 0.2 + 0.4
    >>> frame = np.repeat(checks[:, :, None], 3, axis=2)
    >>> 0.2 <= controller.step(frame) <= 1
    True
    """

    @takes_fields_of(LoopRequest)
    def __init__(self, request: dict[str, Any]) -> None:
        asked = LoopRequest(**request)
        asked.check()
        settings, seconds = asked.settings(asked.min_factor), positive("fps", asked.fps)
        self._display, posed = asked.posed(asked)
        self._model, self._power = asked.model()[0], posed.power_model
        self._field_of_view = asked.field_of_view
        self._geometry: ViewingGeometry | None = None
        reflected = self._display.reflected_luminance
        limit = scalar_rate_limit(posed.limit, reflected, posed.limit_curve)
        self._controller, self._budget = Controller(settings, limit), asked.governor(posed)
        self._target_is_given, self._ahead = asked.target_loss is not None, asked.known_ahead
        self._start, self._duration = asked.start_factor, 1 / seconds
        self._state: ControllerState | None = None
        self._measure: OneFactorLoss | None = None
        self._looks_at, self._turn = asked.strips_and_halvings, 0
        if self._looks_at != EVERY_PIXEL and not tables_hold(self._display, self._model):
            raise ArgumentError("resolution", "needs a model of sensitivity at each pixel's own luminance")
        self._costs = None if self._budget is None else ContentCosts(self._budget, self._power)
        self._cost: FrameCost | None = None
        self._governed: GovernorState | None = None
        self._monitor = GainMonitor(asked.seconds)
        self._planner: LookaheadController | None = None
        self._analysis: FrameAnalyzer | None = None
        self.factor: float | None = None
        self.loss: float | None = None
        self.target_loss = settings.target_loss

    def __repr__(self) -> str:
        now = "before the first frame" if self.factor is None else f"factor {self.factor:.3f}"
        aim = f"target loss {self.target_loss:.3g}"
        if self._budget is not None:
            aim = f"budget {self._budget.budget:.3g} ({self._budget.budget_unit.value})"
        return f"<OnlineController: {aim}, {now}>"

    def step(self, frame: Frame | NDArray[Any], duration: float | None = None) -> float:
        """Return the brightness factor b that a frame is to be shown with.

        Parameters
        ----------
        frame : array, (height, width, 3), uint8, uint16, float32 or float64, or Frame
            The undimmed frame: gamma-encoded R, G, B over the integer's full range, or in [0, 1].
        duration : float, optional
            How long it will be shown [s]; else 1 / `fps`, or that of the `Frame`.

        Returns
        -------
        float
            b, in [`min_factor`, 1]. Dim in linear light: D = b · I.
        """
        if self._ahead is not None:
            raise InputError(
                "with lookahead, push frames and take the factors that are due, in place of step"
            )
        frame, seconds = self._received(frame, duration)
        if self._state is None or self._measure is None:
            self._state, means = self._begun(frame, seconds)
        else:
            seen, self._turn = self._measure.of(frame.pixels, self._state.factor, self._turn), self._turn + 1
            means = seen.channel_means
            aim = self._aim(self._state, seen.loss)
            told = FrameMeasurement(seen.loss, seen.mean_luminance, seconds)
            self._monitor.take(self._state.factor, seen.loss, self._state.duration)
            self._state, self.loss = self._controller.step(self._state, told, aim), seen.loss
        self.factor = self._state.factor
        if self._costs is not None:
            self._cost = self._cost_of(means, seconds)
        return self.factor

    def push(self, frame: Frame | NDArray[Any], duration: float | None = None) -> list[float]:
        """Put a frame into the buffer, and return the factors of those that are due, in their order.

        A frame is due when `lookahead` seconds from its beginning on are known: none at first, later one.

        Parameters
        ----------
        frame, duration : array or Frame, float, optional
            As of `step`.

        >>> controller = OnlineController(target_loss=0.05, fps=2, lookahead=1.0)
        >>> frame = np.full((16, 16, 3), 0.5)
        >>> [len(controller.push(frame)) for _ in range(4)], len(controller.finish())
        ([0, 0, 1, 1], 2)
        """
        if self._ahead is None:
            raise InputError(
                "frames are pushed with lookahead, the seconds to be known; without it, use step"
            )
        frame, seconds = self._received(frame, duration)
        if self._planner is None or self._analysis is None:
            curves, shape, knots = self._first_curves(frame), frame.shape, self._knots
            start = self._first_factor(curves, lambda b: float(loss_and_slope(curves, np.array([b]))[0][0]))
            self._planner = LookaheadController(
                self._controller, self._ahead, knots, start, self._target_is_given
            )
            made = make_frame_analysis(shape, self._display, self._model, knots, Device.CPU)
            self._analysis = made.analysis
        seen = self._analysis.of(frame.pixels)
        cost = None if self._costs is None else self._cost_of(seen.channel_means, seconds)
        foreseen = ForeseenFrame(seen.loss, seen.mean_luminance, seconds, cost)
        return self._handed_out(self._planner.push(foreseen))

    def finish(self) -> list[float]:
        """Return the factors of the frames that are left in the buffer: no more will come."""
        return [] if self._planner is None else self._handed_out(self._planner.finish())

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is to be said of the last horizon."""
        warning = gain_warning(self._monitor.ratio)
        return () if warning is None else (warning,)

    def _handed_out(self, planned: list[PlannedFrame]) -> list[float]:
        """Return the factors of planned frames, and note what became of them."""
        for one in planned:
            self.factor, self.loss, self.target_loss = one.state.factor, one.loss, one.target_loss
            self._monitor.take(one.state.factor, one.loss, one.state.duration)
        return [one.state.factor for one in planned]

    def _received(self, frame: Frame | NDArray[Any], duration: float | None) -> tuple[Frame, float]:
        """Return a frame as it is shown, and how long."""
        seconds = frame.duration if isinstance(frame, Frame) else self._duration
        seconds = seconds if duration is None else positive("duration", duration)
        return self._shown(frame_of(frame)), seconds

    def _cost_of(self, channel_means: Array, seconds: float) -> FrameCost:
        assert self._costs is not None
        return self._costs.of(float(power_per_factor(self._power, channel_means[None])[0]), seconds)

    def _shown(self, frame: Frame) -> Frame:
        """Return a frame as the display can show it in the field of view."""
        height, width = frame.shape
        if self._geometry is None:
            size, degrees = (width, height), self._field_of_view
            self._geometry = viewing_geometry(size, self._display, degrees, "the frame")
            self._display = self._geometry.display
        if (width, height) != self._geometry.size:
            first = self._geometry.size[::-1]
            raise InputError(f"expected a frame of the shape {first}, got {(height, width)}")
        return next(iter(self._geometry.shown([frame])))

    @property
    def _knots(self) -> Array:
        return brightness_factors(self._controller.settings.lowest_factor)

    def _first_curves(self, frame: Frame) -> LossCurves:
        return analyze_frames([frame], "the first frame", self._display, self._model, self._knots)

    def _first_factor(self, curves: LossCurves, loss_at: Callable[[float], float]) -> float:
        """Return the factor of the first frame, and set the first target, as later losses are measured."""
        settings, start = self._controller.settings, self._start
        lowest, highest = settings.lowest_factor, settings.highest_factor
        if not self._target_is_given and self._budget is not None:
            slope = float(power_per_factor(self._power, curves.channel_means)[0])
            fair = first_factor(self._budget, self._power, slope, (lowest, highest))
            start = fair if start is None else start
            self.target_loss = loss_at(fair)
            settings = replace(settings, target_loss=self.target_loss)
            self._controller = replace(self._controller, settings=settings)
        if start is None:
            start = float(factor_at_loss(curves, np.array([settings.target_loss]))[0])
        return min(max(start, lowest), highest)

    def _begun(self, frame: Frame, seconds: float) -> tuple[ControllerState, Array]:
        """Return the state and channel means at the first frame; set the first target if none is given."""
        lowest = self._controller.settings.lowest_factor
        measure = OneFactorLoss(frame.shape, self._display, self._model, lowest, *self._looks_at)
        start = self._first_factor(self._first_curves(frame), lambda b: measure.of(frame.pixels, b).loss)
        seen, self._measure = measure.of(frame.pixels, start), measure
        self.loss, told = seen.loss, FrameMeasurement(seen.loss, seen.mean_luminance, seconds)
        return self._controller.start(start, told), seen.channel_means

    def _aim(self, shown: ControllerState, loss: float) -> SteeredTarget | None:
        """Return where the governor moves the target to after a frame was shown; None without a budget."""
        if self._budget is None or self._cost is None:
            return None
        governor = governor_of(self._controller, self._budget)
        if self._governed is None:
            self._governed = governor.start(self.target_loss, shown.factor, loss)
        self._governed, aim = governor.step(self._governed, shown, loss, self._cost.excess(shown.factor))
        self.target_loss = aim.target_loss
        return aim


OnlineController.__doc__ = with_fields(OnlineController.__doc__, LoopRequest)
