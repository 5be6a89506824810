"""Dims a desktop as `evenlight live` is asked to."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack

import numpy as np
import typer

from evenlight.data_schema.arguments import number
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind
from evenlight.experiments.desktop.live_command import LiveOptions
from evenlight.experiments.desktop.live_loop import LiveLoop, Monitor
from evenlight.experiments.desktop.live_state import LiveState, only_one, running, toggle_pause, write_state
from evenlight.experiments.desktop.monitor_dimmer import MonitorDimmer
from evenlight.experiments.desktop.resting import others_at_work, reasons
from evenlight.experiments.desktop.screens import WatchedScreen, opened_screens
from evenlight.experiments.desktop.user_service import install, uninstall, unit, unit_file
from evenlight.experiments.follow.watchdog import kept_backlight
from evenlight.method.choices import LimitCurve
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.power import power_per_factor
from evenlight.method.preset_files import (
    display_for,
    load_contrast_model,
    load_rate_limit,
    power_model_for,
    usable_limit,
)
from evenlight.method.rate_limit import scalar_rate_limit

CORE = 5.0  # [W] assumed of a busy core of a laptop
LOWEST = 0.05  # of the knots of the loss


def live_as_asked(options: LiveOptions) -> None:
    """Dim until something ends it, or answer what is asked of one that runs.

    Raises
    ------
    InputError
        If an option, display, rate limit, screen and backlight do not go together.
    InstrumentError
        If a backlight fails.
    """
    if sys.platform == "win32":
        raise InputError(
            "evenlight live drives backlights of Linux; on Windows there is no driver for them yet"
        )
    number("target_loss", options.target_loss, 0.0, 1.0)
    number("min_factor", options.min_factor, 0.01, 1.0)
    if options.status:
        typer.echo(running().in_words())
    elif options.pause:
        toggle_pause()
    elif options.uninstall:
        uninstall()
    elif not options.backlight:
        raise InputError("live needs --backlight (`evenlight measure list` shows those of this computer)")
    elif options.install:
        _install()
    else:
        _dim(options)


def _install() -> None:
    text = unit([word for word in sys.argv[sys.argv.index("live") + 1 :] if word != "--install"])
    typer.echo(f"{unit_file()}:\n\n{text}")
    if typer.confirm("Write this file, and start it now and with each session?"):
        install(text)
        typer.echo("evenlight live --status says what it does; --uninstall undoes this")


def _dim(options: LiveOptions) -> None:
    tell: Callable[[str], None] = (lambda _: None) if options.quiet else typer.echo
    backlights = options.backlight or []
    limit = load_rate_limit(options.rate_limit)
    display = display_for(limit, options.display)
    limit = usable_limit(limit, display, options.other_display_ok, options.accept_wide_band, options.noticed)
    fastest = scalar_rate_limit(limit, display.reflected_luminance, LimitCurve(options.limit_curve))
    model, knots = load_contrast_model("default"), brightness_factors(LOWEST)
    power_model = power_model_for(display)
    known = power_model is not None and power_model.kind is PanelKind.LCD
    watts = float(power_per_factor(power_model, np.ones((1, 3)))[0]) if known else None
    with ExitStack() as stack:
        stack.callback(only_one().release)
        grabber = stack.enter_context(opened_screens())
        if len(backlights) > (count := len(grabber.monitors) - 1):
            raise InputError(f"there are {len(backlights)} backlights, and monitors: {count}")
        monitors = []
        for place, name in enumerate(backlights, start=1):
            area = grabber.monitors[place]
            tell(f"{name}: monitor {place}, {area['width']}x{area['height']} at {area['left']},{area['top']}")
            device, watchdog = kept_backlight(name, options.backlight_curve)
            dimmer = MonitorDimmer(device, fastest, knots, options.target_loss, options.min_factor)
            screen = WatchedScreen(grabber, place, display, model, knots)
            monitors.append(Monitor(name, screen, dimmer, watchdog.bring_back))
        rest_with = [name.strip() for name in options.rest_with.split(",") if name.strip()]
        rest = reasons(rest_with, options.on_battery)
        loop = LiveLoop(monitors, time.monotonic, time.sleep, rest, tell, write_state, watts)
        signal.signal(signal.SIGUSR1, lambda *_: setattr(loop, "paused", not loop.paused))
        if words := others_at_work():
            tell(words)
        try:
            while True:
                loop.run_once()
        finally:
            tell(summary(loop.state(time.monotonic())))


def summary(state: LiveState) -> str:
    """Return how it went, and whether its own work was worth it."""
    own = state.work_s * CORE / 3600
    lines = [state.in_words(), f"its own work took about {own:.2g} Wh (assumed: {CORE:g} W for a busy core)"]
    if state.saved_wh is not None and state.saved_wh <= own:
        lines.append("that is no less than it saved: it is not worth it here")
    return "\n".join(lines)
