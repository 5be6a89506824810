"""What `evenlight walk SCENE` is asked for, and what comes of it: the walk and its log."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.storage.whole_files import results_folder
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.control import LiveRefresh
from evenlight.experiments.playback.headset_dimming import HeadsetDimmer
from evenlight.experiments.playback.headset_walk import HeadsetWalk
from evenlight.experiments.playback.live_dimming import LiveBudget, LiveDimmer, LiveGovernor
from evenlight.experiments.playback.live_record import LOG, live_control, with_budget, write_live
from evenlight.experiments.playback.loss_meters import open_meter
from evenlight.experiments.playback.picture_luminance import LateLuminance
from evenlight.experiments.playback.play_options import (
    LiveOptions,
    WalkOptions,
    interrupted,
)
from evenlight.experiments.playback.play_video import rig_of
from evenlight.experiments.playback.player import (
    Pass,
    PlaybackDevices,
    open_devices,
    require_log_file,
    write_log,
)
from evenlight.experiments.playback.walk import (
    Walk,
    WalkResult,
    walk_summary,
    write_path,
)
from evenlight.hardware.presentation.simulated_input import SimulatedHeldKeys
from evenlight.hardware.rig_windows import open_held_keys, open_pointer
from evenlight.method.choices import Device, LimitCurve
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.online.governor import HORIZON, HORIZONS, GovernorSettings
from evenlight.method.optimizer.request import Request, require_possible
from evenlight.method.preset_files import (
    display_for,
    load_power_model,
    load_rate_limit,
    usable_limit,
)
from evenlight.method.rate_limit import scalar_rate_limit
from evenlight.stimuli.commands import size_in
from evenlight.stimuli.dimming_options import Member
from evenlight.stimuli.scenes.content.catalogue import SCENES
from evenlight.stimuli.sequence_format import FIELD_OF_VIEW, NARROWEST, WIDEST
from evenlight.stimuli.video.viewing_geometry import field_of_view_on

SIZE = 640, 360  # where nothing else is asked for
RATE_LIMIT = POWER_MODEL = "surace2025"


def budget_asked(
    budget: float | None, unit: Member[BudgetUnit] | None, horizon: float | None, power_model: str | None
) -> LiveBudget | None:
    """Return what `--budget`, `--budget-unit`, `--horizon` and `--power-model` ask for.

    Raises
    ------
    InputError
        If the budget or its horizon cannot be.
    """
    if budget is None:
        return None
    unit, seconds = BudgetUnit(unit or BudgetUnit.FACTOR), HORIZON if horizon is None else horizon
    if not 0 < budget < float("inf"):
        raise InputError(f"--budget must be above 0, got {budget:g}")
    if not HORIZONS[0] <= seconds <= HORIZONS[1]:
        raise InputError(f"--horizon must lie in {HORIZONS[0]:g} to {HORIZONS[1]:g}, got {seconds:g}")
    if unit is BudgetUnit.FACTOR and power_model is not None:
        raise InputError("--power-model is for a budget in power or watt: give --budget-unit with it")
    return LiveBudget(GovernorSettings(budget, unit, seconds), load_power_model(power_model or POWER_MODEL))


@dataclass(frozen=True, slots=True)
class LiveRequest:
    """The controller that a walk is dimmed by."""

    # contrast loss to hold, with a budget to begin with; None for no controller, or by the budget
    target_loss: float | None = None
    rate_limit: str = RATE_LIMIT  # a preset or a file
    limit_curve: LimitCurve = LimitCurve.FITTED  # the fitted curve, or the lower edge of its band
    gains: Mapping[str, Any] = field(default_factory=dict)  # of the controller; otherwise the paper's
    device: Device = Device.AUTO  # what measures the loss
    out: Path | None = None  # folder for the log
    other_display_ok: bool = False  # whether the rate limit may be of another display
    budget: LiveBudget | None = None  # what the target is to follow
    accept_wide_band: bool = False  # whether the rate limit may be known too badly

    def __post_init__(self) -> None:
        if not self.dims and self.out is not None:
            raise InputError(
                "--out keeps what a controller did: give --target-loss or --budget with it, or --log FILE "
                "for the frames alone"
            )
        if self.target_loss is not None and not 0 <= self.target_loss <= 1:
            raise InputError(f"--target-loss must lie in 0 to 1, got {self.target_loss:g}")

    @property
    def dims(self) -> bool:
        """Whether there is a controller."""
        return self.target_loss is not None or self.budget is not None

    def display(self) -> Display:
        """Return the display of the rate limit, on which a walk is shown where nothing else is asked for."""
        return display_for(load_rate_limit(self.rate_limit))

    def limit_on(self, display: Display) -> RateLimit:
        """Return the rate limit, if it may be used on some display."""
        limit = load_rate_limit(self.rate_limit)
        return usable_limit(limit, display, self.other_display_ok, self.accept_wide_band)

    def controller(self, display: Display) -> Controller:
        """Return the controller, on some display."""
        limit = scalar_rate_limit(self.limit_on(display), display.reflected_luminance, self.limit_curve)
        return Controller(ControllerSettings(self.target_loss or 0.0, **self.gains), limit)

    def governor(self, display: Display, controller: Controller) -> LiveGovernor | None:
        """Return what moves the target of a controller, if there is a budget, and it can be met."""
        if self.budget is None:
            return None
        asked, model = self.budget.settings, self.budget.model
        request = Request(asked.budget, asked.budget_unit, model, self.limit_on(display), self.limit_curve)
        require_possible(request, controller.settings.lowest_factor)
        return LiveGovernor(self.budget, controller, self.target_loss)


@dataclass(frozen=True, slots=True)
class WalkRequest:
    """What is asked for."""

    scene: str  # name of the scene
    # as on the command line
    rig: str | None
    display: str | None
    size: str | None
    # brightness factor b, to begin with where it is controlled; None: 1, or where a budget has it
    factor: float | None
    record: Path | None  # file for the way
    seconds: float | None  # when to end [s]
    screenshots: Path | None  # folder for a picture of the screen
    simulate: bool  # whether a simulated user walks straight ahead, in place of a person at the keys
    live: LiveRequest = field(default_factory=LiveRequest)  # what dims it, if the factor is not to stay
    log: Path | None = None  # file for what each refresh showed
    field_of_view: float | None = None  # that the window is to span [deg]; None for what is drawn by itself

    def __post_init__(self) -> None:
        if self.scene not in SCENES:
            raise InputError(f"no scene {self.scene!r} to walk in: there are {', '.join(SCENES)}")
        if self.factor is not None and not 0 < self.factor <= 1:
            raise InputError(f"--factor must be above 0 and at most 1, got {self.factor:g}")
        if self.seconds is not None and not self.seconds > 0:
            raise InputError(f"--seconds must be above 0, got {self.seconds:g}")
        if self.simulate and self.seconds is None:
            raise InputError("a walk ends with escape, which no one presses with --simulate: give --seconds")
        if self.record is not None and self.record.suffix != ".json":
            raise InputError(f"--record {self.record}: give a file that ends in .json")
        if self.record is not None and self.record.is_file():
            raise InputError(f"--record {self.record}: is there already; give another name")
        if self.record is not None and not self.record.absolute().parent.is_dir():
            raise InputError(
                f"--record {self.record}: there is no folder {self.record.parent}; make it first"
            )
        if self.log is not None:
            require_log_file(self.log)
        if self.field_of_view is not None and not NARROWEST <= self.field_of_view <= WIDEST:
            raise InputError(
                f"--field-of-view must lie in {NARROWEST:g} to {WIDEST:g} degrees, got {self.field_of_view:g}"
            )
        if self.rig is not None and self.size is not None:
            raise InputError("--size is of a window without a rig; the rig has a size of its own")

    @property
    def drawn_field_of_view(self) -> float | None:
        """The angle that the window is to span [deg]; None at true size, where its pixels' angle is known."""
        if self.field_of_view is None and self.rig is None and self.display is None:
            return FIELD_OF_VIEW
        return self.field_of_view


def asked_walk(walk: WalkOptions, live: LiveOptions) -> WalkRequest:
    """Return what some options ask for.

    Raises
    ------
    InputError
        If an option cannot be.
    """
    controlled = LiveRequest(
        target_loss=live.target_loss,
        rate_limit=str(live.rate_limit),
        limit_curve=LimitCurve(live.limit_curve),
        gains=live.gains,
        device=Device(live.device),
        out=walk.out,
        other_display_ok=walk.other_display_ok,
        budget=budget_asked(live.budget, live.budget_unit, live.horizon, live.power_model),
        accept_wide_band=live.accept_wide_band,
    )
    return WalkRequest(
        scene=walk.scene,
        rig=walk.rig,
        display=walk.display_name,
        size=walk.size,
        factor=walk.factor,
        record=walk.record,
        seconds=walk.seconds,
        screenshots=walk.screenshots,
        simulate=walk.simulate,
        live=controlled,
        log=walk.log,
        field_of_view=walk.field_of_view,
    )


def walk_as_asked(asked: WalkRequest) -> str:
    """Let the user walk, and return a summary in one line.

    Whatever ends the walk, its way and its log are written as far as it went.
    """
    rig, display = rig_of(asked.rig, asked.display, asked.live.display, size_in(asked.size) or SIZE)
    dimming = _Dimming.asked_for(asked.live, display)
    if dimming is not None and asked.factor is not None:
        dimming.require_factor(asked.factor)
    if asked.live.out is None:
        return _ended(asked, *_walked(asked, rig, display, dimming))
    with results_folder(asked.live.out) as folder:
        said, outcome = _walked(asked, rig, display, dimming)
        if outcome.ended_by is not None and not outcome.rows:
            raise outcome.ended_by
        assert dimming is not None  # `LiveRequest` has seen to it
        limit = asked.live.limit_on(display), asked.live.limit_curve
        seen = asked.scene, outcome.display, outcome.measured_by
        record = live_control(dimming.controller.settings, limit, seen, outcome.rows, asked.simulate)
        if asked.live.budget is not None:
            record = with_budget(record, asked.live.budget, outcome.rows)
        write_live(folder, record, outcome.rows)
    return _ended(asked, f"{said}; the log is in {asked.live.out / LOG}", outcome)


def _ended(asked: WalkRequest, said: str, outcome: _Outcome) -> str:
    """Return how a walk went; if something cut it short, say what is kept and end as that has it."""
    error = outcome.ended_by
    if error is None:
        return said
    logged = asked.log is not None and len(outcome.done.flip_times) > 0
    kept = logged or asked.live.out is not None or (asked.record is not None and outcome.done.went)
    if isinstance(error, Exception | SystemExit) or not kept:
        raise error
    raise interrupted(error, said)


@dataclass(frozen=True, slots=True)
class _Outcome:
    """How a walk went, what the controller did, what measured the loss, and what cut it short, if any."""

    done: WalkResult
    display: Display  # at the pixels per degree that were drawn
    rows: list[LiveRefresh]
    measured_by: str
    ended_by: BaseException | None


@dataclass(frozen=True, slots=True)
class _Dimming:
    """What dims a walk."""

    controller: Controller
    governor: LiveGovernor | None

    @classmethod
    def asked_for(cls, live: LiveRequest, display: Display) -> _Dimming | None:
        """Return what is asked for, on some display; None where the factor is to stay."""
        if not live.dims:
            return None
        controller = live.controller(display)
        return cls(controller, live.governor(display, controller))

    def require_factor(self, factor: float) -> None:
        """Refuse a factor to begin with that the controller may not have."""
        low, high = self.controller.settings.lowest_factor, self.controller.settings.highest_factor
        if not low <= factor <= high:
            raise InputError(f"--factor of a dimmed walk must lie in {low:g} to {high:g}, got {factor:.15g}")


def _opened_walk(asked: WalkRequest, devices: PlaybackDevices) -> Walk:
    """Return what shows the scene on some devices."""
    if devices.rig.in_headset:
        return HeadsetWalk(devices, asked.scene, asked.factor or 1.0, asked.screenshots)
    return Walk(devices, asked.scene, asked.factor or 1.0, asked.screenshots, asked.drawn_field_of_view)


def _dim(
    walk: Walk, asked: WalkRequest, devices: PlaybackDevices, dimming: _Dimming, stack: ExitStack
) -> str:
    """Let a walk be dimmed until the end of a stack, and return what measures the loss."""
    context, patient, light = devices.window.context(), asked.simulate, None
    if devices.rig.in_headset:
        light = LateLuminance(context, walk.pictures, walk.display, patient=patient)
    meter = open_meter(
        context, walk.pictures, walk.display, lowest_factor=dimming.controller.settings.lowest_factor,
        device=asked.live.device, patient=patient, light=light,
    )  # fmt: skip
    stack.callback(meter.close)
    given = dimming.controller, meter, asked.factor, 1 / devices.rig.refresh_rate, dimming.governor
    walk.dimmer = (
        LiveDimmer(*given) if light is None else HeadsetDimmer(*given, light=light, display=walk.display)
    )
    return meter.name


def _walked(asked: WalkRequest, rig: Rig, display: Display, dimming: _Dimming | None) -> tuple[str, _Outcome]:
    """Let the user walk, write the way, and return a summary and the outcome."""
    measured_by, ended_by = "", None
    if rig.in_headset and asked.field_of_view is not None:
        raise InputError("--field-of-view is of a window: what a headset spans its runtime says")
    with ExitStack() as stack:
        opened = open_devices(rig, display, simulated=asked.simulate, any_rate=asked.rig is None)
        devices = stack.enter_context(opened)
        walk, window = _opened_walk(asked, devices), devices.window
        if dimming is not None:
            measured_by = _dim(walk, asked, devices, dimming, stack)
        straight_on = SimulatedHeldKeys(window.now, [("w", 0.0, float("inf"))])
        held = straight_on if asked.simulate else open_held_keys(window)
        if held is None:
            raise InputError("this window does not tell which keys are held down, and no one can walk in it")
        stack.callback(held.close)
        pointer = None if asked.simulate else open_pointer(window)
        if pointer is not None:
            stack.callback(pointer.close)
        try:
            walk.walk(held, pointer, asked.seconds)
        except BaseException as error:  # what there is of the walk is kept; then it goes on its way
            ended_by = error
    rows = [] if walk.dimmer is None else walk.dimmer.rows
    outcome = _Outcome(walk.walked, walk.display, rows, measured_by, ended_by)
    budget = asked.live.budget
    said = walk_summary(asked.scene, outcome.done, outcome.rows, budget, timed=not asked.simulate)
    width = field_of_view_on(walk.display, walk.pictures.size[0])
    if rig.in_headset:
        said += "; drawn for both eyes, as wide as the headset sees"
    else:
        said += f"; {width:.3g}° wide" + (", at true size" if asked.drawn_field_of_view is None else "")
    if asked.log is not None and outcome.done.flip_times:
        shown = Pass(walk.recording.result(), ("walk",) * len(outcome.done.flip_times), tuple(walk.heads))
        write_log(asked.log, [shown], devices.rig.refresh_rate, walk.display.pixels_per_degree)
        said = f"{said}; the frames are in {asked.log}"
    if asked.record is not None and outcome.done.went:
        write_path(asked.record, asked.scene, outcome.done.way)
        said = f"{said}; the way is in {asked.record}"
    return said, outcome
