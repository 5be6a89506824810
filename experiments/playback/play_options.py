"""The options of `play`, `walk` and `measure played`; the command line is made from them.

A field is an option: its name, type, default and help are those of the command line.
"""

from __future__ import annotations

import enum
import functools
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.method.choices import Device
from evenlight.option_panels import ForceOption, QuietOption, asked, expert, output, viewing
from evenlight.stimuli.dimming_options import (
    AimOptions,
    Member,
    OnDisplay,
    TrackArgument,
    VideoArgument,
    WithinLimit,
    device_option,
)

INTERRUPTED, TERMINATED = 130, 143  # as shells count: 128 and the number of the signal
_headset = functools.partial(typer.Option, rich_help_panel="In a headset")
LIVE_PANEL = "Dimmed live, with --target-loss or --budget"
_live = functools.partial(typer.Option, rich_help_panel=LIVE_PANEL)


class PlayedVersion(enum.Enum):
    """What is played."""

    OURS = "ours"  # by the track
    BASELINE = "baseline"  # constantly, at equal power
    BOTH = "both"  # one after the other
    FULL = "full"  # undimmed


class Projection(enum.Enum):
    """What a video lies on in a headset."""

    FLAT = "flat"  # a screen in the dark
    HALF = "180"  # the half of a sphere that is ahead, equirectangular
    WHOLE = "360"  # a sphere all around, equirectangular


@dataclass(frozen=True, kw_only=True)
class ScreenOptions(OnDisplay):
    """What is shown on, and how it is rehearsed."""

    rig: Annotated[
        str | None,
        viewing(
            help="The rig, a file that describes screen and display (desk.rig.toml). Otherwise a window as "
            "large as the picture."
        ),
    ] = None
    size: Annotated[
        str | None,
        viewing(metavar="WxH", help="Size of a built-in sequence or scene in pixels, such as 640x360."),
    ] = None
    screenshots: Annotated[Path | None, expert(metavar="DIR", help="Folder for a picture of the screen.")] = (
        None
    )
    simulate: Annotated[
        bool, expert("--simulate", help="Rehearse, as fast as it goes: the clock counts the refreshes.")
    ] = False
    quiet: QuietOption = False


@dataclass(frozen=True, kw_only=True)
class FilmOptions(ScreenOptions):
    """A video with its track."""

    video: VideoArgument
    track: TrackArgument
    other_geometry_ok: Annotated[
        bool,
        expert("--other-geometry-ok", help="Accept a track made for another visual angle of the video."),
    ] = False
    old_calibration_ok: Annotated[
        bool,
        expert(
            "--old-calibration-ok", help="Accept a display that was measured longer ago than the rig allows."
        ),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class VersionOptions:
    """In which versions a video is played."""

    version: Annotated[
        PlayedVersion | None,
        asked(
            help="What is played first: dimmed by the track, constantly at equal power, both in turn, or "
            "undimmed.",
            show_default="ours",
        ),
    ] = None
    loop: Annotated[bool, asked("--loop", help="Repeat until Esc is pressed.")] = False
    label: Annotated[bool, asked("--label", help="Write on the picture how it is dimmed.")] = False
    log: Annotated[
        Path | None, expert(help="Table of every frame's time and factor, and drops: .csv or .jsonl.")
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadsetOptions:
    """How a video is seen in a headset; without one, none of these may be given."""

    projection: Annotated[
        Projection | None,
        _headset(
            help="What a video lies on: a flat screen in the dark, or a sphere for equirectangular ones.",
            show_default="flat",
        ),
    ] = None
    side_by_side: Annotated[
        bool,
        _headset(
            "--side-by-side", help="The video's left half is for the left eye, its right half for the right."
        ),
    ] = False
    screen_field_of_view: Annotated[
        float | None,
        _headset(
            metavar="DEG",
            help="Visual angle that the flat screen is wide. Otherwise that of the track's analysis.",
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerOptions:
    """A video in all its versions, with the panel's power measured."""

    out: Annotated[Path, output(help="New folder for samples, table, figure and report.")]
    passes: Annotated[int, asked(help="How often each version is played.", min=1)] = 3
    power_model: Annotated[
        str | None, asked(help="Power model to compare with: a preset or a toml file.")
    ] = None
    sample_rate_hz: Annotated[
        float | None,
        expert(
            metavar="HZ",
            help="Samples of the power meter per second.",
            min=0.1,
            max=1e6,
            show_default="up to 1000",
        ),
    ] = None
    sync_patch: Annotated[
        bool, expert("--sync-patch", help="Show a corner that changes with every frame, for a photodiode.")
    ] = False


@dataclass(frozen=True, kw_only=True)
class WalkOptions(ScreenOptions):
    """A walk through a scene."""

    scene: Annotated[
        str, typer.Argument(help="The scene: house, school, a glTF file, or a camera path (.json).")
    ]
    factor: Annotated[
        float | None,
        asked(metavar="FACTOR", help="Brightness factor to begin with.", show_default="1, or by --budget"),
    ] = None
    seconds: Annotated[float | None, asked(help="End the walk after this time.")] = None
    field_of_view: Annotated[
        float | None,
        viewing(
            help="Visual angle that the width of the window spans, as in a headset. Otherwise what it spans "
            "at true size, or 90 without a rig or display."
        ),
    ] = None
    out: Annotated[Path | None, output(help="Folder for how the walk was dimmed: tables.")] = None
    force: ForceOption = False
    record: Annotated[
        Path | None, expert(help="File (.json) for the way walked: a path for `evenlight render`.")
    ] = None
    log: Annotated[
        Path | None, expert(help="Table of every frame's time and factor, and drops: .csv or .jsonl.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class LiveOptions(WithinLimit, AimOptions):
    """The online controller that dims a walk."""

    PANEL = LIVE_PANEL  # of what it aims at, too
    power_model: Annotated[
        str | None,
        _live(help="Power model of a budget in power or watt.", show_default="the display's"),
    ] = None
    device: Annotated[Member[Device], device_option] = Device.AUTO

    @property
    def dims(self) -> bool:
        """Whether a controller dims the walk."""
        return self.target_loss is not None or self.budget is not None


def interrupted(error: BaseException, words: str) -> SystemExit:
    """Say what is kept of an interrupted job, and return what ends the program as shells expect it."""
    print(f"evenlight: interrupted; {words}", file=sys.stderr)
    return SystemExit(INTERRUPTED if isinstance(error, KeyboardInterrupt) else TERMINATED)


def refuse(because: str, options: object, *names: str) -> None:
    """Refuse the first option of a record that was given.

    Parameters
    ----------
    because : str
        What is said, with {} for the option.
    options : record
        One of this module's.
    *names : str
        Which of its fields; all, if none is named.
    """
    declared = options.__dataclass_fields__  # type: ignore[attr-defined] # of any dataclass
    for name in names or declared:
        if getattr(options, name) != declared[name].default:
            raise InputError(because.format(f"--{name.replace('_', '-')}"))
