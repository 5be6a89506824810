"""What `evenlight play SCENE --walk` is asked for, and what it says afterwards."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from data_schema.brightness_track import BudgetUnit
from data_schema.display import Display
from data_schema.errors import InputError
from data_schema.files import results_folder
from data_schema.live_control import LiveRefresh
from data_schema.rate_limit import RateLimit
from data_schema.rig import Rig
from experiments.live_dimming import LiveDimmer
from experiments.live_governor import LiveBudget, LiveGovernor
from experiments.live_record import LOG, how_met, live_control, settings_of, with_budget, write_live
from experiments.loss_meters import open_meter
from experiments.play_request import rig_of
from experiments.playback import open_devices
from experiments.walk import Walk, Walked, write_path
from hardware.rig import open_held_keys, open_pointer
from hardware.simulated_held_keys import SimulatedHeldKeys
from method.choices import Device, LimitCurve
from method.controller import Controller
from method.governor import GovernorSettings
from method.optimize import Request, require_possible
from method.preset_files import load_power_model, load_rate_limit_for
from method.scalar_rate_limit import scalar_rate_limit
from stimuli.commands import size_in
from stimuli.scenes.scenes import SCENES

DISPLAY, SIZE = "varjo-xr3", (640, 360)  # where nothing else is asked for
RATE_LIMIT = POWER_MODEL = "surace2025"
HORIZON = 60.0  # [s]


def budget_asked(
    budget: float | None, unit: BudgetUnit | None, horizon: float | None, power_model: str | None
) -> LiveBudget | None:
    """Return what `--budget`, `--budget-unit`, `--horizon` and `--power-model` ask for.

    Raises
    ------
    InputError
        If the budget or its horizon cannot be.
    """
    if budget is None:
        return None
    unit, seconds = unit or BudgetUnit.FACTOR, HORIZON if horizon is None else horizon
    if not 0 < budget < float("inf"):
        raise InputError(f"--budget must be above 0, got {budget:g}")
    if not 0.1 <= seconds <= 1e6:
        raise InputError(f"--horizon must lie in 0.1 to 1e+06, got {seconds:g}")
    if unit is BudgetUnit.FACTOR and power_model is not None:
        raise InputError("--power-model is for a budget in power or watt: give --budget-unit with it")
    return LiveBudget(GovernorSettings(budget, unit, seconds), load_power_model(power_model or POWER_MODEL))


@dataclass(frozen=True, slots=True)
class LiveRequest:
    """The controller that a walk is dimmed by.

    Attributes
    ----------
    target_loss : float or None
        Contrast loss to hold, with a budget to begin with; None for no controller, or by the budget.
    rate_limit : str
        A preset or a file.
    limit_curve : LimitCurve
        The fitted curve, or the lower edge of its band.
    tuning : Path or None
        A `tuning.json` whose gains are taken; None for the paper's.
    device : Device
        What measures the loss.
    out : Path or None
        Folder for the log.
    other_display_ok : bool
        Whether the rate limit may be of another display.
    budget : LiveBudget or None
        What the target is to follow.
    """

    target_loss: float | None = None
    rate_limit: str = RATE_LIMIT
    limit_curve: LimitCurve = LimitCurve.FITTED
    tuning: Path | None = None
    device: Device = Device.AUTO
    out: Path | None = None
    other_display_ok: bool = False
    budget: LiveBudget | None = None

    def __post_init__(self) -> None:
        if not self.dims and self.out is not None:
            raise InputError("--out keeps what a controller did: give --target-loss or --budget with it")
        if self.target_loss is not None and not 0 <= self.target_loss <= 1:
            raise InputError(f"--target-loss must lie in 0 to 1, got {self.target_loss:g}")

    @property
    def dims(self) -> bool:
        """Whether there is a controller."""
        return self.target_loss is not None or self.budget is not None

    def limit_on(self, display: Display) -> RateLimit:
        """Return the rate limit, if it may be used on some display."""
        return load_rate_limit_for(display, self.rate_limit, self.other_display_ok)

    def controller(self, display: Display) -> Controller:
        """Return the controller, on some display."""
        limit = scalar_rate_limit(self.limit_on(display), display.reflected_luminance, self.limit_curve)
        return Controller(settings_of(self.target_loss or 0.0, self.tuning), limit)

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
    """What is asked for.

    Attributes
    ----------
    scene : str
        Name of the scene.
    rig, display, size : str or None
        As on the command line.
    factor : float or None
        Brightness factor b, to begin with where it is controlled; None: 1, or where a budget has it.
    record : Path or None
        File for the way.
    seconds : float or None
        When to end [s].
    screenshots : Path or None
        Folder for a picture of the screen.
    simulate : bool
        Whether nobody sits at the keys, and somebody simulated walks straight ahead.
    live : LiveRequest
        What dims it, if the factor is not to stay.
    """

    scene: str
    rig: str | None
    display: str | None
    size: str | None
    factor: float | None
    record: Path | None
    seconds: float | None
    screenshots: Path | None
    simulate: bool
    live: LiveRequest = field(default_factory=LiveRequest)

    def __post_init__(self) -> None:
        if self.scene not in SCENES:
            raise InputError(f"no scene {self.scene!r} to walk in: there are {', '.join(SCENES)}")
        if self.factor is not None and not 0 < self.factor <= 1:
            raise InputError(f"--factor must be above 0 and at most 1, got {self.factor:g}")
        if self.seconds is not None and not self.seconds > 0:
            raise InputError(f"--seconds must be above 0, got {self.seconds:g}")
        if self.simulate and self.seconds is None:
            raise InputError("--walk ends with escape, which nobody presses with --simulate: give --seconds")
        if self.record is not None and self.record.suffix != ".json":
            raise InputError(f"--record {self.record}: give a file that ends in .json")
        if self.record is not None and not self.record.absolute().parent.is_dir():
            raise InputError(
                f"--record {self.record}: there is no folder {self.record.parent}; make it first"
            )
        if self.rig is not None and self.size is not None:
            raise InputError("--size is of a window without a rig; the rig has a size of its own")


def walk_as_asked(asked: WalkRequest) -> str:
    """Let somebody walk, and return how it went in one line."""
    rig, display = rig_of(asked.rig, asked.display, DISPLAY, size_in(asked.size) or SIZE)
    dimming = _Dimming.asked_for(asked.live, display)
    if asked.live.out is None:
        return _walked(asked, rig, display, dimming)[0]
    with results_folder(asked.live.out) as folder:
        said, rows, measured_by = _walked(asked, rig, display, dimming)
        assert dimming is not None  # `LiveRequest` has seen to it
        limit = asked.live.limit_on(display), asked.live.limit_curve
        seen = asked.scene, display, measured_by
        record = live_control(dimming.controller.settings, limit, seen, rows, asked.simulate)
        if asked.live.budget is not None:
            record = with_budget(record, asked.live.budget, rows)
        write_live(folder, record, rows)
    return f"{said}; the log is in {asked.live.out / LOG}"


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


def _walked(
    asked: WalkRequest, rig: Rig, display: Display, dimming: _Dimming | None
) -> tuple[str, list[LiveRefresh], str]:
    """Let somebody walk, and return how it went, what the controller did, and what measured the loss."""
    measured_by = ""
    with ExitStack() as stack:
        opened = open_devices(rig, display, simulated=asked.simulate, any_rate=asked.rig is None)
        devices = stack.enter_context(opened)
        walk = Walk(devices, asked.scene, asked.factor or 1.0, asked.screenshots)
        window = devices.window
        if dimming is not None:
            lowest, governor = dimming.controller.settings.lowest_factor, dimming.governor
            meter = open_meter(
                window.context(), walk.pictures, display,
                lowest_factor=lowest, device=asked.live.device, patient=asked.simulate,
            )  # fmt: skip
            stack.callback(meter.close)
            measured_by = meter.name
            first = None if asked.factor is None else max(asked.factor, lowest)
            refresh = 1 / devices.rig.refresh_rate
            walk.dimmer = LiveDimmer(dimming.controller, meter, first, refresh, governor)
        straight_on = SimulatedHeldKeys(window.now, [("w", 0.0, float("inf"))])
        held = straight_on if asked.simulate else open_held_keys(window)
        if held is None:
            raise InputError("this window does not tell which keys are held down, and nobody can walk in it")
        stack.callback(held.close)
        pointer = None if asked.simulate else open_pointer(window)
        if pointer is not None:
            stack.callback(pointer.close)
        done = walk.walk(held, pointer, asked.seconds)
    rows = [] if walk.dimmer is None else walk.dimmer.rows
    said = _said(asked, done) + _said_of_control(rows) + _said_of_budget(asked.live.budget, rows)
    if asked.record is not None and done.flip_times and done.flip_times[-1] > 0:
        write_path(asked.record, asked.scene, done.way)
        said = f"{said}; the way is in {asked.record}"
    return said, rows, measured_by


def _said(asked: WalkRequest, done: Walked) -> str:
    """Return how a walk went."""
    seconds = done.flip_times[-1] if done.flip_times else 0.0
    return (
        f"{asked.scene}: {len(done.flip_times)} refreshes in {seconds:.1f} s, {done.frames_dropped} dropped"
    )


def _said_of_control(rows: list[LiveRefresh]) -> str:
    """Return what the controller did, in words; nothing without one."""
    known = [row for row in rows if row.contrast_loss is not None]
    if not known:
        return "" if not rows else "; no loss was measured"
    measured = len({row.measured_refresh for row in known})
    loss = sum(row.contrast_loss or 0.0 for row in known) / len(known)
    factor = sum(row.factor for row in rows) / len(rows)
    return f"; contrast loss {loss:.3g} and factor {factor:.3g} on average, {measured} refreshes measured"


def _said_of_budget(budget: LiveBudget | None, rows: list[LiveRefresh]) -> str:
    """Return how a budget was met, in words; nothing without one."""
    met = None if budget is None else how_met(budget, rows)
    if budget is None or met is None:
        return ""
    asked = budget.settings
    words = f"; budget {asked.budget:g} ({asked.budget_unit.value}): {met.achieved:.3g} on average"
    if met.errors is None:
        return f"{words}, shorter than the horizon of {asked.horizon:g} s"
    off, above = met.errors
    return f"{words}, over any {asked.horizon:g} s off by {off:.2g} at most, above it by {above:.2g}"
