"""The command `evenlight follow`: a display's backlight follows a film in mpv."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from evenlight.experiments.playback.play_options import interrupted, with_options
from evenlight.method.choices import LimitCurve


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowOptions:
    """What is followed, with what; the command line is made from it."""

    video: Annotated[Path, typer.Argument(help="Video file, which mpv plays.")]
    track: Annotated[Path, typer.Argument(help="Its track.csv, or the folder that holds it.")]
    backlight: Annotated[
        str | None,
        typer.Option(help="sysfs:NAME, ddc:NUMBER, board:PORT, exec:PROGRAM or simulated."),
    ] = None
    backlight_curve: Annotated[
        Path | None, typer.Option(help="Its measured curve: brightness.csv of a luminance sweep.")
    ] = None
    rig: Annotated[
        str | None,
        typer.Option(help="Rig that names backlight, curve and display, in place of these options."),
    ] = None
    display: Annotated[
        str | None, typer.Option(help="Display, a preset or a toml file: it must be the track's.")
    ] = None
    rate_limit: Annotated[
        str | None, typer.Option(help="The track's rate limit, where that is no preset: its json file.")
    ] = None
    limit_curve: Annotated[
        LimitCurve, typer.Option(help="The fitted rate limit, or the lower edge of its band.")
    ] = LimitCurve.FITTED
    socket: Annotated[
        Path | None, typer.Option(help="Join the mpv with this --input-ipc-server; else one is started.")
    ] = None
    player_arguments: Annotated[
        str | None, typer.Option(help="More options for mpv, as one word: '--fullscreen --start=1:30'.")
    ] = None
    wait: Annotated[
        bool,
        typer.Option("--wait", help="Begin the film when the backlight is at its first factor."),
    ] = False
    other_video_ok: Annotated[
        bool, typer.Option("--other-video-ok", help="Accept the same film, encoded again.")
    ] = False
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print what would be set, and open no backlight.")
    ] = False
    log: Annotated[Path | None, typer.Option(help="File for all settings and their delays, .csv.")] = None
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing about what is done.")] = False


def follow(options: FollowOptions) -> None:
    """Let a display's backlight follow a film in mpv by its track, never faster than the rate limit.

    It needs mpv (0.33 or newer). Whatever ends it, the brightness of before comes back.
    """
    from evenlight.experiments.follow.follow_film import follow_as_asked

    try:
        follow_as_asked(options)
    except BaseException as error:
        if isinstance(error, Exception | SystemExit):
            raise
        notes = getattr(error, "__notes__", ["the backlight is as it was found"])
        raise interrupted(error, "; ".join(notes)) from None


follow_command = with_options(follow, FollowOptions)
