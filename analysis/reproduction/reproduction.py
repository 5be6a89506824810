"""The paper's results, reproduced: the whole loop, up to what tables and figures are made of."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.dataset_findings import AnalysisOptions, DatasetFindings, find_in_dataset
from evenlight.analysis.figure_style import ASKED, FiguresAsked, figures_like
from evenlight.analysis.reproduction.adaptation import Dimming, LuminanceMaps, unconstrained_factors
from evenlight.analysis.session_loading import undamaged_roll
from evenlight.analysis.tracks.frame_samples import FrameSamples, Image, thumbnails_of
from evenlight.analysis.tracks.optimization_job import OptimizationJob, loss_curves_of
from evenlight.analysis.tracks.track_results import run_optimization
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import require_seed
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, BudgetUnit, read_track
from evenlight.data_schema.tracks.loss_curves import LossCurves, read_loss_curves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.experiments.simulate_command import simulate
from evenlight.method.contrast.curve_lookup import loss_at
from evenlight.method.one_blas_thread import one_blas_thread
from evenlight.method.optimizer.optimize import pose
from evenlight.method.optimizer.request import Request
from evenlight.method.preset_files import load_display, load_power_model, load_rate_limit
from evenlight.stimuli.scenes.engine.antialiasing import LIVE
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.sequence_format import BuiltInSequence
from evenlight.stimuli.sequences import built_in_sequence
from evenlight.stimuli.video.video_source import VideoSource

# The four sequences and their mean brightness factors (Section 4, "Stimuli", and Table 2).
BUDGETS = {"library": 0.5, "gym": 0.4, "living_room": 0.7, "basement": 0.3}
EXAMPLES = {"checkerboard": 0.5, "sunrise": 0.4}  # the paper's two examples; it prints no budget
WALK = "house"  # the online walk of about three minutes (Section 6)
PUBLISHED_LIMIT = "surace2025"
VIEWING_TASKS = ("rating", "comparison", "search")
PIPELINE = "pipeline"  # folder of what the pipeline makes on its way
STIMULI, DATA, CALIBRATION = "stimuli", "data", "calibration"
Mapped = Callable[..., Iterable[Any]]  # `map`, or one that shares the work among processes, in order


@dataclass(frozen=True, slots=True)
class ReproductionPlan:
    """How much is done."""

    seed: int = 1  # of all random numbers
    viewers: int = 17  # simulated participants of the viewing experiments: as many as in the paper
    calibrators: int = 10  # those of the calibration
    size: tuple[int, int] = (960, 540)  # of the frames [pixels]: docs/decisions/what-agreement-shows.md
    frames_per_second: float = 12.5  # of the sequences [Hz]
    walk_frames_per_second: float = 5.0  # of the walk with the online controller [Hz]
    data: Path | None = None  # recorded data, which take the place of simulated ones task by task
    display: str = "varjo-xr3"  # name or file, where no recorded calibration says which it is
    quick: bool = False  # less than a reproduction takes, only to see that it runs

    def __post_init__(self) -> None:
        require_seed(self.seed)
        load_display(self.display)  # refuses what is none before anything is done
        if self.data is not None and not self.data.is_dir():
            raise InputError(
                f"the data {self.data}: no such folder; expected a data set, or a folder of results"
            )

    @property
    def made_quick(self) -> ReproductionPlan:
        """The same with small pictures and few frames."""
        return replace(self, size=(160, 90), frames_per_second=2.0, walk_frames_per_second=2.0, quick=True)

    @property
    def field_of_view(self) -> float:
        """Degrees that the width of the sequences spans: those that they are rendered for."""
        return built_in_sequence(WALK, self.size).field_of_view


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What came of it, part by part."""

    plan: ReproductionPlan
    display: Display
    limit: RateLimit  # what all tracks are made for
    tasks: DatasetFindings  # of the calibration and the three experiments
    sequences: tuple[SequenceTracks, ...]  # the four
    examples: tuple[SequenceTracks, ...]  # checkerboard and sunrise
    walk: LossCurves  # of the walk through the house


def run_pipeline(
    plan: ReproductionPlan,
    folder: Path,
    report: Callable[[str], None] = lambda step: None,
    mapped: Mapped = map,
) -> Reproduction:
    """Calibrate, optimize, show and ask: the whole loop, up to the data that tables and figures are made of.

    Parameters
    ----------
    plan : ReproductionPlan
        How much is done.
    folder : Path
        Where data sets, calibration and tracks go; every process that shares the work must see it.
    report : callable, optional
        Called with each step that is begun, numbered; the last step, tables and figures, is not done here.
    mapped : callable, optional
        Does what is independent: tracks, the walk.
    """
    folder = folder.absolute()
    roll = undamaged_roll(plan.data) if plan.data else None
    recorded = roll.tasks if roll else ()
    numbers = count(1)
    steps = 3 + len(BUDGETS) + len(EXAMPLES) + len(VIEWING_TASKS)  # calibration, walk, tables and figures

    def begin(step: str) -> None:
        report(f"step {next(numbers)} of {steps}, {step}")

    begin("calibration")
    tasks = replace(_analysed(plan, folder, "ramp", recorded), roll=roll)
    limit = load_rate_limit(str(folder / CALIBRATION / "rate_limit.json"))
    display = _display(plan, limit)
    made = iter(mapped(partial(_done, ASKED.get(), folder), _works(plan, display, limit, folder)))
    tracks = {}
    for name in BUDGETS | EXAMPLES:
        begin(f"track of {name.replace('_', ' ')}")
        tracks[name] = next(made)
    begin(f"walk through the {WALK}")
    walk = next(made)
    for task in VIEWING_TASKS:
        begin(task)
        more = _analysed(plan, folder, task, recorded)
        for field in ("findings", "refused", "simulated", "inputs", "participants"):
            getattr(tasks, field).update(getattr(more, field))
    sequences, examples = (tuple(tracks[name] for name in names) for names in (BUDGETS, EXAMPLES))
    return Reproduction(plan, display, limit, tasks, sequences, examples, walk)


def _works(
    plan: ReproductionPlan, display: Display, limit: RateLimit, folder: Path
) -> Iterator[Callable[[], Any]]:
    """Yield what rests on the calibration alone: tracks, and the curves of the walk."""
    for name, budget in (BUDGETS | EXAMPLES).items():
        source = _rendered(name, plan.size, plan.frames_per_second)
        yield partial(_track_sequence, _job(source, budget, display, limit), folder / STIMULI / name)
    house = _rendered(WALK, plan.size, plan.walk_frames_per_second)
    yield partial(loss_curves_of, _job(house, BUDGETS["library"], display, limit), FrameSamples())


@one_blas_thread
def _done(asked: FiguresAsked, folder: Path, work: Callable[[], Any]) -> Any:
    """Do a piece of work, in whatever process: figures are as here, files go to the same folder."""
    if not folder.is_dir():
        raise InputError(f"a worker does not see {folder}; `out` must be a folder that all workers share")
    with figures_like(asked):
        return work()


def _analysed(plan: ReproductionPlan, folder: Path, task: str, recorded: tuple[str, ...]) -> DatasetFindings:
    """Return the findings of a task: of recorded sessions if there are any, else of simulated ones."""
    options = AnalysisOptions(plan.seed, tasks=(task,), compared=load_rate_limit(PUBLISHED_LIMIT))
    if plan.data is not None and task in recorded:
        return find_in_dataset(plan.data, options, folder / CALIBRATION)
    dataset = folder / DATA / task
    ramp = task == "ramp"
    people = plan.calibrators if ramp else plan.viewers
    stimuli = None if ramp else folder / STIMULI
    simulate(task, dataset, people, plan.seed, plan.display, stimuli=stimuli, quiet=True)
    return find_in_dataset(dataset, options, folder / CALIBRATION)


def _display(plan: ReproductionPlan, limit: RateLimit) -> Display:
    display = load_display(plan.display)
    if not limit.holds_for(display):
        raise InputError(
            f"the recorded calibration ran on the display {limit.display_name!r}, not on {display.name!r}; "
            "name that display, or give its file"
        )
    return display


def _rendered(name: str, size: tuple[int, int], frames_per_second: float) -> BuiltInSequence:
    """Return a built-in sequence; walks have as few samples as live pictures, for a sixth of the time."""
    source = built_in_sequence(name, size, frames_per_second=frames_per_second)
    return replace(source, antialiasing=LIVE) if isinstance(source, SceneSequence) else source


@dataclass(frozen=True, slots=True)
class SequenceTracks:
    """A sequence, and how its brightness may move."""

    name: str
    budget: float  # mean brightness factor
    track: BrightnessTrack  # within the rate limit
    summary: OptimizationSummary  # what it achieves
    curves: LossCurves
    maps: LuminanceMaps  # its luminance at low resolution
    unconstrained: Array  # factors of the track without a rate limit, (N,)
    baseline_factor: float  # of constant dimming at equal power
    unconstrained_objective: float  # mean absolute difference of loss between two frames, without a limit
    baseline_loss: Array  # contrast loss of each frame under constant dimming at equal power, (N,)
    samples: tuple[tuple[int, NDArray[np.uint8]], ...]  # some frames, with their index

    @property
    def dimmings(self) -> dict[Dimming, Array]:
        """Factors of each way to dim it, (N,)."""
        constant = np.full(len(self.unconstrained), self.baseline_factor)
        return dict(zip(Dimming, (constant, self.track.factors, self.unconstrained), strict=True))

    @property
    def gain(self) -> float:
        """By how much less contrast loss differs between frames than with constant dimming [%]."""
        return 100 * (1 - self.summary.objective / self.summary.objective_baseline)

    @property
    def saved(self) -> float:
        """Power saved, of full brightness, by the power model [%]."""
        mean, full = self.summary.mean_power, self.summary.full_power
        assert mean is not None  # the paper's power model is given
        assert full is not None
        return 100 * (1 - mean / full)

    @property
    def thumbnails(self) -> tuple[tuple[int, Image], ...]:
        """Six small pictures, evenly spread."""
        return thumbnails_of(self.samples, count=6)


def _job(source: VideoSource, budget: float, display: Display, limit: RateLimit) -> OptimizationJob:
    """Return what is asked of the optimizer; calm is 0: the problem is the paper's, and so is its optimum."""
    request = Request(budget, BudgetUnit.FACTOR, load_power_model(PUBLISHED_LIMIT), limit)
    return OptimizationJob(source, display, request, calm=0.0, quiet=True)


def _track_sequence(job: OptimizationJob, folder: Path) -> SequenceTracks:
    """Optimize a sequence, with the rate limit and without, and write its track into a folder."""
    maps, samples = LuminanceMaps(job.display), FrameSamples()

    def watch(frames: Iterable[Frame]) -> Iterator[Frame]:
        return samples.watch(maps.watch(frames))

    summary = run_optimization(replace(job, watch=watch), folder)
    curves = read_loss_curves(folder / "loss_curves.npz")
    problem = pose(curves, job.request)
    free = unconstrained_factors(problem)
    return SequenceTracks(
        name=job.source.name,
        budget=job.request.budget,
        track=read_track(folder / "track.csv"),
        summary=summary,
        curves=curves,
        maps=maps,
        unconstrained=free,
        baseline_factor=float(problem.baseline()[0]),
        unconstrained_objective=problem.objective(free),
        baseline_loss=loss_at(curves, problem.baseline()),
        samples=tuple(samples.held),
    )
