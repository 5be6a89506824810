"""Follows a film as `evenlight follow` is asked to."""

from __future__ import annotations

import shlex
import socket
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import typer

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.append_log import AppendedRows
from evenlight.data_schema.tracks.brightness_track import require_light_of
from evenlight.data_schema.tracks.film_reading import FilmReading
from evenlight.data_schema.tracks.loaded_track import load_track, track_file
from evenlight.experiments.follow.follow_command import FollowOptions
from evenlight.experiments.follow.follow_loop import FollowedSetting, FollowLoop
from evenlight.experiments.follow.limited_backlight import (
    FilmLight,
    LimitedBacklight,
    film_light,
    track_rate_limit,
)
from evenlight.experiments.follow.mpv_player import join_mpv, start_mpv
from evenlight.experiments.follow.watchdog import watched_backlight
from evenlight.hardware.installed_drivers import InstrumentKind, find_driver
from evenlight.hardware.protocols import Backlight
from evenlight.hardware.rig_files import load_rig
from evenlight.method.choices import LimitCurve
from evenlight.method.rate_limit import ScalarRateLimit, scalar_rate_limit
from evenlight.stimuli.dimmed.matched_track import match_track
from evenlight.stimuli.dimming_options import WithinLimit
from evenlight.stimuli.video.video_file import open_video_file
from evenlight.stimuli.video.video_locations import is_url

COARSE = 0.01  # step of a backlight at the film's lowest factor, as a share of that, that is worth a note


def follow_as_asked(options: FollowOptions) -> None:
    """Follow a film, and say how it went; whatever ends it, the brightness of before comes back."""
    if not hasattr(socket, "AF_UNIX"):
        raise InputError("follow works on Linux and macOS only: it talks to mpv over a Unix socket")
    tell = _nothing if options.quiet else typer.echo
    backlight, curve, display = _hardware(options)
    arguments = _arguments(options)
    film, rate_limit = film_wanted(options.video, options.track, display, options, options.other_video_ok)
    with ExitStack() as stack:
        player = None
        if options.socket is not None:
            player = stack.enter_context(join_mpv(options.socket, options.video, film.times, film.reading))
        # Its end comes before those on the stack, which may take a moment.
        with watched_backlight(backlight, curve) as device:
            follower = LimitedBacklight(device, film, rate_limit)
            player = player or stack.enter_context(
                start_mpv(options.video, film.times, arguments, film.reading)
            )
            tell(_begun(options, device, follower))
            following = FollowLoop(player, follower, time.monotonic, tell, _log(options.log, stack))
            stack.callback(lambda: tell(following.summary()))
            begin = player.go_on if options.wait else lambda: None
            following.run(typer.echo if options.dry_run else _nothing, begin)
            if not options.dry_run:
                following.glide_back()


def _log(path: Path | None, stack: ExitStack) -> Callable[[FollowedSetting], None]:
    """Return what keeps the settings, row by row."""
    if path is None:
        return _nothing
    rows = stack.enter_context(AppendedRows(path, FollowedSetting))
    return lambda setting: rows.append([setting], to_disk=False)


def _nothing(_: object) -> None:
    """Say and keep nothing."""


def _hardware(options: FollowOptions) -> tuple[str, str, str | None]:
    """Return backlight, its curve and the display, as the options or their rig name them."""
    backlight, display = options.backlight, options.display
    curve = "" if options.backlight_curve is None else str(options.backlight_curve)
    if options.rig is not None:
        if backlight is not None or curve:
            raise InputError("--rig names backlight and curve itself: give it, or --backlight")
        rig, its_display = load_rig(options.rig)
        backlight, curve, display = rig.backlight, rig.backlight_curve, display or its_display
    if options.dry_run:
        if options.backlight is not None:
            find_driver(options.backlight, InstrumentKind.BACKLIGHT)
        return "simulated", "", display
    if backlight is None:
        raise InputError(
            "follow needs --backlight (`evenlight measure list` shows those of this computer), --rig, or "
            "--dry-run"
        )
    return backlight, curve, display


def _arguments(options: FollowOptions) -> list[str]:
    """Return what mpv is started with; refuse options that do not go together, and a log that cannot be."""
    if options.socket is not None and (options.wait or options.player_arguments is not None):
        raise InputError(
            "--player-arguments and --wait are for an mpv that is started; with --socket one runs already"
        )
    if options.log is not None and (options.log.suffix != ".csv" or options.log.exists()):
        raise InputError(f"--log {options.log}: give a new file that ends in .csv")
    try:
        return shlex.split(options.player_arguments or "") + ["--pause"] * options.wait
    except ValueError as error:
        raise InputError(f"--player-arguments: {error}; quote words as a shell takes them") from None


def film_wanted(
    film: Path, track: Path, display: str | None, within: FollowOptions | WithinLimit, other_ok: bool = False
) -> tuple[FilmLight, ScalarRateLimit]:
    """Return what the track wants, and how fast; refuse one of another video, display or rate limit."""
    if is_url(str(film).replace(":/", "://")):  # as a path, it has one slash
        raise InputError("follow plays a file of this computer with mpv: download the video from its URL")
    if not film.is_file():
        raise InputError(f"{film}: no such video file; what mpv plays is a file, so render a sequence")
    reading = load_track(track).track.header.film or FilmReading()
    video = open_video_file(film, reading.damaged, reading.stream)
    matched = match_track(video, track, display, other_video_ok=other_ok)
    loaded, shown_on = matched.loaded, matched.display
    require_light_of(loaded.track, shown_on, track_file(track))
    given = None if within.rate_limit is None else str(within.rate_limit)
    limit = track_rate_limit(loaded.track, given, within.noticed)
    fastest = scalar_rate_limit(limit, shown_on.reflected_luminance, LimitCurve(within.limit_curve))
    return film_light(loaded, shown_on, video.reading), fastest


def _begun(options: FollowOptions, device: Backlight, follower: LimitedBacklight) -> str:
    """Return what is said before the film begins."""
    name = options.backlight or (f"the backlight of {options.rig}" if options.rig else "simulated")
    words = "a simulated backlight (nothing is set)" if options.dry_run else name
    said = f"{options.video.name} with {words}, found at factor {follower.found:.3f}"
    return said + jumps(device, float(follower.film.factors.min()))


def jumps(device: Backlight, dimmest: float) -> str:
    """Return a note on a backlight with coarse steps at the lowest factor wanted; empty for fine ones."""
    if (share := device.step() / dimmest) <= COARSE:
        return ""
    return (
        f"; note: it moves in jumps of {device.step():.3g}, {share:.1%} of the light at the lowest factor "
        f"wanted, {dimmest:.3g}"
    )
