"""The command `evenlight follow`: a display's backlight follows a film in mpv."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from evenlight.experiments.playback.play_options import interrupted
from evenlight.method.choices import LimitCurve
from evenlight.option_panels import QuietOption, expert, limits, with_options, words_and_files

light_option = functools.partial(typer.Option, rich_help_panel="Backlight")
player_option = functools.partial(typer.Option, rich_help_panel="Player")


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowOptions:
    """What is followed, with what; the command line is made from it."""

    video: Annotated[
        Path, typer.Argument(help="The video file, which mpv plays.", autocompletion=words_and_files())
    ]
    track: Annotated[
        Path, typer.Argument(help="Its track: the folder that `evenlight optimize` wrote, or track.csv.")
    ]
    backlight: Annotated[
        str | None,
        light_option(
            metavar="DRIVER:ADDRESS",
            help="The backlight: sysfs:NAME, ddc:NUMBER, board:PORT, exec:PROGRAM or simulated. `evenlight "
            "measure list` shows those of this computer.",
        ),
    ] = None
    backlight_curve: Annotated[
        Path | None,
        light_option(help="Measured light of each of its steps: brightness.csv of a luminance sweep."),
    ] = None
    rig: Annotated[
        str | None,
        light_option(help="Rig that names backlight, curve and display, in place of these options."),
    ] = None
    display: Annotated[
        str | None,
        light_option(
            help="The display, a preset or a toml file. It must be the one that the track was made for."
        ),
    ] = None
    rate_limit: Annotated[
        str | None, limits(help="The rate limit that the track was made with, if it was a file.")
    ] = None
    noticed: Annotated[
        float | None,
        expert(metavar="SHARE", help="As of `optimize`; otherwise the share that the track was made for."),
    ] = None
    limit_curve: Annotated[
        LimitCurve, expert(help="The fitted rate limit, or the lower (safe) edge of its band.")
    ] = LimitCurve.FITTED
    socket: Annotated[
        Path | None,
        expert(help="Join an mpv that was started with this --input-ipc-server. Otherwise one is started."),
    ] = None
    player_arguments: Annotated[
        str | None,
        expert(metavar="OPTIONS", help="More options for mpv, quoted: '--fullscreen --start=1:30'."),
    ] = None
    wait: Annotated[
        bool,
        expert("--wait", help="Begin the film only when the backlight has reached the first factor."),
    ] = False
    other_video_ok: Annotated[
        bool, expert("--other-video-ok", help="Accept the same film in another encoding.")
    ] = False
    dry_run: Annotated[
        bool, light_option("--dry-run", help="Print what would be set, and touch no backlight.")
    ] = False
    log: Annotated[Path | None, expert(help="Table (.csv) of every setting and its delay.")] = None
    quiet: QuietOption = False


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
