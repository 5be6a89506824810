"""What is asked of a brightness track, declared once: options, keywords of Python, columns of catalogues.

A field is an option of the command line, with its type, default and help, a keyword of `evenlight.optimize`,
and a key of `request.toml`. Nothing here is slow to import.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evenlight.analysis.tracks.dimming_options import DimmedOn, path_of
from evenlight.data_schema.arguments import choice, number, path, whole
from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.choices import (
    DEFAULT_CALM,
    AnalysisEffort,
    Device,
    ObjectiveName,
    SolverName,
)
from evenlight.method.contrast.measures import MEASURES, ROBUST, measures_named
from evenlight.option_panels import ForceOption, QuietOption, asked, expert, output
from evenlight.stimuli.dimming_options import (
    File,
    JobsOption,
    Member,
    Names,
    VideoArgument,
    Videos,
    device_option,
    names_in,
)

if TYPE_CHECKING:
    from evenlight.analysis.tracks.optimization_job import OptimizationJob
    from evenlight.data_schema.contrast_model import ContrastModel
    from evenlight.data_schema.display import Display
    from evenlight.data_schema.rate_limit import RateLimit
    from evenlight.data_schema.tracks.loss_curves import LossCurves
    from evenlight.method.optimizer.request import Request
    from evenlight.stimuli.video.video_source import VideoSource

EXPECTED_FILES = {
    "start": "a track.csv, or the folder of an earlier result",
    "weights": "a csv table start_s,end_s,weight",
    "allowances": "a csv table start_s,end_s,allowance",
}


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What of a video whose frames are all known is to be made even, and at what budget."""

    budget: Annotated[float, asked(help="How much brightness or power may be used, in --budget-unit.")] = (
        field(kw_only=False)
    )
    budget_unit: Annotated[
        Member[BudgetUnit],
        asked(
            help="What --budget counts: the mean brightness factor, the share of the power at full "
            "brightness, or watts."
        ),
    ] = BudgetUnit.FACTOR
    calm: Annotated[
        float,
        asked(
            metavar="SHARE",
            help="Share of the gain to give up for a track that turns back less often; 0: the exact optimum.",
        ),
    ] = DEFAULT_CALM
    objective: Annotated[
        Member[ObjectiveName],
        expert(
            help="What to minimize: differences of loss between frames (spread), these and the mean loss, "
            "or the largest loss of any frame."
        ),
    ] = ObjectiveName.SPREAD
    level_weight: Annotated[
        float | None, expert(metavar="WEIGHT", help="Weight of the mean loss in spread+mean, such as 0.5.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class WantedOfAll(DimmedOn, Wanted):
    """What `evenlight catalogue` may want of all videos alike."""

    def check(self) -> None:
        """Refuse, in one line, what no video can be dimmed with."""
        super().check()
        number("calm", self.calm, 0.0, 1.0)
        if self.level_weight is not None:
            number("level_weight", self.level_weight)


@dataclass(frozen=True, kw_only=True)
class Analysed:
    """How the loss curves of one video come about."""

    curves: Annotated[
        File | None,
        expert(help="loss_curves.npz of an earlier run on this video and display, to save the analysis."),
    ] = None
    jobs: JobsOption = 0
    device: Annotated[Member[Device], device_option] = Device.CPU

    def check_analysis(self) -> None:
        """Refuse, in one line, how no video can be analysed."""
        usual = whole("jobs", self.jobs) in (0, 1) and choice("device", self.device, Device) is Device.CPU
        if self.curves is not None and not usual:
            raise InputError("`jobs` and `device` are for computing loss curves, which `curves` gives")

    def effort(self, display: Display, model: ContrastModel, quiet: bool) -> AnalysisEffort:
        """Return what computes loss curves, and say why it is not the graphics processor.

        Raises
        ------
        InputError
            If the graphics processor is asked for, and there is none that can.
        """
        from evenlight.method.contrast.loss_curves import (
            SMALLEST_SIDE,
            brightness_factors,
            make_frame_analysis,
        )

        device = Device(self.device)
        if device is not Device.CPU and self.curves is None:
            smallest = (SMALLEST_SIDE, SMALLEST_SIDE)
            chosen = make_frame_analysis(smallest, display, model, brightness_factors(), device)
            if not quiet:
                by = "by OpenGL" if chosen.device is Device.GPU else "on the processor"
                typer.echo(f"loss curves {by}: {chosen.reason}", err=True)
            device = chosen.device
        return AnalysisEffort(jobs=self.jobs, device=device)


@dataclass(frozen=True, kw_only=True)
class TrackRequest(Analysed, WantedOfAll):
    """What `evenlight optimize` may be asked of a video, in a command and in Python."""

    solver: Annotated[
        Member[SolverName],
        expert(help="splitting is fast; slsqp is the paper's, for short clips."),
    ] = SolverName.SPLITTING
    weights: Annotated[
        File | None, asked(help="Table of scenes that count more or less: csv with start_s,end_s,weight.")
    ] = None
    allowances: Annotated[
        File | None,
        expert(
            help="Table of moments with another rate limit: csv with start_s,end_s,allowance. An allowance "
            "multiplies the limit; 0 allows no change."
        ),
    ] = None
    seed: Annotated[int, expert(help="Seed of the random start of slsqp.")] = 1

    others: Annotated[
        Videos | None, asked("--with", metavar="VIDEO", help="Another clip that shares the budget.")
    ] = None
    start: Annotated[
        File | None,
        expert(help="Earlier result to start from (track.csv or its folder), of another edit, say."),
    ] = None
    robust: Annotated[
        bool,
        asked(
            "--robust",
            help="Minimize the worst result among several measures of loss (--measures, docs/requests.md). "
            "Not together with --curves, --with, --device, --start, --contrast-model or --objective.",
        ),
    ] = False
    measures: Annotated[
        Names | None,
        expert(
            metavar="NAME,NAME",
            help=f"Measures for --robust, separated by commas: {', '.join(MEASURES)}.",
            show_default=",".join(ROBUST),
        ),
    ] = None

    def check(self) -> None:
        """Refuse, in one line, what is out of its range, what is not there, what does not go together."""
        super().check()
        self.check_analysis()
        self._check_kinds()
        given = {
            "curves": self.curves,
            "others": self.others,
            "device": choice("device", self.device, Device) is not Device.CPU,
            "start": self.start,
            "contrast_model": not isinstance(self.contrast_model, str) or self.contrast_model != "default",
            "objective": choice("objective", self.objective, ObjectiveName) is not ObjectiveName.SPREAD,
        }
        refused = ", ".join(f"`{name}`" for name, is_given in given.items() if is_given)
        if self.robust_measures and refused:
            raise ArgumentError("robust", f"analyses one video by each measure; leave out {refused}")
        whole("seed", self.seed)
        for name, expected in EXPECTED_FILES.items():
            file = getattr(self, name)
            if file is not None and not Path(file).exists():
                raise ArgumentError(name, f"{file}: no such file; give {expected}")
        solver = choice("solver", self.solver, SolverName)
        if self.start is not None and solver is not SolverName.SPLITTING:
            raise ArgumentError("start", f"is for `solver` splitting; {solver.value} starts on its own")

    def _check_kinds(self) -> None:
        """Refuse what only a program can give: files that are no names, one video for several."""
        for name in ("curves", *EXPECTED_FILES):
            if (value := getattr(self, name)) is not None:
                path(name, value)
        if isinstance(self.others, str | PathLike) or not isinstance(self.others, Sequence | None):
            raise ArgumentError("others", f"must be a list of videos, got {self.others!r}")

    @property
    def robust_measures(self) -> tuple[str, ...]:
        """The measures of a robust track, none if it is not one."""
        if self.measures is not None and not self.robust:
            raise ArgumentError("measures", f"{self.measures} is for `robust`, which is missing")
        if not self.robust:
            return ()
        if self.measures is None:
            return ROBUST
        return measures_named(names_in(self.measures))

    def posed(self, known: LossCurves | None = None) -> tuple[Display, Request]:
        """Return the display and the request, read from their files, without a look at the video.

        Raises
        ------
        InputError
            If one cannot be used, or no video could meet the budget.
        """
        from evenlight.data_schema.tracks.brightness_track import read_sections
        from evenlight.method.optimizer.objective import objective_named
        from evenlight.method.optimizer.request import require_possible
        from evenlight.method.preset_files import whole_device

        display = self.shown_on(self.curves) if known is None else whole_device(known.display)
        weights, allowances = self.weights, self.allowances
        request = replace(
            self.within(self.budget, self.budget_unit, display),
            weights=() if weights is None else read_sections(Path(weights), "weight"),
            allowances=() if allowances is None else read_sections(Path(allowances), "allowance"),
            minimized=objective_named(choice("objective", self.objective, ObjectiveName), self.level_weight),
        )
        require_possible(request, self.min_factor)
        return display, request

    def source(self, video: Any, argument: str = "video") -> VideoSource:
        """Return a video, read as is asked."""
        from evenlight.stimuli.video.frames_in_memory import video_of

        return video_of(video, self.fps, argument, self.damaged, self.stream)

    def job(self, source: VideoSource, display: Display, request: Request) -> OptimizationJob:
        """Return the job for a video; `display` and `request` are what `posed` has returned."""
        model, name = self.model(self.robust_measures)
        return replace(
            super().job(source, display, request),
            model=model,
            model_name=name,
            solver=choice("solver", self.solver, SolverName),
            seed=self.seed,
            calm=self.calm,
            robust=self.robust_measures,
            others=tuple(self.source(other, "each of others") for other in self.others or ()),
            effort=AnalysisEffort(self.jobs, Device(self.device)),
            curves=path_of(self.curves),
            weights=path_of(self.weights),
            allowances=path_of(self.allowances),
            start=path_of(self.start),
        )


@dataclass(frozen=True, kw_only=True)
class OneVideo:
    """The video of a command, where its results go, and whether it tells of it."""

    video: VideoArgument
    out: Annotated[Path, output(help="Folder for track.csv, summary.json, track.png, player.html and more.")]
    force: ForceOption = False
    quiet: QuietOption = False

    def __post_init__(self) -> None:
        if not self.video:
            raise InputError(
                "the video has an empty name; give a file, a folder of images or a built-in sequence"
            )


def closing_words(limit: RateLimit, display: Display, out: Path) -> str:
    """Return whether a rate limit was fitted on another display, where the results are, what to open."""
    borrowed = f"rate limit borrowed: fitted on {limit.display_name!r}, unproven on {display.name!r}\n"
    pages = sorted(out.glob("player.html")) or sorted(out.glob("[0-9]*-*/player.html"))  # of clips
    show = "and its like show" if len(pages) > 1 else "shows"
    shown = f"; {pages[0]} {show} them in a browser" if pages else ""
    return f"{'' if limit.holds_for(display) else borrowed}results in {out}{shown}"
