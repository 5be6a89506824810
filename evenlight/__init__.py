"""Temporal brightness management: dim a display over time, to a power budget, within a rate limit.

>>> import evenlight
>>> limit = evenlight.load_rate_limit("surace2025")
>>> limit.display_name
'varjo-xr3'

The names below are the public interface; docs/api.md describes them. Each is imported when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from evenlight.analysis.calibration.ramp_fit import RampFit
    from evenlight.analysis.figure_style import figures_as
    from evenlight.analysis.results import Analysis
    from evenlight.data_schema.display import Display
    from evenlight.data_schema.errors import InputError
    from evenlight.data_schema.frame import Frame
    from evenlight.data_schema.power_model import PanelKind, PowerModel
    from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
    from evenlight.data_schema.recordings.instrument_logs import ClockPing, PowerSample
    from evenlight.data_schema.recordings.rig import Actuator
    from evenlight.data_schema.tracks.brightness_track import BudgetUnit
    from evenlight.data_schema.tracks.loss_curves import LossCurves
    from evenlight.hardware.backlights import restore_and_release
    from evenlight.hardware.driver import Driver
    from evenlight.hardware.drivers.serial_link import LineSettings, SerialLink
    from evenlight.hardware.protocols import (
        Backlight,
        ContextDevice,
        Fault,
        InstrumentError,
        LuminanceMeter,
        PowerMeter,
        Reading,
    )
    from evenlight.loss import frame_loss, loss_curves
    from evenlight.method.preset_files import load_display, load_power_model, load_rate_limit
    from evenlight.online import OnlineController
    from evenlight.registered_tasks import TaskDeclaration, register_task
    from evenlight.stimuli.sequences import open_video
    from evenlight.tables import analyze, fit_ramps
    from evenlight.track import Track, load, optimize

    __version__: str

# By module, in the order of docs/api.md: what goes in, a track, online, data, tasks, errors, drivers.
_MODULES = {
    "stimuli.sequences": "open_video",
    "data_schema.frame": "Frame",
    "data_schema.display": "Display",
    "data_schema.power_model": "PowerModel PanelKind",
    "data_schema.rate_limit": "RateLimit RateLimitForm",
    "data_schema.recordings.rig": "Actuator",
    "data_schema.tracks.brightness_track": "BudgetUnit",
    "method.preset_files": "load_display load_power_model load_rate_limit",
    "loss": "frame_loss loss_curves",
    "data_schema.tracks.loss_curves": "LossCurves",
    "track": "optimize Track load",
    "online": "OnlineController",
    "tables": "fit_ramps analyze",
    "analysis.calibration.ramp_fit": "RampFit",
    "analysis.results": "Analysis",
    "analysis.figure_style": "figures_as",
    "registered_tasks": "register_task TaskDeclaration ViewingTaskDeclaration",  # the last: its earlier name
    "data_schema.errors": "InputError",
    "hardware.protocols": "Backlight ContextDevice Fault InstrumentError LuminanceMeter PowerMeter Reading",
    "hardware.driver": "Driver",
    "hardware.backlights": "restore_and_release",
    "data_schema.recordings.instrument_logs": "PowerSample ClockPing",
    "hardware.drivers.serial_link": "SerialLink LineSettings",
}
_PLACES = {name: f"evenlight.{module}" for module, names in _MODULES.items() for name in names.split()}
__all__ = [
    "Actuator", "Analysis", "Backlight", "BudgetUnit", "ClockPing", "ContextDevice", "Display", "Driver",
    "Fault", "Frame", "InputError", "InstrumentError", "LineSettings", "LossCurves",
    "LuminanceMeter", "OnlineController", "PanelKind", "PowerMeter", "PowerModel", "PowerSample", "RampFit",
    "RateLimit", "RateLimitForm", "Reading", "SerialLink", "TaskDeclaration", "Track",
    "analyze", "figures_as", "fit_ramps", "frame_loss", "load", "load_display", "load_power_model",
    "load_rate_limit", "loss_curves", "open_video", "optimize", "register_task", "restore_and_release",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used: `import evenlight` itself loads nothing."""
    if name == "__version__":
        return _version()
    if name in ("samples", "progress"):
        return importlib.import_module(f"evenlight.{name}")
    if name not in _PLACES:
        raise AttributeError(f"module 'evenlight' has no attribute {name!r}")
    found = getattr(importlib.import_module(_PLACES[name]), name)
    globals()[name] = found
    return found


def _version() -> str:
    """Return the version of the package, or that of a checkout that is not installed."""
    from importlib import metadata

    try:
        return metadata.version("evenlight")
    except metadata.PackageNotFoundError:
        import tomllib
        from pathlib import Path

        pyproject = Path(__file__).parents[1] / "pyproject.toml"
        return str(tomllib.loads(pyproject.read_text(encoding="utf-8"))["project"]["version"])


def __dir__() -> list[str]:
    """Return the public names, imported or not."""
    return sorted(__all__)
