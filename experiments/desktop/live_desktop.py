"""Dims a desktop as `evenlight live` is asked to."""

from __future__ import annotations

import contextlib
import itertools
import signal
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

import numpy as np
import typer

from evenlight.data_schema.arguments import number
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.experiments.desktop.film_tracks import FilmTracks
from evenlight.experiments.desktop.live_command import LiveOptions
from evenlight.experiments.desktop.live_loop import LiveLoop, Monitor
from evenlight.experiments.desktop.live_state import earlier, only_one, write_state
from evenlight.experiments.desktop.loss_target import LossTarget, factor_due
from evenlight.experiments.desktop.monitor_dimmer import MonitorDimmer
from evenlight.experiments.desktop.power_gauge import mean_power
from evenlight.experiments.desktop.resting import others_at_work, reasons
from evenlight.experiments.desktop.screens import WatchedScreen, opened_screens
from evenlight.experiments.desktop.user_service import installed
from evenlight.experiments.follow.follow_film import jumps
from evenlight.experiments.follow.watchdog import kept_backlight, require_backlight
from evenlight.hardware.installed_drivers import InstrumentKind, find_driver
from evenlight.hardware.protocols import InstrumentError
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
from evenlight.method.rate_limit import ScalarRateLimit, scalar_rate_limit

LOWEST = 0.05  # of the knots of the loss
TARGET_LOSS = 0.03  # where nothing else is asked for
OWN = ("eDP", "LVDS", "DSI")  # connectors of a computer's own panel, whose backlight Linux has under sysfs


def live_as_asked(options: LiveOptions) -> None:
    """Dim until something ends it, or install what does; `InputError` where it cannot."""
    if not options.backlight:
        raise InputError("live needs --backlight (`evenlight measure list` shows those of this computer)")
    if not options.install:
        _dim(options, options.backlight)
        return
    _checked(options)
    for name in options.backlight:
        require_backlight(name, options.backlight_curve)
    if installed([word for word in sys.argv[sys.argv.index("live") + 1 :] if word != "--install"]):
        typer.echo("evenlight live --status says what it does; --uninstall undoes this")


def _checked(options: LiveOptions) -> tuple[Display, ScalarRateLimit, PowerModel | None]:
    """Return the display, its limit and its power model; refuse options that do not go together."""
    if options.target_loss is not None and options.budget is not None:
        raise InputError("give --target-loss or --budget, not both: a budget moves the loss")
    if options.backlight_curve and len(options.backlight or ()) > 1:
        raise InputError("--backlight-curve is that of one backlight: give one --backlight, or no curve")
    number("target_loss", TARGET_LOSS if options.target_loss is None else options.target_loss, 0.0, 1.0)
    number("min_factor", options.min_factor, 0.01, 1.0)
    number("budget", 1.0 if options.budget is None else options.budget, 0.01, 1.0)
    if options.power_meter:
        find_driver(options.power_meter, InstrumentKind.POWER)
    limit = load_rate_limit(options.rate_limit)
    display = display_for(limit, options.display)
    limit = usable_limit(limit, display, options.other_display_ok, options.accept_wide_band, options.noticed)
    model = power_model_for(display)
    least = 1.0 if options.budget is None else factor_due(options.budget, model, 1.0)
    if least < options.min_factor:
        raise InputError(
            f"--budget {options.budget:g} asks for the factor {least:.2f} on average, and the lowest is "
            f"{options.min_factor:g}: give more, or a lower --min-factor"
        )
    fastest = scalar_rate_limit(limit, display.reflected_luminance, LimitCurve(options.limit_curve))
    return display, fastest, model


def _dim(options: LiveOptions, backlights: list[str]) -> None:
    display, fastest, model = _checked(options)
    tell: Callable[[str], None] = (lambda _: None) if options.quiet else typer.echo
    with ExitStack() as stack:
        stack.callback(only_one().release)
        today, left = earlier()
        grabber = stack.enter_context(opened_screens())
        films, monitors = FilmTracks(options, tell), []
        for name, output in outputs_of(backlights, grabber.names()):
            knots = brightness_factors(LOWEST)
            screen = WatchedScreen(grabber, output, display, load_contrast_model("default"), knots)
            screen.look(time.monotonic())
            device, watchdog = kept_backlight(name, options.backlight_curve)
            loss = TARGET_LOSS if options.target_loss is None else options.target_loss
            white = display.peak_luminance
            dimmer = MonitorDimmer(device, time.monotonic, fastest, white, knots, loss, options.min_factor)
            dimmer.ceiling = max(dimmer.ceiling, left.get(name, 0.0))
            watchdog.bring_back(dimmer.ceiling)
            note = jumps(device, options.min_factor * dimmer.ceiling)
            tell(f"{name}: monitor {output}, {screen.size[0]}x{screen.size[1]}{note}")
            film = partial(films.frame, output, len(grabber.names()) == 1)
            one = Monitor(name, screen, dimmer, watchdog.bring_back, film)
            if options.budget is not None:
                due = partial(factor_due, options.budget, model)
                one.target = LossTarget(dimmer, due, options.min_factor)
            monitors.append(one)
        lcd = model is not None and model.kind is PanelKind.LCD
        watts = float(power_per_factor(model, np.ones((1, 3)))[0]) if lcd else None
        rest_with = [name.strip() for name in options.rest_with.split(",") if name.strip()]
        resting = reasons(rest_with, options.on_battery)
        measured = mean_power(options.power_meter) if options.power_meter else itertools.repeat(None)
        loop = LiveLoop(
            monitors, time.monotonic, time.sleep, resting, tell, write_state, watts, measured, today
        )
        signal.signal(signal.SIGUSR1, lambda *_: setattr(loop, "paused", not loop.paused))
        if words := others_at_work():
            tell(words)
        try:
            while True:
                loop.run_once()
        finally:
            for one in monitors:  # as its watchdog does, which somebody may have ended
                with contextlib.suppress(InstrumentError):
                    one.dimmer.backlight.set_factor(one.dimmer.ceiling)
            state = loop.state()
            write_state(replace(state, monitors=()))
            tell(state.in_words())


def outputs_of(backlights: list[str], outputs: list[str]) -> list[tuple[str, str]]:
    """Return backlights with their monitors: sysfs's with the computer's own panel, and all in their order.

    >>> outputs_of(["sysfs:intel_backlight", "ddc:5"], ["DP-1", "eDP-1"])
    [('sysfs:intel_backlight', 'eDP-1'), ('ddc:5', 'DP-1')]
    """
    if len(backlights) > len(outputs):
        raise InputError(f"there are {len(backlights)} backlights, and monitors: {len(outputs)}")
    left, found = [*outputs], []
    for name in backlights:
        found.append((name, min(left, key=lambda one: one.startswith(OWN) != name.startswith("sysfs:"))))
        left.remove(found[-1][1])
    return found
