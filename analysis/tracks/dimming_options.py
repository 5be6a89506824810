"""On what a video is dimmed: the options of `optimize`, `catalogue`, `control`, and what they ask for."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from evenlight.data_schema.arguments import choice, flag, number, whole
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.film_reading import Damaged
from evenlight.method.choices import LimitCurve, ModulatedLuminance
from evenlight.method.contrast.measures import MEASURES
from evenlight.option_panels import asked, expert, output, viewing, words_and_files
from evenlight.stimuli.dimming_options import (
    BATTERIES,
    MIN_FACTORS,
    DamagedOption,
    File,
    FpsOption,
    Member,
    NamedContrastModel,
    NamedPowerModel,
    NoCacheOption,
    OnDisplay,
    StreamOption,
    WithinLimit,
    power_model_option,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from evenlight.analysis.tracks.optimization_job import OptimizationJob
    from evenlight.data_schema.contrast_model import ContrastModel
    from evenlight.data_schema.display import Display
    from evenlight.method.optimizer.request import Request
    from evenlight.stimuli.video.video_source import VideoSource


def actuator_of(display: Display, given: Member[Actuator] | None) -> Actuator:
    """Return what is asked to dim a display; else what does, as far as that is known."""
    if given is None:
        return display.actuator or Actuator.BACKLIGHT
    return choice("actuator", given, Actuator)


def path_of(file: File | None) -> Path | None:
    """Return the path of a file that is given by its name."""
    return None if file is None else Path(file)


@dataclass(frozen=True, kw_only=True)
class Dimmed(WithinLimit, OnDisplay):
    """On what display, within which limit, frames are dimmed: those of a video, or as they come."""

    power_model: Annotated[NamedPowerModel | None, power_model_option] = None
    contrast_model: Annotated[
        NamedContrastModel,
        viewing(
            metavar="NAME|FILE",
            help="How loss of visible contrast is computed: default, as-printed (the paper to the letter), "
            "soft, castle, absolute, suprathreshold, or a toml file.",
            autocompletion=words_and_files("as-printed", *MEASURES),
        ),
    ] = "default"
    min_factor: Annotated[
        float,
        asked(help="Lowest brightness factor allowed, 0.001 to 0.99: 0.2 is a fifth of full brightness."),
    ] = 0.2
    field_of_view: Annotated[
        float | None,
        viewing(
            help="Visual angle that the width of the video spans; 0: pixel for pixel. Otherwise as it was "
            "rendered for, or full screen on a flat display of known size."
        ),
    ] = None
    fps: FpsOption = None

    def check(self) -> None:
        """Refuse, in one line, what no video can be dimmed with."""
        from evenlight.stimuli.video.viewing_geometry import require_angle

        for one in fields(self):
            if isinstance(one.default, bool):
                flag(one.name, getattr(self, one.name))
        number("min_factor", self.min_factor, *MIN_FACTORS)
        if self.fps is not None:
            number("fps", self.fps)
        require_angle(self.field_of_view)

    def within(self, budget: float, unit: Member[BudgetUnit], display: Display) -> Request:
        """Return a request within the rate limit, which has to be one that may be used on the display."""
        from evenlight.method.optimizer.request import Request
        from evenlight.method.preset_files import load_rate_limit, power_model_for, usable_limit

        limit, unit = load_rate_limit(self.rate_limit), choice("budget_unit", unit, BudgetUnit)
        needed_for = "" if unit is BudgetUnit.FACTOR else f"a budget in {unit.value}"
        return Request(
            number("budget", budget),
            unit,
            power_model_for(display, self.power_model, needed_for),
            usable_limit(limit, display, self.other_display_ok, self.accept_wide_band, self.noticed),
            choice("limit_curve", self.limit_curve, LimitCurve),
            noticed=self.noticed,
        )

    def shown_on(self, curves: File | None = None) -> Display:
        """Return the display; if none is given, that of loss curves, or of the rate limit."""
        from evenlight.method.preset_files import display_for, load_rate_limit

        return display_for(load_rate_limit(self.rate_limit), self.display, path_of(curves))

    def model(self, robust: Sequence[str] = ()) -> tuple[ContrastModel, str]:
        """Return the contrast model and its name: the first of several measures, if there are to be any."""
        from evenlight.method.contrast.measures import measure_named
        from evenlight.method.preset_files import load_contrast_model

        if robust:
            return measure_named(robust[0]), robust[0]
        name = fspath(self.contrast_model) if isinstance(self.contrast_model, str | PathLike) else "given"
        return load_contrast_model(self.contrast_model), name


@dataclass(frozen=True, kw_only=True)
class DimmedOn(Dimmed):
    """On what display, within which limit, videos are dimmed."""

    modulated: Annotated[
        Member[ModulatedLuminance],
        expert(
            help="Which luminance the limit holds for: the mean of the frame, or that of a white screen "
            "(stricter)."
        ),
    ] = ModulatedLuminance.FRAME_MEAN
    actuator: Annotated[
        Member[Actuator] | None,
        viewing(
            help="What dims the display: its backlight, or its pixels (as on OLED), which show nothing below "
            "the black level.",
            show_default="the display's; else backlight",
        ),
    ] = None
    battery_wh: Annotated[
        float | None,
        output(
            metavar="WH",
            min=BATTERIES[0],
            max=BATTERIES[1],
            help="Capacity of a battery, in watt hours, to say how long the display lasts on it.",
        ),
    ] = None
    damaged: DamagedOption = Damaged.REFUSE
    stream: StreamOption = None
    no_cache: NoCacheOption = False
    no_player: Annotated[
        bool,
        expert("--no-player", help="Do not write player.html, the page that plays the video with its track."),
    ] = False

    def check(self) -> None:
        """Refuse, in one line, what no video can be dimmed with."""
        super().check()
        if self.battery_wh is not None:
            number("battery_wh", self.battery_wh, *BATTERIES)
        choice("damaged", self.damaged, Damaged)
        if self.stream is not None:
            whole("stream", self.stream)

    def within(self, budget: float, unit: Member[BudgetUnit], display: Display) -> Request:
        """Return a request within the rate limit, for frames or white screens, and for a battery."""
        from evenlight.method.preset_files import power_model_for

        if self.battery_wh is not None:
            power_model_for(display, self.power_model, "`battery_wh`")
        modulated = choice("modulated", self.modulated, ModulatedLuminance)
        return replace(super().within(budget, unit, display), modulated=modulated, battery=self.battery_wh)

    def job(self, source: VideoSource, display: Display, request: Request) -> OptimizationJob:
        """Return the job for a video."""
        from evenlight.analysis.tracks.optimization_job import OptimizationJob

        return OptimizationJob(
            source,
            display,
            request,
            *self.model(),
            min_factor=self.min_factor,
            field_of_view=self.field_of_view,
            actuator=actuator_of(display, self.actuator),
            cached=not self.no_cache,
            player=not self.no_player,
        )
