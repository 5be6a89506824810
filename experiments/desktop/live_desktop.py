"""Dims a desktop as `evenlight live` is asked to."""

from __future__ import annotations

import contextlib
import signal
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial

import numpy as np
import typer

from evenlight.data_schema.arguments import number
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind
from evenlight.experiments.desktop.film_tracks import FilmTracks
from evenlight.experiments.desktop.live_command import LiveOptions
from evenlight.experiments.desktop.live_loop import LiveLoop, Monitor
from evenlight.experiments.desktop.live_state import (
    DayTotal,
    only_one,
    running,
    toggle_pause,
    write_state,
)
from evenlight.experiments.desktop.loss_target import LossTarget, factor_due
from evenlight.experiments.desktop.monitor_dimmer import MonitorDimmer
from evenlight.experiments.desktop.power_gauge import PowerGauge
from evenlight.experiments.desktop.resting import others_at_work, reasons
from evenlight.experiments.desktop.screens import WatchedScreen, opened_screens
from evenlight.experiments.desktop.user_service import install, uninstall, unit, unit_file
from evenlight.experiments.follow.watchdog import kept_backlight
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


def live_as_asked(options: LiveOptions) -> None:
    """Dim until something ends it, or answer what is asked of one that runs; `InputError` where it cannot."""
    if sys.platform == "win32":
        raise InputError(
            "evenlight live drives backlights of Linux; on Windows there is no driver for them yet"
        )
    if options.target_loss is not None and options.budget is not None:
        raise InputError("give --target-loss or --budget, not both: a budget moves the loss")
    if options.backlight_curve and len(options.backlight or ()) > 1:
        raise InputError("--backlight-curve is that of one backlight: give one --backlight, or no curve")
    number("target_loss", TARGET_LOSS if options.target_loss is None else options.target_loss, 0.0, 1.0)
    number("min_factor", options.min_factor, 0.01, 1.0)
    number("budget", 1.0 if options.budget is None else options.budget, 0.01, 1.0)
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
        _dim(options, options.backlight)


def _install() -> None:
    text = unit([word for word in sys.argv[sys.argv.index("live") + 1 :] if word != "--install"])
    typer.echo(f"{unit_file()}:\n\n{text}")
    if typer.confirm("Write this file, and start it now and with each session?"):
        install(text)
        typer.echo("evenlight live --status says what it does; --uninstall undoes this")


def _dim(options: LiveOptions, backlights: list[str]) -> None:
    tell: Callable[[str], None] = (lambda _: None) if options.quiet else typer.echo
    display, fastest = _display_and_limit(options)
    power_model = power_model_for(display)
    lcd = power_model is not None and power_model.kind is PanelKind.LCD
    watts = float(power_per_factor(power_model, np.ones((1, 3)))[0]) if lcd else None
    least = 1.0 if options.budget is None else factor_due(options.budget, power_model, 1.0)
    if least < options.min_factor:
        raise InputError(
            f"--budget {options.budget:g} asks for the factor {least:.2f} on average, and the lowest is "
            f"{options.min_factor:g}: give more, or a lower --min-factor"
        )
    with ExitStack() as stack:
        today = DayTotal.kept()
        stack.callback(only_one().release)
        grabber = stack.enter_context(opened_screens())
        if len(backlights) > (count := len(grabber.monitors) - 1):
            raise InputError(f"there are {len(backlights)} backlights, and monitors: {count}")
        model, knots = load_contrast_model("default"), brightness_factors(LOWEST)
        films = None if options.mpv_socket is None else FilmTracks(options.mpv_socket, options, tell)
        monitors = []
        for place, name in enumerate(backlights, start=1):
            screen = WatchedScreen(grabber, place, display, model, knots)
            screen.look(time.monotonic())
            tell(f"{name}: monitor {screen.name}, {screen.size[0]}x{screen.size[1]}")
            device, watchdog = kept_backlight(name, options.backlight_curve)
            loss = TARGET_LOSS if options.target_loss is None else options.target_loss
            white = display.peak_luminance
            dimmer = MonitorDimmer(device, time.monotonic, fastest, white, knots, loss, options.min_factor)
            one = Monitor(name, screen, dimmer, watchdog.bring_back)
            if options.budget is not None:
                due = partial(factor_due, options.budget, power_model)
                one.target = LossTarget(dimmer, due, options.min_factor)
            if films is not None:
                one.film = partial(films.frame, screen.name)
            monitors.append(one)
        rest_with = [name.strip() for name in options.rest_with.split(",") if name.strip()]
        measured = PowerGauge(options.power_meter).mean
        loop = LiveLoop(
            monitors, time.monotonic, time.sleep, reasons(rest_with, options.on_battery), tell, write_state,
            watts, measured, today,
        )  # fmt: skip
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
            write_state(loop.state(), to_disk=True)
            tell(loop.state().in_words())


def _display_and_limit(options: LiveOptions) -> tuple[Display, ScalarRateLimit]:
    limit = load_rate_limit(options.rate_limit)
    display = display_for(limit, options.display)
    limit = usable_limit(limit, display, options.other_display_ok, options.accept_wide_band, options.noticed)
    curve = LimitCurve(options.limit_curve)
    return display, scalar_rate_limit(limit, display.reflected_luminance, curve)
