"""The command `evenlight play`: a video with its track, the same with measured power, or a walk."""

from __future__ import annotations

from pathlib import Path

import typer

from evenlight.experiments.playback.play_options import (
    HeadsetOptions,
    LiveOptions,
    PowerOptions,
    ScreenOptions,
    VideoOptions,
    WalkOptions,
    refuse,
    with_options,
)
from evenlight.stimuli.dimming_options import GAINS


def _play(
    screen: ScreenOptions,
    video: VideoOptions,
    headset: HeadsetOptions,
    power: PowerOptions,
    walk: WalkOptions,
    live: LiveOptions,
) -> Path | None:
    """Show a video dimmed by its track, in a window or a headset; or walk through a scene, dimmed live.

    Keys: 1 dimmed by the track, 2 constantly at equal power, 3 undimmed, Esc ends. A window needs
    PsychoPy; in a headset the trigger goes on to the next of these, and the menu button ends.
    """
    # It returns the folder of measured power, for `analysis.measuring_commands`; the docstring is its help.
    if walk.walk:
        refuse("--walk takes no {}, which is for videos", headset)
        _walk(screen, video, power, walk, live)
        return None
    for record in (walk, live):
        refuse("{} is for walks through a scene: give it with --walk, or leave it out", record)
    if not power.measure_power:
        _play_video(screen, video, headset, power)
        return None
    refuse("{} is for a headset, whose power cannot be measured: leave out --measure-power", headset)
    return _measure(screen, video, power)


play = with_options(
    _play, ScreenOptions, VideoOptions, HeadsetOptions, PowerOptions, WalkOptions, LiveOptions
)


def _play_video(
    screen: ScreenOptions, video: VideoOptions, headset: HeadsetOptions, power: PowerOptions
) -> None:
    """Play a video with its track."""
    words = "{} is for measured power: give it with --measure-power, or leave it out"
    refuse(words, power)
    refuse(words, screen, "out", "power_model")
    from evenlight.experiments.playback.play_video import play_video

    play_video(screen, video, headset)


def _measure(screen: ScreenOptions, video: VideoOptions, power: PowerOptions) -> Path:
    """Play a video in all its versions and measure the power; return the folder of the samples."""
    refuse("{} does not go with --measure-power, which plays every version in turn", video)
    from evenlight.experiments.playback.measured_play import measure_power

    return measure_power(screen, power)


def _walk(
    screen: ScreenOptions, video: VideoOptions, power: PowerOptions, walk: WalkOptions, live: LiveOptions
) -> None:
    """Let the user walk through a scene."""
    if live.budget is None:
        refuse("{} is for --budget, which is not given", live, "budget_unit", "horizon")
    for_videos = "--walk takes no {}, which is for videos; --record keeps the way, --factor dims it"
    refuse(for_videos, screen, "track", "other_geometry_ok")
    if not live.dims:
        words = "{} is for walks that are dimmed online: give it with --target-loss"
        refuse(words, live, "rate_limit", "device", "limit_curve", "accept_wide_band", *GAINS)
        refuse(for_videos, screen, "other_display_ok")
    refuse(for_videos, power)
    refuse(for_videos, video, "version", "loop", "label")
    if live.budget is None:
        refuse(for_videos, screen, "power_model")
    from evenlight.experiments.playback.walk_request import asked_walk, walk_as_asked

    said = walk_as_asked(asked_walk(screen, walk, live, video.log))
    if not screen.quiet:
        typer.echo(said)
