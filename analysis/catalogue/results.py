"""The work of a catalogue, as tasks for workers: the results of one video, whole or in parts.

Whatever a task did before its worker died is known by its files: it is not done twice. The folder of a
catalogue is on a file system that all workers share.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.catalogue.entries import CURVES, CatalogueVideo
from evenlight.analysis.catalogue.keys import ResultKeys, keys_of
from evenlight.analysis.earlier_results import files_in
from evenlight.analysis.tracks.asked_track import AskedTrack
from evenlight.analysis.tracks.frame_samples import FrameSamples
from evenlight.analysis.tracks.optimization_job import (
    AnalysedVideo,
    OptimizationJob,
    loss_curves_of,
    provenance_of,
)
from evenlight.analysis.tracks.track_results import run_optimization
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.storage.text_files import read_json_record, write_json_record
from evenlight.data_schema.storage.whole_files import whole_folder, write_whole
from evenlight.data_schema.tracks.catalogue import CatalogueResult, CatalogueRow, row_of
from evenlight.data_schema.tracks.loss_curves import (
    UNREADABLE,
    LossCurves,
    read_loss_curves,
    write_loss_curves,
)
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.segments import (
    SeenVideo,
    begins_of,
    curves_of_part,
    joined,
    new_contents,
    parts_of,
)
from evenlight.stimuli.video.video_analysis import VideoAnalysis
from evenlight.stimuli.video.video_file import VideoFile
from evenlight.stimuli.video.video_locations import file_state
from evenlight.stimuli.video.video_source import VideoSource, size_of

RESULT, LOSS_CURVES, PARTS = "catalogue.json", "loss_curves.npz", ".parts-"


@dataclass(frozen=True, slots=True)
class CatalogueTask:
    """A video whose results are wanted.

    Attributes
    ----------
    video, out : CatalogueVideo, Path
        The video, and the folder of the catalogue; absolute.
    part : float
        Length of the parts that it may be divided into [s].
    """

    video: CatalogueVideo
    out: Path
    part: float

    @property
    def folder(self) -> Path:
        """Where its results go."""
        return self.out / self.video.name


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a video, and whether it was made now; else it was there."""

    row: CatalogueRow
    anew: bool


@dataclass(frozen=True, slots=True)
class OpenedVideo:
    """A video that has been opened for its results.

    Attributes
    ----------
    task, job : CatalogueTask, OptimizationJob
        What is wanted.
    sha256, state : str, str or None
        Of its content, and what tells that its file is the same.
    keys : ResultKeys
        What its results depend on.
    begun : float
        When work on it began [s since 1970].
    parts : tuple of range
        The frames of its parts, where it is to be analysed in parts.
    """

    task: CatalogueTask
    job: OptimizationJob
    sha256: str
    state: str | None
    keys: ResultKeys
    begun: float
    parts: tuple[range, ...] = ()

    @property
    def kept(self) -> Path:
        """Where loss curves, and parts of them, are kept until there is a result."""
        return kept_folder(self.task.out, self.keys)

    def seen(self) -> SeenVideo:
        """Return the video as it is seen."""
        source = self.job.source
        assert isinstance(source, VideoFile)
        return SeenVideo(source, self.job.display, self.job.seen_at, size_of(source)[::-1])

    def analysis(self) -> VideoAnalysis:
        """Return how its curves are computed."""
        job = self.job
        factors = brightness_factors(job.min_factor)
        return VideoAnalysis(job.model, factors, job.actuator, provenance_of(job), job.effort)


Opened = OpenedVideo | Outcome  # a task that opens a video, done again, may find a result in its place


def kept_folder(out: Path, keys: ResultKeys) -> Path:
    """Return the folder of a catalogue in which loss curves are kept until there is a result."""
    return out / f"{PARTS}{keys.curves[:32]}"


def result_there(task: CatalogueTask) -> Outcome | None:
    """Return the result of a video that is as wanted, if the video's file is as it was; it is not read."""
    try:
        known, state = _known(task.folder), _state(task.video)
        if known is None or state is None or known.video_state != state:
            return None
        asked = _asked_of(task.video)
        keys = keys_of(asked, asked.posed(), known.video_sha256)
    except InputError:  # told by who makes the result
        return None
    return Outcome(_row_now(known, task), anew=False) if known.key == keys.result else None


def results_of(task: CatalogueTask, divide: bool) -> Opened:
    """Make the results of a video, unless they are there.

    Parameters
    ----------
    task : CatalogueTask
        What is wanted.
    divide : bool
        Whether a long video is to be analysed in parts: it is only opened then.

    Raises
    ------
    InputError
        If the video or an option cannot be used.
    """
    opened, known = _opened(task)
    if known is not None and known.key == opened.keys.result:
        write_json_record(task.folder / RESULT, replace(known, video_state=opened.state))
        return Outcome(_row_now(known, task), anew=False)
    if (curves := _curves_there(opened, known)) is not None:
        return _written(opened, curves)
    parts = parts_of(opened.job.source, task.part) if divide else []
    return replace(opened, parts=tuple(parts)) if len(parts) > 1 else _written(opened, None)


def loss_curves_for(task: CatalogueTask, divide: bool) -> Opened:
    """Make the loss curves of a video, unless they are there, and nothing else; else as `results_of`."""
    opened, known = _opened(task)
    if _curves_there(opened, known) is None:
        parts = parts_of(opened.job.source, task.part) if divide else []
        if len(parts) > 1:
            return replace(opened, parts=tuple(parts))
        write_loss_curves(opened.kept / LOSS_CURVES, loss_curves_of(opened.job, FrameSamples()))
    return Outcome(CatalogueRow(task.video.name, task.video.shown), anew=True)


def curves_of(task: CatalogueTask) -> LossCurves:
    """Return the loss curves of a video that `loss_curves_for` has made."""
    opened, known = _opened(task)
    path = _curves_there(opened, known)
    if path is None:
        raise InputError(f"{task.video.shown}: its loss curves have gone; run it again")
    return read_loss_curves(path)


def contents_of_part(opened: Opened, number: int) -> NDArray[np.bool_]:
    """Return which frames of a part show another content than the frame before."""
    if isinstance(opened, Outcome):
        return np.empty(0, bool)
    part = opened.parts[number]

    def make(path: Path) -> None:
        write_whole(path, new_contents(opened.seen(), part).astype(np.uint8).tobytes())

    content = _kept(opened.kept / f"{part.start}-{part.stop}.new", Path.read_bytes, make)
    return np.frombuffer(content, np.uint8).astype(bool)


def begins_of_parts(opened: Opened, *new: NDArray[np.bool_]) -> list[int]:
    """Return where the analysis of each part begins, from the new contents of all."""
    return [] if isinstance(opened, Outcome) else begins_of(opened.parts, new)


def analysed_part(opened: Opened, begins: list[int], number: int) -> None:
    """Make the loss curves of a part, whose beginning and end are among those of all."""
    if isinstance(opened, Outcome):
        return
    begin, end = begins[number : number + 2]
    if begin == end:
        return

    def make(path: Path) -> None:
        made = curves_of_part(opened.seen(), opened.analysis(), begin, end)
        assert made is not None
        write_loss_curves(path, made)

    _kept(opened.kept / f"{begin}-{end}.npz", read_loss_curves, make)


def finished(opened: Opened, begins: list[int], curves_only: bool, *parts: None) -> Outcome:
    """Join the parts of a video, which are done, and make its results.

    Parameters
    ----------
    opened, begins : Opened, list of int
        The video, and where the analysis of its parts begins.
    curves_only : bool
        Whether its loss curves are all that is wanted.
    *parts : None
        What `analysed_part` has returned: that they are done.
    """
    if isinstance(opened, Outcome):
        return opened
    task, known = opened.task, _known(opened.task.folder)
    if known is not None and known.key == opened.keys.result:  # by a worker that died right after
        return Outcome(known.row, anew=True)
    borders = [(begin, end) for begin, end in pairwise(begins) if begin < end]
    curves = joined([read_loss_curves(opened.kept / f"{begin}-{end}.npz") for begin, end in borders])
    write_loss_curves(opened.kept / LOSS_CURVES, curves)
    if curves_only:
        return Outcome(CatalogueRow(task.video.name, task.video.shown), anew=True)
    return _written(opened, opened.kept / LOSS_CURVES)


def _kept(path: Path, read: Callable[[Path], Any], make: Callable[[Path], None]) -> Any:
    """Return what a file holds, which is made unless it is there and can be read."""
    with suppress(InputError, *UNREADABLE):
        return read(path)
    make(path)
    return read(path)


def _opened(task: CatalogueTask) -> tuple[OpenedVideo, CatalogueResult | None]:
    """Return a video that is opened for its results, and what the results that are there were made of."""
    begun, video = time.time(), task.video
    asked, known, state = _asked_of(video), _known(task.folder), _state(video)
    posed = asked.posed()
    if video.video.endswith(CURVES):
        source: VideoSource = AnalysedVideo(read_loss_curves(Path(video.video)))
        sha256 = sha256_of_file(Path(video.video))
    else:
        source = open_video(video.video, asked.fps)
        sha256 = source.sha256()
    keys = keys_of(asked, posed, sha256)
    return OpenedVideo(task, asked.job(source, posed, quiet=True), sha256, state, keys, begun), known


def _asked_of(video: CatalogueVideo) -> AskedTrack:
    """Return what is asked of a video; of loss curves, with what they were made for."""
    if not video.video.endswith(CURVES):
        return video.asked
    curves = read_loss_curves(Path(video.video))
    made_with = curves.provenance.inputs.get("contrast_model")
    if made_with not in (None, sha256_of_record(video.asked.model()[0])):
        raise InputError(f"the curves {video.video}: made with another contrast model than the one asked for")
    return replace(
        video.asked,
        curves=Path(video.video),
        min_factor=float(curves.factors[0]),
        actuator=curves.actuator,
        tolerance=curves.tolerance,
    )


def _state(video: CatalogueVideo) -> str | None:
    """Return what tells that a video's file is the same as before; None where nothing does."""
    state = file_state(video.video)
    return None if state is None else f"{video.shown} {state}"


def _known(folder: Path) -> CatalogueResult | None:
    """Return what the results in a folder were made of; None if there are none, or a file of them is gone."""
    try:
        known = read_json_record(CatalogueResult, folder / RESULT)
    except InputError:
        return None
    return known if all((folder / name).is_file() for name in known.files) else None


def _row_now(known: CatalogueResult, task: CatalogueTask) -> CatalogueRow:
    """Return the row of results that are there, by the present names of folder and video."""
    return replace(known.row, name=task.video.name, video=task.video.shown)


def _curves_there(opened: OpenedVideo, known: CatalogueResult | None) -> Path | None:
    """Return the file of loss curves that are given, or were made before; None if there are none."""
    if opened.job.curves is not None:
        return opened.job.curves
    if known is not None and known.curves_key == opened.keys.curves:
        return opened.task.folder / LOSS_CURVES
    kept = opened.kept / LOSS_CURVES
    return kept if kept.is_file() else None


def _written(opened: OpenedVideo, curves: Path | None) -> Outcome:
    """Make the results of a video in a folder that appears whole, and return what came out."""
    task, video = opened.task, opened.task.video
    with whole_folder(task.folder) as fresh:
        summary = run_optimization(replace(opened.job, curves=curves), fresh)
        row = row_of(video.name, video.shown, summary, time.time() - opened.begun)
        files, keys = files_in(fresh), opened.keys
        result = CatalogueResult(keys.result, keys.curves, opened.sha256, row, opened.state, files)
        write_json_record(fresh / RESULT, result)
        _keep_others(task.folder, fresh)
    shutil.rmtree(opened.kept, ignore_errors=True)
    return Outcome(row, anew=True)


def _keep_others(folder: Path, fresh: Path) -> None:
    """Take over files of others that lie in a folder of results, such as a film that was dimmed by them."""
    known = _known(folder)
    ours = set(() if known is None else known.files)
    for name in set(files_in(folder)) - ours - set(files_in(fresh)):
        target = fresh / name
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.link(folder / name, target)
        except OSError:
            shutil.copy2(folder / name, target)


def remove_kept(out: Path) -> None:
    """Remove loss curves that wait for a result, of runs that were asked for something else."""
    for folder in out.glob(f"{PARTS}*"):
        shutil.rmtree(folder, ignore_errors=True)
