"""The command `evenlight live`: a desktop's backlights follow what is on its monitors."""

from __future__ import annotations

import functools
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.experiments.playback.play_options import interrupted
from evenlight.option_panels import QuietOption, asked, expert, with_options
from evenlight.stimuli.dimming_options import OnDisplay, WithinLimit

light_option = functools.partial(typer.Option, rich_help_panel="Backlight")
service = functools.partial(typer.Option, rich_help_panel="What runs already")


@dataclass(frozen=True, kw_only=True)
class LiveOptions(OnDisplay, WithinLimit):
    """What is dimmed, and how far; the command line is made from it."""

    backlight: Annotated[
        list[str] | None,
        light_option(
            metavar="DRIVER:ADDRESS",
            help="The backlight, e.g. sysfs:intel_backlight; once for each monitor, in their order. "
            "`evenlight measure list` shows those of this computer.",
        ),
    ] = None
    backlight_curve: Annotated[
        str, expert(help="Measured light of each of its steps: brightness.csv of a luminance sweep.")
    ] = ""
    target_loss: Annotated[
        float | None,
        asked(help="Share of visible contrast that the picture may lose, 0 to 1.", show_default="0.03"),
    ] = None
    budget: Annotated[
        float | None,
        asked(
            help="Instead: mean share of its power that the display may use over 10 minutes; of its "
            "brightness, where it has no power model."
        ),
    ] = None
    min_factor: Annotated[float, expert(help="Lowest brightness, as a share of what you have set.")] = 0.3
    on_battery: Annotated[bool, asked("--on-battery", help="Rest on mains power.")] = False
    rest_with: Annotated[
        str, asked(metavar="PROGRAMS", help="Rest while one of these runs: gimp,darktable.")
    ] = ""
    pause: Annotated[
        bool, service("--pause", help="Let it rest, or go on, and end: for a key of your own.")
    ] = False
    status: Annotated[bool, service("--status", help="Say what it does and has saved, and end.")] = False
    install: Annotated[
        bool, service("--install", help="Show a user's service for systemd, and start it with the session.")
    ] = False
    uninstall: Annotated[bool, expert("--uninstall", help="Undo --install.")] = False
    power_meter: Annotated[
        str, expert(help="A power meter, told beside the estimate, e.g. battery: for the whole computer.")
    ] = ""
    mpv_socket: Annotated[
        Path | None,
        expert(help="mpv's --input-ipc-server: films with a track are dimmed by it when full screen."),
    ] = None
    quiet: QuietOption = False


def live(options: LiveOptions) -> None:
    """Dim a desktop while you work: each backlight follows what is on its monitor.

    Below the brightness that you set, as far as the picture loses no more than it may, and never faster than
    the rate limit. Whatever ends it, your brightness comes back.
    """
    if sys.platform == "win32":
        raise InputError(
            "evenlight live drives backlights of Linux; on Windows there is no driver for them yet"
        )
    try:
        if options.status or options.pause:
            from evenlight.experiments.desktop.live_state import running, toggle_pause

            typer.echo(toggle_pause() if options.pause else running().in_words())
        elif options.uninstall:
            from evenlight.experiments.desktop.user_service import uninstall

            uninstall()
        else:
            from evenlight.experiments.desktop.live_desktop import live_as_asked

            live_as_asked(options)
    except BaseException as error:
        if isinstance(error, Exception | SystemExit):
            raise
        raise interrupted(error, "your brightness comes back") from None


live_command = with_options(live, LiveOptions)
