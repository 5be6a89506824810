"""The paper's results, reproduced: the whole loop, up to what tables and figures are made of."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.dataset_findings import AnalysisOptions, DatasetFindings, find_in_dataset
from evenlight.analysis.figure_style import QUICK_MARK, marked_figures
from evenlight.analysis.reproduction.adaptation_lag import AdaptationInput, LuminanceMaps, adaptation_input
from evenlight.analysis.reproduction.repeated_sets import RepeatedEffect, ViewingRepeater, repeated_effects
from evenlight.analysis.session_loading import undamaged_roll
from evenlight.analysis.tracks.frame_samples import FrameSamples, Image, thumbnails_of
from evenlight.analysis.tracks.optimization_job import OptimizationJob, loss_curves_of
from evenlight.analysis.tracks.track_results import run_optimization
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.provenance import require_seed
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, BudgetUnit, read_track
from evenlight.data_schema.tracks.loss_curves import LossCurves, read_loss_curves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.choices import SolverName
from evenlight.method.one_blas_thread import one_blas_thread
from evenlight.method.optimizer.optimize import pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.solvers import make_solver
from evenlight.method.preset_files import load_display, load_power_model, load_rate_limit
from evenlight.stimuli.scenes.engine.antialiasing import LIVE
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.sequences import BuiltInSequence, built_in_sequence
from evenlight.stimuli.video.video_source import VideoSource
from evenlight.stimuli.video.viewing_geometry import field_of_view_on

# The four sequences and their mean brightness factors (Section 4, "Stimuli", and Table 2).
BUDGETS = {"library": 0.5, "gym": 0.4, "living_room": 0.7, "basement": 0.3}
EXAMPLES = {"checkerboard": 0.5, "sunrise": 0.4}  # the paper's two examples; it prints no budget
WALK = "house"  # the online walk of about three minutes (Section 6)
PUBLISHED_LIMIT = "surace2025"
VIEWING_TASKS = ("rating", "comparison", "search")
PIPELINE = "pipeline"  # folder of what the pipeline makes on its way
STIMULI, DATA, CALIBRATION = "stimuli", "data", "calibration"
STEPS = 3 + len(BUDGETS) + len(EXAMPLES) + len(VIEWING_TASKS)  # the calibration, the walk, tables and figures
PICTURES = "stimuli_as_picture"  # the tracks of the same sequences as a small picture
Mapped = Callable[..., Iterable[Any]]  # `map`, or one that shares the work among processes, in order


class DatasetSimulator(Protocol):
    """Who writes the data sets of simulated participants."""

    def __call__(
        self, task: str, out: Path, people: tuple[int, int], display: str, stimuli: Path | None
    ) -> None:
        """Write a data set of a task.

        Parameters
        ----------
        task, out : str, Path
            Which experiment, and where to.
        people : (int, int)
            How many, and the seed.
        display : str
            Name or file of the display that they look at.
        stimuli : Path or None
            A folder with a track per sequence for a viewing experiment.
        """


@dataclass(frozen=True, slots=True)
class ReproductionPlan:
    """How much is done.

    Attributes
    ----------
    seed : int
        Of all random numbers.
    viewers, calibrators : int
        Simulated participants of the viewing experiments, and of the calibration: as many as in the paper.
    size : (int, int)
        Width and height of the rendered frames [pixels] (docs/decisions/pixels-on-the-visual-field.md).
    frames_per_second, walk_frames_per_second : float
        Of the sequences, and of the walk with the online controller [Hz].
    picture_size, picture_frames_per_second : (int, int), float
        Of the same sequences where they are seen pixel for pixel, as a picture of a few degrees.
    sets : int
        Simulated data sets of each viewing experiment, to show how estimates scatter.
    data : Path or None
        Recorded data, which take the place of simulated ones task by task.
    display : str
        Name or file of the display, where no recorded calibration says which it is.
    quick : bool
        Whether it is less than a reproduction takes, only to see that it runs.
    """

    seed: int = 1
    viewers: int = 17
    calibrators: int = 10
    size: tuple[int, int] = (960, 540)
    frames_per_second: float = 12.5
    walk_frames_per_second: float = 5.0
    picture_size: tuple[int, int] = (640, 360)
    picture_frames_per_second: float = 2.5
    sets: int = 200
    data: Path | None = None
    display: str = "varjo-xr3"
    quick: bool = False

    def __post_init__(self) -> None:
        require_seed(self.seed)
        load_display(self.display)  # refuses what is none before anything is done
        if self.data is not None and not self.data.is_dir():
            raise InputError(
                f"the data {self.data}: no such folder; expected a data set, or a folder of results"
            )

    @property
    def field_of_view(self) -> float:
        """Degrees that the width of the sequences spans: those that they are rendered for."""
        return built_in_sequence(WALK, self.size).field_of_view


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What came of it, part by part.

    Attributes
    ----------
    plan, panel : ReproductionPlan, Panel
        What was asked; display, power model and rate limit of all tracks.
    tasks : DatasetFindings
        Of the calibration and the three experiments.
    sequences, examples : tuple of SequenceTracks
        The four sequences; checkerboard and sunrise.
    walk : LossCurves
        Of the walk through the house.
    effects : tuple of RepeatedEffect
        What simulated viewers are assumed to show, and what many simulated data sets do.
    """

    plan: ReproductionPlan
    panel: Panel
    tasks: DatasetFindings
    sequences: tuple[SequenceTracks, ...]
    examples: tuple[SequenceTracks, ...]
    walk: LossCurves
    effects: tuple[RepeatedEffect, ...] = ()


def run_pipeline(
    plan: ReproductionPlan,
    simulators: tuple[DatasetSimulator, ViewingRepeater],
    folder: Path,
    report: Callable[[str], None] = lambda step: None,
    mapped: Mapped = map,
) -> Reproduction:
    """Calibrate, optimize, show and ask: the whole loop, up to the data that tables and figures are made of.

    Parameters
    ----------
    plan, simulators : ReproductionPlan, (DatasetSimulator, ViewingRepeater)
        How much is done; who answers where nothing was recorded, once and many times.
    folder : Path
        Where data sets, calibration and tracks go; every process that shares the work must see it.
    report : callable, optional
        Called with each step that is begun, numbered; the last step, tables and figures, is not done here.
    mapped : callable, optional
        Does what is independent: tracks, the walk, data sets beyond the first.
    """
    folder = folder.absolute()
    roll = undamaged_roll(plan.data) if plan.data else None
    recorded = roll.tasks if roll else ()
    simulate, repeat = simulators
    simulated = tuple(task for task in VIEWING_TASKS if task not in recorded)
    report = _numbered(report, STEPS + (1 + len(simulated) if simulated else 0))
    report("calibration")
    tasks = replace(_analysed(plan, simulate, folder, "ramp", recorded), roll=roll)
    limit = load_rate_limit(str(folder / CALIBRATION / "rate_limit.json"))
    panel = Panel(_display(plan, limit), load_power_model(PUBLISHED_LIMIT), limit)
    made = iter(mapped(partial(_done, plan.quick, folder), _works(plan, panel, folder, bool(simulated))))
    tracks = {}
    for name in BUDGETS | EXAMPLES:
        report(f"track of {name.replace('_', ' ')}")
        tracks[name] = next(made)
    report(f"walk through the {WALK}")
    walk = next(made)
    for task in VIEWING_TASKS:
        report(task)
        _merge(tasks, _analysed(plan, simulate, folder, task, recorded))
    if simulated:
        report("the same sequences as a small picture")
        deque(made, maxlen=0)  # their tracks
    effects = tuple(_effects(plan, repeat, folder, simulated, report, mapped))
    sequences, examples = (tuple(tracks[name] for name in names) for names in (BUDGETS, EXAMPLES))
    return Reproduction(plan, panel, tasks, sequences, examples, walk, effects)


def _numbered(report: Callable[[str], None], steps: int) -> Callable[[str], None]:
    """Return what reports a step with its number, of so many."""
    numbers = count(1)
    return lambda step: report(f"step {next(numbers)} of {steps}, {step}")


def _works(plan: ReproductionPlan, panel: Panel, folder: Path, pictures: bool) -> Iterator[Callable[[], Any]]:
    """Yield what rests on the calibration alone: tracks, the walk, and perhaps tracks of small pictures."""
    for name, budget in (BUDGETS | EXAMPLES).items():
        source = _rendered(name, plan.size, plan.frames_per_second)
        yield partial(_track_sequence, source, budget, panel, folder / STIMULI / name)
    house = _rendered(WALK, plan.size, plan.walk_frames_per_second)
    yield partial(loss_curves_of, _job(house, BUDGETS["library"], panel), FrameSamples())
    degrees = field_of_view_on(panel.display, plan.picture_size[0])
    for name, budget in BUDGETS.items() if pictures else ():
        source = _rendered(name, plan.picture_size, plan.picture_frames_per_second)
        job = replace(_job(source, budget, panel), field_of_view=degrees)
        yield partial(run_optimization, job, folder / PICTURES / name)


@one_blas_thread
def _done(quick: bool, folder: Path, work: Callable[[], Any]) -> Any:
    """Do a piece of work, in whatever process: figures are marked as here, files go to the same folder."""
    if not folder.is_dir():
        raise InputError(f"a worker does not see {folder}; --out must be a folder that all workers share")
    with marked_figures(QUICK_MARK if quick else ""):
        return work()


def _effects(
    plan: ReproductionPlan,
    repeat: ViewingRepeater,
    folder: Path,
    tasks: tuple[str, ...],
    report: Callable[[str], None],
    mapped: Mapped,
) -> Iterator[RepeatedEffect]:
    """Yield what simulated viewers show over many data sets, and would be assumed to of a small picture."""
    asked = [
        partial(repeat, task, folder / stimuli, (plan.viewers, plan.seed), plan.display, sets)
        for task in tasks
        for stimuli, sets in ((STIMULI, plan.sets), (PICTURES, 0))
    ]
    repeated = iter(mapped(partial(_done, plan.quick, folder), asked))
    for task in tasks:
        report(f"{plan.sets} data sets of the {task}")
        (assumed, sets), (of_pictures, _) = next(repeated), next(repeated)
        yield from repeated_effects(task, assumed, sets, of_pictures, mapped)


def _analysed(
    plan: ReproductionPlan, simulate: DatasetSimulator, folder: Path, task: str, recorded: tuple[str, ...]
) -> DatasetFindings:
    """Return the findings of a task: of recorded sessions if there are any, else of simulated ones."""
    options = AnalysisOptions(plan.seed, tasks=(task,), compared=load_rate_limit(PUBLISHED_LIMIT))
    if plan.data is not None and task in recorded:
        return find_in_dataset(plan.data, options, folder / CALIBRATION)
    dataset = folder / DATA / task
    ramp = task == "ramp"
    people = (plan.calibrators if ramp else plan.viewers, plan.seed)
    simulate(task, dataset, people, plan.display, None if ramp else folder / STIMULI)
    return find_in_dataset(dataset, options, folder / CALIBRATION)


def _merge(into: DatasetFindings, more: DatasetFindings) -> None:
    """Add the findings of another task."""
    into.findings.update(more.findings)
    into.refused.update(more.refused)
    into.simulated.update(more.simulated)
    into.inputs.update(more.inputs)
    into.participants.update(more.participants)


def _display(plan: ReproductionPlan, limit: RateLimit) -> Display:
    """Return the display that the rate limit was fitted on.

    Raises
    ------
    InputError
        If it is another one than the plan names.
    """
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
class Panel:
    """What every sequence is optimized for.

    Attributes
    ----------
    display, power_model, rate_limit : Display, PowerModel, RateLimit
        What it is shown on, what the budget is counted with, and how fast brightness may change.
    """

    display: Display
    power_model: PowerModel
    rate_limit: RateLimit


@dataclass(frozen=True, slots=True)
class SequenceTracks:
    """A sequence, and how its brightness may move.

    Attributes
    ----------
    name, budget : str, float
        Of the sequence, and its mean brightness factor.
    track, summary : BrightnessTrack, OptimizationSummary
        Within the rate limit, and what it achieves.
    curves : LossCurves
        Contrast loss of each frame.
    tracks : AdaptationInput
        Its factors, those without a rate limit, those of constant dimming, and luminance at low resolution.
    unconstrained_objective : float
        Mean absolute difference of contrast loss between two frames, without a rate limit.
    baseline_loss : array, (N,)
        Contrast loss of each frame under constant dimming at equal power.
    samples : tuple of (int, array (height, width, 3))
        Some frames, with their index.
    """

    name: str
    budget: float
    track: BrightnessTrack
    summary: OptimizationSummary
    curves: LossCurves
    tracks: AdaptationInput
    unconstrained_objective: float
    baseline_loss: Array
    samples: tuple[tuple[int, NDArray[np.uint8]], ...]

    @property
    def unconstrained(self) -> Array:
        """Factors of the track without a rate limit, (N,)."""
        return self.tracks.unconstrained

    @property
    def baseline_factor(self) -> float:
        """Factor of constant dimming at equal power."""
        return float(self.tracks.constant[0])

    @property
    def thumbnails(self) -> tuple[tuple[int, Image], ...]:
        """Six small pictures, evenly spread."""
        return thumbnails_of(self.samples)


def _job(
    source: VideoSource,
    budget: float,
    panel: Panel,
    watch: Callable[[Iterable[Frame]], Iterable[Frame]] = lambda frames: frames,
) -> OptimizationJob:
    """Return what is asked of the optimizer for a sequence."""
    request = Request(budget, BudgetUnit.FACTOR, panel.power_model, panel.rate_limit)
    # Calm is 0: the problem is the paper's, and so is its optimum.
    return OptimizationJob(source, panel.display, request, calm=0.0, quiet=True, watch=watch)


def _track_sequence(source: VideoSource, budget: float, panel: Panel, folder: Path) -> SequenceTracks:
    """Optimize a sequence, with the rate limit and without, and write its track into a folder."""
    maps, samples = LuminanceMaps(panel.display), FrameSamples()

    def watch(frames: Iterable[Frame]) -> Iterator[Frame]:
        return samples.watch(maps.watch(frames))

    job = _job(source, budget, panel, watch)
    summary = run_optimization(job, folder)
    curves = read_loss_curves(folder / "loss_curves.npz")
    problem = pose(curves, job.request)
    track = read_track(folder / "track.csv")
    solver = make_solver(SolverName.SPLITTING, np.random.default_rng(0))  # which draws nothing
    tracks = adaptation_input(problem, track.factors, maps, solver)
    return SequenceTracks(
        name=source.name,
        budget=budget,
        track=track,
        summary=summary,
        curves=curves,
        tracks=tracks,
        unconstrained_objective=problem.objective(tracks.unconstrained),
        baseline_loss=problem.loss(problem.baseline()),
        samples=tuple(samples.held),
    )
