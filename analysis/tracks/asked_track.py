"""What is asked of the optimizer for one video, in the words of a command or a table: names and files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from evenlight.analysis.tracks.optimization_job import OptimizationJob
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.track_sections import AllowanceSection, WeightSection
from evenlight.method.choices import (
    DEFAULT_CALM,
    AnalysisEffort,
    Device,
    LimitCurve,
    ModulatedLuminance,
    ObjectiveName,
    SolverName,
)
from evenlight.method.contrast.measures import measure_named
from evenlight.method.optimizer.objective import objective_named
from evenlight.method.optimizer.request import Request, require_possible
from evenlight.method.preset_files import (
    display_for,
    load_contrast_model,
    load_power_model,
    load_rate_limit,
    usable_limit,
)
from evenlight.stimuli.video.video_source import VideoSource


@dataclass(frozen=True, slots=True)
class AskedTrack:
    """The options of `evenlight optimize` that say what is wanted of a video, by their names there."""

    budget: float
    budget_unit: BudgetUnit = BudgetUnit.FACTOR
    display: str | None = None
    power_model: str = "surace2025"
    rate_limit: str = "surace2025"
    contrast_model: str = "default"
    solver: SolverName = SolverName.SPLITTING
    limit_curve: LimitCurve = LimitCurve.FITTED
    modulated: ModulatedLuminance = ModulatedLuminance.FRAME_MEAN
    min_factor: float = 0.2
    field_of_view: float | None = None
    actuator: Actuator = Actuator.BACKLIGHT
    fps: float | None = None
    curves: Path | None = None
    tolerance: float = 0.001
    weights: Path | None = None
    allowances: Path | None = None
    calm: float = DEFAULT_CALM
    objective: ObjectiveName = ObjectiveName.SPREAD
    level_weight: float | None = None
    other_display_ok: bool = False
    accept_wide_band: bool = False
    battery_wh: float | None = None
    seed: int = 1
    no_cache: bool = False
    no_player: bool = False

    def posed(self) -> tuple[Display, Request]:
        """Return the display and the request, read from their files, without a look at the video.

        Raises
        ------
        InputError
            If one cannot be used, or no video could meet the budget.
        """
        limit = load_rate_limit(self.rate_limit)
        display = display_for(limit, self.display, self.curves)
        limit = usable_limit(limit, display, self.other_display_ok, self.accept_wide_band)
        request = Request(
            self.budget, self.budget_unit, load_power_model(self.power_model), limit, self.limit_curve,
            self.modulated,
            weights=() if self.weights is None else tuple(read_rows(WeightSection, self.weights)),
            allowances=() if self.allowances is None else tuple(read_rows(AllowanceSection, self.allowances)),
            minimized=objective_named(self.objective, self.level_weight),
            battery=self.battery_wh,
        )  # fmt: skip
        require_possible(request, self.min_factor)
        return display, request

    def model(self, robust: Sequence[str] = ()) -> tuple[ContrastModel, str]:
        """Return the contrast model and its name: the first of several measures, if there are to be any."""
        if robust:
            return measure_named(robust[0]), robust[0]
        return load_contrast_model(self.contrast_model), self.contrast_model

    def job(
        self,
        source: VideoSource,
        posed: tuple[Display, Request],
        others: Sequence[VideoSource] = (),
        *,
        start: Path | None = None,
        robust: tuple[str, ...] = (),
        jobs: int = 1,
        device: Device = Device.CPU,
        quiet: bool = False,
    ) -> OptimizationJob:
        """Return the job for a video.

        Parameters
        ----------
        source, posed : VideoSource, (Display, Request)
            The video, and what `posed` has returned.
        others, start, robust : sequence of VideoSource, Path or None, tuple of str
            As in `OptimizationJob`.
        jobs, device, quiet : int, Device, bool
            How many frames are analysed at a time, on what; whether to show no progress.
        """
        display, request = posed
        model, model_name = self.model(robust)
        return OptimizationJob(
            source=source,
            display=display,
            request=request,
            model=model,
            model_name=model_name,
            solver=self.solver,
            seed=self.seed,
            min_factor=self.min_factor,
            calm=self.calm,
            field_of_view=self.field_of_view,
            actuator=self.actuator,
            curves=self.curves,
            others=tuple(others),
            weights=self.weights,
            allowances=self.allowances,
            start=start,
            effort=AnalysisEffort(self.tolerance, jobs, device),
            cached=not self.no_cache,
            player=not self.no_player,
            robust=robust,
            quiet=quiet,
        )
