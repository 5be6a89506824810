"""On what a video is dimmed: the options that `optimize`, `catalogue` and `control` share.

A field is an option: its name, type, default and help are those of the command line. Nothing here is slow to
import.
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.choices import (
    LimitCurve,
    ModulatedLuminance,
)
from evenlight.method.contrast.measures import MEASURES
from evenlight.option_panels import asked, computation, expert, limits, output, viewing, words_and_files

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import TypeAlias, TypeVar

    from evenlight.analysis.tracks.optimization_job import OptimizationJob
    from evenlight.data_schema.contrast_model import ContrastModel
    from evenlight.data_schema.display import Display
    from evenlight.data_schema.power_model import PowerModel
    from evenlight.data_schema.rate_limit import RateLimit
    from evenlight.inputs import Frames
    from evenlight.method.optimizer.request import Request
    from evenlight.stimuli.video.video_source import VideoSource

    Kind = TypeVar("Kind")
    Member: TypeAlias = Kind | str  # of an enumeration, or its value
    File = str | PathLike[str]
    NamedDisplay = Display | File  # or the name of a preset, or a file
    NamedPowerModel = PowerModel | File
    NamedRateLimit = RateLimit | File
    NamedContrastModel = ContrastModel | File
    Names = str | Sequence[str]  # with commas between them
    Videos = Sequence[str | PathLike[str] | VideoSource | Frames]
else:  # what the command line takes of these

    class Member:
        """The enumeration itself, of which Typer takes the values."""

        def __class_getitem__(cls, kind: Any) -> Any:
            return kind

    NamedDisplay = NamedPowerModel = NamedRateLimit = NamedContrastModel = str
    File, Names, Videos = Path, str, list[str]

BATTERIES = (0.001, 1e6)  # [Wh]
MIN_FACTORS = (0.001, 0.99)  # a display can hardly be dimmed further; beyond, there is nothing left to choose

VideoArgument = Annotated[
    str,
    typer.Argument(
        help="The video: a file, a URL such as s3://bucket/film.mp4, a folder of images, or a built-in "
        "sequence: library, gym, living_room, basement, house, checkerboard, sunrise."
    ),
]
DisplayOption = Annotated[
    NamedDisplay | None,
    viewing(
        help="The display that the track is for: a preset such as laptop-lcd, or a file such as "
        "desk.display.toml.",
        show_default="that of the rate limit, or of the track",
    ),
]
FpsOption = Annotated[
    float | None, viewing(help="Frames per second, for a folder of images or a built-in sequence.")
]
JobsOption = Annotated[
    int, computation(help="How many frames to analyse at the same time, each on a core; 0: on all cores.")
]
NoCacheOption = Annotated[
    bool, expert("--no-cache", help="Neither use nor keep loss curves and pictures in the user's cache.")
]
QuietOption = Annotated[bool, typer.Option("--quiet", help="Print no progress and no closing lines.")]


def option(name: str) -> str:
    """Return what a field is called in messages of the command line."""
    return "--with" if name == "others" else f"--{name.replace('_', '-')}"


def path_of(file: File | None) -> Path | None:
    """Return the path of a file that is given by its name."""
    return None if file is None else Path(file)


@dataclass(frozen=True, kw_only=True)
class DimmedOn:
    """On what display, within which limit, videos are dimmed."""

    display: DisplayOption = None
    power_model: Annotated[
        NamedPowerModel,
        viewing(
            help="How much power the display takes at each brightness: a preset, or a toml file that "
            "`evenlight fit` wrote for a power sweep."
        ),
    ] = "surace2025"
    rate_limit: Annotated[
        NamedRateLimit,
        limits(help="How fast luminance may change: a preset, or rate_limit.json of `evenlight fit`."),
    ] = "surace2025"
    contrast_model: Annotated[
        NamedContrastModel,
        viewing(
            metavar="NAME|FILE",
            help="How loss of visible contrast is computed: default, as-printed (the paper to the letter), "
            "soft, castle, absolute, suprathreshold, or a toml file.",
            autocompletion=words_and_files("as-printed", *MEASURES),
        ),
    ] = "default"
    limit_curve: Annotated[
        Member[LimitCurve], expert(help="The fitted rate limit, or the lower (safe) edge of its 95 % band.")
    ] = LimitCurve.FITTED
    modulated: Annotated[
        Member[ModulatedLuminance],
        expert(
            help="Which luminance the limit holds for: the mean of the frame, or that of a white screen "
            "(stricter)."
        ),
    ] = ModulatedLuminance.FRAME_MEAN
    min_factor: Annotated[
        float,
        asked(help="Lowest brightness factor allowed, 0.001 to 0.99: 0.2 is a fifth of full brightness."),
    ] = 0.2
    field_of_view: Annotated[
        float | None,
        viewing(
            help="Visual angle that the width of the video spans. Otherwise as it was rendered for, or one "
            "pixel of the video on each pixel of the display."
        ),
    ] = None
    actuator: Annotated[
        Member[Actuator],
        viewing(
            help="What dims the display: its backlight, or its pixels (as on OLED), which show nothing below "
            "the black level."
        ),
    ] = Actuator.BACKLIGHT
    fps: FpsOption = None
    other_display_ok: Annotated[
        bool,
        expert(
            "--other-display-ok",
            help="Use a rate limit that was measured on another display, at your own risk.",
        ),
    ] = False
    accept_wide_band: Annotated[
        bool,
        expert(
            "--accept-wide-band",
            help="Use a rate limit even if it is known too imprecisely (its band is missing or too wide).",
        ),
    ] = False
    battery_wh: Annotated[
        float | None,
        output(
            metavar="WH",
            min=BATTERIES[0],
            max=BATTERIES[1],
            help="Capacity of a battery, in watt hours, to say how long the display lasts on it.",
        ),
    ] = None
    no_cache: NoCacheOption = False
    no_player: Annotated[
        bool,
        expert("--no-player", help="Do not write player.html, the page that plays the video with its track."),
    ] = False

    def named(self, name: str) -> str:
        """Return what a field is called in messages."""
        return option(name)

    def check(self) -> None:
        """Refuse, in one line, what no video can be dimmed with."""
        from evenlight.inputs import number
        from evenlight.stimuli.sequence_format import NARROWEST, WIDEST

        number(self.named("min_factor"), self.min_factor, *MIN_FACTORS)
        if self.fps is not None:
            number(self.named("fps"), self.fps)
        if self.field_of_view is not None:
            number(self.named("field_of_view"), self.field_of_view, NARROWEST, WIDEST)
        if self.battery_wh is not None:
            number(self.named("battery_wh"), self.battery_wh, *BATTERIES)

    def within(self, budget: float, unit: Member[BudgetUnit], display: Display) -> Request:
        """Return a request within the rate limit, which has to be one that may be used on the display."""
        from evenlight import inputs
        from evenlight.method.optimizer.request import Request
        from evenlight.method.preset_files import usable_limit

        limit = inputs.rate_limit_of(self.rate_limit)
        return Request(
            inputs.number("budget", budget),
            inputs.choice("budget_unit", unit, BudgetUnit),
            inputs.power_model_of(self.power_model),
            usable_limit(limit, display, self.other_display_ok, self.accept_wide_band),
            inputs.choice("limit_curve", self.limit_curve, LimitCurve),
            inputs.choice("modulated", self.modulated, ModulatedLuminance),
            battery=self.battery_wh,
        )

    def shown_on(self, curves: File | None = None) -> Display:
        """Return the display; if none is given, that of loss curves, or of the rate limit."""
        from evenlight import inputs
        from evenlight.method.preset_files import display_for

        if self.display is not None:
            return inputs.display_of(self.display)
        return display_for(inputs.rate_limit_of(self.rate_limit), None, path_of(curves))

    def model(self, robust: Sequence[str] = ()) -> tuple[ContrastModel, str]:
        """Return the contrast model and its name: the first of several measures, if there are to be any."""
        from evenlight.inputs import contrast_model_of
        from evenlight.method.contrast.measures import measure_named

        if robust:
            return measure_named(robust[0]), robust[0]
        name = fspath(self.contrast_model) if isinstance(self.contrast_model, str | PathLike) else "given"
        return contrast_model_of(self.contrast_model), name

    def job(self, source: VideoSource, display: Display, request: Request) -> OptimizationJob:
        """Return the job for a video."""
        from evenlight.analysis.tracks.optimization_job import OptimizationJob
        from evenlight.inputs import choice

        return OptimizationJob(
            source,
            display,
            request,
            *self.model(),
            min_factor=self.min_factor,
            field_of_view=self.field_of_view,
            actuator=choice("actuator", self.actuator, Actuator),
            cached=not self.no_cache,
            player=not self.no_player,
        )
