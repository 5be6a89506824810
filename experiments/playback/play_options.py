"""The options of `evenlight play`, in a record for each of its jobs; the command line is made from them.

A field is an option: its name, type, default and help are those of the command line.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import inspect
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.choices import Device, LimitCurve

INTERRUPTED, TERMINATED = 130, 143  # as shells count: 128 and the number of the signal
_video = functools.partial(typer.Option, rich_help_panel="A video with its track")
_power = functools.partial(typer.Option, rich_help_panel="Measured power, with --measure-power")
_walk = functools.partial(typer.Option, rich_help_panel="A walk through a scene, with --walk")
_live = functools.partial(typer.Option, rich_help_panel="A walk dimmed live, with --target-loss or --budget")


class PlayedVersion(enum.Enum):
    """What is played."""

    OURS = "ours"  # by the track
    BASELINE = "baseline"  # constantly, at equal power
    BOTH = "both"  # one after the other
    FULL = "full"  # undimmed


@dataclass(frozen=True, slots=True, kw_only=True)
class ScreenOptions:
    """What is shown, on what; what several jobs share."""

    video: Annotated[
        str, typer.Argument(help="Video file, folder of images, or built-in sequence; a scene with --walk.")
    ]
    track: Annotated[
        Path | None, typer.Argument(help="Its track.csv, or the folder that holds it; none with --walk.")
    ] = None
    rig: Annotated[
        str | None, typer.Option(help="Rig: a toml file or a preset; else a window as large as the video.")
    ] = None
    display: Annotated[
        str | None, typer.Option(help="Display: a preset or a toml file; else the rig's, or the track's.")
    ] = None
    other_display_ok: Annotated[
        bool, typer.Option("--other-display-ok", help="Accept a track that was made for another display.")
    ] = False
    other_geometry_ok: Annotated[
        bool, typer.Option("--other-geometry-ok", help="Accept a track made for a video of another angle.")
    ] = False
    size: Annotated[
        str | None, typer.Option(help="Size of a built-in sequence or a scene in pixels, as 640x360.")
    ] = None
    screenshots: Annotated[Path | None, typer.Option(help="Folder for a picture of the screen.")] = None
    simulate: Annotated[
        bool, typer.Option("--simulate", help="As fast as it goes, on a clock that counts the refreshes.")
    ] = False
    power_model: Annotated[
        str | None, typer.Option(help="Power model of a --budget, or to compare the measured power with.")
    ] = None
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for measured power, or for what dimmed a walk: samples, table, report."),
    ] = None
    old_calibration_ok: Annotated[
        bool,
        typer.Option("--old-calibration-ok", help="Accept a display that was measured too long ago."),
    ] = False
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing about what is shown.")] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoOptions:
    """A video with its track."""

    version: Annotated[
        PlayedVersion | None,
        _video(help="By the track (if not given), constant at equal power, both in turn, undimmed."),
    ] = None
    loop: Annotated[bool, _video("--loop", help="Repeat until escape.")] = False
    label: Annotated[bool, _video("--label", help="Say on the picture how it is dimmed.")] = False
    log: Annotated[
        Path | None, _video(help="File for flip times, frames, factors, drops (walks too): .csv or .jsonl.")
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerOptions:
    """A video in all its versions, with the panel's power measured."""

    measure_power: Annotated[
        bool,
        _power(
            "--measure-power",
            help="Measure the panel's power while ours, baseline and full are played in turn.",
        ),
    ] = False
    passes: Annotated[
        int | None, _power(help="How often each version is played for its power; else 3.", min=1)
    ] = None
    sample_rate_hz: Annotated[
        float | None, _power(help="Samples of the power meter per second; else up to 1000.", min=0.1, max=1e6)
    ] = None
    sync_patch: Annotated[
        bool,
        _power("--sync-patch", help="A corner that changes with every frame, for a photodiode at the meter."),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkOptions:
    """A walk through a scene."""

    walk: Annotated[
        bool,
        _walk("--walk", help="Walk in the scene house or school: W, A, S, D, arrows, mouse; shift hurries."),
    ] = False
    factor: Annotated[
        float | None, _walk(help="Brightness factor of a walk, to begin with; else 1, or by --budget.")
    ] = None
    record: Annotated[
        Path | None, _walk(help="File for the way walked, .json: a path that `render` takes.")
    ] = None
    seconds: Annotated[float | None, _walk(help="End a walk after so many seconds.")] = None
    field_of_view: Annotated[
        float | None,
        _walk(
            help="Degrees that the window's width spans, as in a headset; without a rig or display 90, else "
            "what it spans at true size."
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveOptions:
    """The online controller that dims a walk."""

    target_loss: Annotated[
        float | None,
        _live(help="Contrast loss that a walk is dimmed to, online; with --budget to begin with."),
    ] = None
    budget: Annotated[
        float | None, _live(help="Budget that the target of a dimmed walk follows, in its unit.")
    ] = None
    budget_unit: Annotated[
        BudgetUnit | None,
        _live(help="Mean brightness factor, share of full power, or watt.", show_default="factor"),
    ] = None
    horizon: Annotated[
        float | None, _live(help="Seconds over which the mean is to meet the budget.", show_default="60")
    ] = None
    rate_limit: Annotated[
        str | None, _live(help="Rate limit of a dimmed walk: a preset or a file; else the paper's.")
    ] = None
    device: Annotated[
        Device | None, _live(help="What measures the loss of a dimmed walk; else what is fastest.")
    ] = None
    limit_curve: Annotated[
        LimitCurve | None, _live(help="Of a dimmed walk: the fitted rate limit, or its safe edge.")
    ] = None
    accept_wide_band: Annotated[
        bool, _live("--accept-wide-band", help="Use a rate limit that is known too badly all the same.")
    ] = False
    tuning: Annotated[
        Path | None, _live(help="Gains of a dimmed walk: tuning.json of `evenlight control --tune`.")
    ] = None

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
    for name in names or options.__dataclass_fields__:  # type: ignore[attr-defined] # of any dataclass
        given = getattr(options, name)
        if given is not None and given is not False:
            raise InputError(because.format("TRACK" if name == "track" else f"--{name.replace('_', '-')}"))


def with_options(command: Callable[..., None], *groups: type[Any]) -> Callable[..., None]:
    """Return a command that takes records of options as one that takes their fields, as Typer wants it.

    Parameters
    ----------
    command : callable
        Takes a record of each group.
    *groups : type
        The records.
    """
    hints = [get_type_hints(group, include_extras=True) for group in groups]
    empty = inspect.Parameter.empty
    parameters = [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=empty if field.default is dataclasses.MISSING else field.default,
            annotation=kinds[field.name],
        )
        for group, kinds in zip(groups, hints, strict=True)
        for field in dataclasses.fields(group)
    ]

    @functools.wraps(command)
    def flat(**given: Any) -> None:
        command(*(group(**{name: given[name] for name in group.__dataclass_fields__}) for group in groups))

    flat.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined] # inspect looks for it
    flat.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    del flat.__wrapped__  # else its parameters would be looked at
    return flat
