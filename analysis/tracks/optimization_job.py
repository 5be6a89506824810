"""What is asked of the optimizer or the controller: the job, its video's loss curves, earlier tracks."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import monotonic

import numpy as np

from evenlight.analysis.tracks.curves_cache import CurvesCache, cache_of
from evenlight.analysis.tracks.frame_samples import FrameSamples
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import Provenance, provenance_now, sha256_of_bytes
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import TrackHeader, read_track
from evenlight.data_schema.tracks.loss_curves import LossCurves, read_loss_curves
from evenlight.method.choices import ONE_CORE, AnalysisEffort, SolverName
from evenlight.method.contrast.checkpoints import AnalysedFrames, Checkpoints
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.contrast.measures import MEASURES, measure_named
from evenlight.method.optimizer.request import Request
from evenlight.progress import counted, shown_progress
from evenlight.stimuli.scenes.content.catalogue import files_sha256
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.video.video_analysis import VideoAnalysis
from evenlight.stimuli.video.video_source import (
    VideoSource,
    closing_frames,
    field_of_view_of,
    film_reading,
    frames_at,
    frames_from,
)
from evenlight.stimuli.video.viewing_geometry import ViewingGeometry, geometry_words, seen_video

TRACK = "track.csv"
FrameWatcher = Callable[[Iterable[Frame]], Iterable[Frame]]  # sees the frames of a video, and yields them


@dataclass(frozen=True, slots=True)
class OptimizationJob:
    """What is asked of the optimizer: a video on a display, a budget, and how to go about it.

    Fields without a remark are as the options of these names of `evenlight optimize`.
    """

    source: VideoSource
    display: Display
    request: Request  # budget, power model and rate limit
    model: ContrastModel = DEFAULT_MODEL
    model_name: str = "default"
    solver: SolverName = SolverName.SPLITTING
    seed: int = 1
    min_factor: float = 0.2
    calm: float = 0.0
    field_of_view: float | None = None  # None: that which the video was rendered for, else full screen
    actuator: Actuator = Actuator.BACKLIGHT
    curves: Path | None = None
    effort: AnalysisEffort = ONE_CORE
    others: tuple[VideoSource, ...] = ()  # clips that share the budget
    weights: Path | None = None  # files of the sections that the request has
    allowances: Path | None = None
    start: Path | None = None  # an earlier track or its folder; of several clips, the folder of theirs
    # whether curves are looked for in the user's cache, and kept there; not with `watch`
    cached: bool = False
    robust: tuple[str, ...] = ()  # measures (`method.contrast.measures`), the first `model`'s
    player: bool = False
    price: bool = False  # whether the price of invisibility is drawn, too; not of a robust track
    quiet: bool = False
    watch: FrameWatcher = lambda frames: frames  # sees each frame as it is analysed

    @property
    def seen_at(self) -> float | None:
        """Degrees that the video's width spans, as asked or as it was rendered for; None: full screen."""
        return field_of_view_of(self.source) if self.field_of_view is None else self.field_of_view

    @property
    def analysis_name(self) -> str:
        """What the analysis is called in messages: the video, and the measure where it was asked for."""
        return f"{self.source.name}, {self.model_name}" if self.model_name in MEASURES else self.source.name


class AnalysedVideo:
    """The video of loss curves, whose frames are not at hand."""

    reading = None

    def __init__(self, curves: LossCurves) -> None:
        self.curves, self.name, self.n_frames = curves, curves.video, curves.n_frames

    def frames(self) -> Iterator[Frame]:
        """Yield no frame."""
        return iter(())

    def sha256(self) -> str:
        """Return the SHA-256 of the video that was analysed."""
        return self.curves.provenance.inputs.get("video", "unknown")


def loss_curves_of(
    job: OptimizationJob, samples: FrameSamples, watcher: FrameWatcher | None = None
) -> LossCurves:
    """Return the loss curves of a job's video; some of its frames are kept in `samples`.

    A watcher sees the frames as the video has them, where all of them are analysed.

    Raises
    ------
    InputError
        If the curves of an earlier run are given, and are of another video, display or model.
    """
    source = job.source
    for note in getattr(source, "notes", ()):
        _say(job, f"{source.name}: {note}")
    words = f"analysing {job.analysis_name}"
    with shown_progress(job.quiet) as progress:
        with closing_frames(counted(progress, source.frames(), words, source.n_frames)) as frames:
            first = next(frames, None)
            if first is None:
                raise InputError(f"{source.name}: holds no frame; at least one is needed")
            every = itertools.chain([first], frames)
            shown, geometry = seen_video(every, job.display, job.seen_at, source.name)
            _say_geometry(job, geometry)
            work = _CurvesWork(job, first, geometry)
            if work.known is None and work.begun is None:
                if watcher is not None:
                    shown = geometry.shown(watcher(itertools.chain([first], frames)))
                return work.analysed(samples.watch(job.watch(shown), source.n_frames))
            seen = next(iter(shown))
        if work.begun is not None:
            done, total = work.begun.n_frames, source.n_frames
            _say(job, f"{job.analysis_name}: goes on with frame {done}, where a run was interrupted")
            rest: Iterable[Frame] = counted(
                progress, frames_from(source, done), words, None if total is None else total - done
            )
            work.known = work.analysed(geometry.shown(rest))
        assert work.known is not None
        samples.take(seen, lambda wanted: geometry.shown(frames_at(source, wanted)), work.known.n_frames)
        return replace(work.known, video=source.name, field_of_view=geometry.field_of_view)


class _CurvesWork:
    """The analysis of a job's video: what is known of its loss curves beforehand, and what makes them."""

    def __init__(self, job: OptimizationJob, first: Frame, geometry: ViewingGeometry) -> None:
        self._job, self._geometry = job, geometry
        self._cache: CurvesCache | None = None
        self.known: LossCurves | None = None
        self.begun: AnalysedFrames | None = None
        if job.curves is not None:
            self.known = read_loss_curves(job.curves)
            _require_same_source(job, self.known, geometry)
            return
        knots = brightness_factors(job.min_factor)
        self._analysis = VideoAnalysis(job.model, knots, job.actuator, _provenance(job), job.effort)
        if job.cached:
            self._cache = cache_of(self._analysis, job.source, first, geometry, partial(_say, job))
        if self._cache is not None:
            self.known = self._cache.read()
            if self.known is not None:
                _say(job, f"{job.analysis_name}: loss curves of an earlier run (--no-cache makes them again)")
            else:
                self.begun = self._cache.begun()

    def analysed(self, frames: Iterable[Frame]) -> LossCurves:
        """Return the curves, of the frames that are not analysed yet, and keep them for later runs."""
        checkpoints = None if self._cache is None else Checkpoints(self._cache.keep, monotonic, self.begun)
        curves = self._analysis.curves(frames, self._geometry, self._job.source.name, checkpoints)
        if self._cache is not None:
            self._cache.store(curves)
        return curves


def _require_same_source(job: OptimizationJob, curves: LossCurves, geometry: ViewingGeometry) -> None:
    inputs, lowest = curves.provenance.inputs, curves.factors[0]
    made, asked = curves.display, geometry.display
    why = ""
    if inputs.get("video") != job.source.sha256():
        why = f"made of another video than {job.source.name}"
    elif lowest != brightness_factors(job.min_factor)[0]:
        why = f"made for factors from {lowest:g}, asked is a lowest factor of {job.min_factor:g}"
    elif inputs.get("contrast_model") != sha256_of_record(job.model):
        why = "made with another contrast model than the one asked for"
    elif curves.actuator is not job.actuator:
        why = f"of a video dimmed by {curves.actuator.value}, asked is `actuator` {job.actuator.value}"
    elif (made.fingerprint, made.pixels_per_degree) != (asked.fingerprint, asked.pixels_per_degree):
        at = geometry_words(curves.field_of_view, made.pixels_per_degree)
        why = (
            f"made for {made.name!r} {at}, asked is {asked.name!r} {geometry}; leave out `display` and "
            "`field_of_view`, or give the same again"
        )
    if why:
        raise InputError(f"the curves {job.curves}: {why}")


def _say_geometry(job: OptimizationJob, geometry: ViewingGeometry) -> None:
    averaged = ""
    if geometry.shown_size != geometry.size:
        width, height = geometry.shown_size
        averaged = f", averaged to the {width} x {height} pixels that {job.display.name!r} shows"
    _say(job, f"{job.analysis_name}: analysed {geometry}{averaged}")


def _say(job: OptimizationJob, words: str) -> None:
    if not job.quiet:
        print(words, file=sys.stderr)


def track_header(job: OptimizationJob, curves: LossCurves, clips: Sequence[LossCurves]) -> TrackHeader:
    """Return what a track was made for: of a video with loss curves, or of all clips that share a budget."""
    request, display = job.request, job.display
    return TrackHeader(
        video=curves.video,
        display_name=display.name,
        display_fingerprint=display.fingerprint,
        power_model=None if request.power_model is None else request.power_model.name,
        rate_limit=request.rate_limit.name,
        budget=request.budget,
        budget_unit=request.budget_unit,
        solver=job.solver.value,
        provenance=_provenance(job, clips),
        rate_limit_procedure=request.rate_limit.procedure,
        pixels_per_degree=curves.display.pixels_per_degree,
        field_of_view=curves.field_of_view,
        wide_band_accepted=bool(request.limit.wide_band),
        actuator=curves.actuator,
        display=display,
        panel=request.power_model,
        noticed=request.noticed,
        film=film_reading(job.source),
    )


def _provenance(job: OptimizationJob, clips: Sequence[LossCurves] = ()) -> Provenance:
    """Return where a job's results come from; the seed where the solver draws random numbers."""
    analysed = clips[0].provenance.inputs.get("video") if clips else None
    inputs = {"video": analysed or job.source.sha256(), "display": sha256_of_record(job.display)}
    if isinstance(job.source, SceneSequence):
        inputs["path"] = files_sha256(job.source.path())
    for number, clip in enumerate(clips[1:], start=2):
        inputs[f"video_{number}"] = clip.provenance.inputs["video"]
    inputs["contrast_model"] = sha256_of_record(job.model)
    inputs |= {f"measure_{name}": sha256_of_record(measure_named(name)) for name in job.robust[1:]}
    if not clips:
        return provenance_now(inputs=inputs)
    if job.request.power_model is not None:
        inputs["power_model"] = sha256_of_record(job.request.power_model)
    inputs["rate_limit"] = sha256_of_record(job.request.rate_limit)
    files = {"weights": job.weights, "allowances": job.allowances}
    inputs |= {name: sha256_of_bytes(path.read_bytes()) for name, path in files.items() if path is not None}
    if job.start is not None:
        earlier = [path.read_bytes() for path in track_files(job.start)]
        inputs["start"] = sha256_of_bytes(b"".join(earlier))
    return provenance_now(job.seed if job.solver is SolverName.SLSQP else None, inputs)


def clip_folder(number: int, video: str) -> str:
    """Return the name of the folder of a clip that shares its budget, from 1 on.

    >>> clip_folder(2, "films/b.mkv")
    '02-b'
    """
    return f"{number:02d}-{Path(video).stem}"


def track_files(path: Path) -> tuple[Path, ...]:
    """Return the tables of an earlier result: of one video, or of clips that share a budget, in order.

    The path is a table, its folder, or the folder of the clips' folders; `InputError` if it holds neither.
    """
    if not path.is_dir():
        return (path,)
    if (path / TRACK).is_file():
        return (path / TRACK,)
    clips = {file: file.parent.name.partition("-")[0] for file in path.glob(f"[0-9]*-*/{TRACK}")}
    if not clips:
        raise InputError(
            f"the start {path}: expected a folder with {TRACK}, or with the folders 01-NAME, 02-NAME, ... of "
            f"several clips, got neither"
        )
    return tuple(sorted(clips, key=lambda file: (int(clips[file]), file)))


def start_factors(path: Path, clips: Sequence[LossCurves]) -> Array:
    """Return the factors of earlier tracks at each frame's time, clip by clip, (N,).

    `InputError` if there is not one track for each clip, or one cannot be used.
    """
    files = track_files(path)
    if len(files) != len(clips):
        held = "1 track" if len(files) == 1 else f"{len(files)} tracks"
        asked = "1 video" if len(clips) == 1 else f"{len(clips)} clips"
        raise InputError(
            f"the start {path}: holds {held}, asked is an optimization of {asked}; "
            "give one with a track for each clip, in the same order"
        )
    pairs = zip(clips, map(read_track, files), strict=True)
    return np.concatenate([np.interp(clip.times, track.times, track.factors) for clip, track in pairs])
