"""The commands `evenlight play`, a video with its track, and `evenlight walk`, a walk through a scene."""

from __future__ import annotations

import typer

from evenlight.experiments.playback.play_options import (
    FilmOptions,
    HeadsetOptions,
    LiveOptions,
    VersionOptions,
    WalkOptions,
    refuse,
)
from evenlight.option_panels import with_options
from evenlight.stimuli.dimming_options import GAINS


def _play(film: FilmOptions, versions: VersionOptions, headset: HeadsetOptions) -> None:
    """Show a video dimmed by its track, in a window or a headset.

    Keys: 1 dimmed by the track, 2 constantly at equal power, 3 undimmed, Esc ends. A window needs
    PsychoPy; in a headset the trigger goes on to the next of these, and the menu button ends.
    """
    from evenlight.experiments.playback.play_video import play_video

    play_video(film, versions, headset)


def _walk(walk: WalkOptions, live: LiveOptions) -> None:
    """Walk through a scene, in a window or a headset, dimmed live by --target-loss or --budget.

    Keys: W, A, S, D, arrows, mouse; shift: faster; Esc ends. A window needs PsychoPy.
    """
    if live.budget is None:
        refuse("{} is for --budget, which is not given", live, "budget_unit", "horizon", "power_model")
    if not live.dims:
        words = "{} is for walks that are dimmed live: give it with --target-loss or --budget"
        refuse(words, live, "rate_limit", "noticed", "device", "limit_curve", "accept_wide_band", *GAINS)
        refuse(words, walk, "other_display_ok")
    from evenlight.experiments.playback.walk_request import walk_as_asked

    said = walk_as_asked(walk, live)
    if not walk.quiet:
        typer.echo(said)


play = with_options(_play, FilmOptions, VersionOptions, HeadsetOptions)
walk = with_options(_walk, WalkOptions, LiveOptions)
