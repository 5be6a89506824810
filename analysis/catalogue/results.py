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
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.catalogue.entries import CURVES, CatalogueVideo
from evenlight.analysis.catalogue.keys import ResultKeys, keys_of
from evenlight.analysis.earlier_results import files_in
from evenlight.analysis.tracks.asked_track import AskedTrack
from evenlight.analysis.tracks.optimization_job import AnalysedVideo, OptimizationJob, provenance_of
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
class OpenedVideo:
    """A video that has been opened for its results.

    Attributes
    ----------
    task, job : CatalogueTask, OptimizationJob
        What is wanted.
    sha256, state : str, str or None
        Of its content, and what `file_state` says of its file.
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
    def parts_folder(self) -> Path:
        """Where its parts are kept until they are joined."""
        return self.task.out / f"{PARTS}{self.keys.curves[:16]}-{self.task.part:g}"

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


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a video, and whether it was made now; else it was there."""

    row: CatalogueRow
    anew: bool


def results_of(task: CatalogueTask, divide: bool, curves_do: bool = False) -> Outcome | OpenedVideo:
    """Make the results of a video, unless they are there.

    Parameters
    ----------
    task : CatalogueTask
        What is wanted.
    divide : bool
        Whether a long video is to be analysed in parts: it is only opened then.
    curves_do : bool
        Whether nothing is to be done where its loss curves are there, whatever else is wanted.

    Returns
    -------
    Outcome or OpenedVideo
        What came of it; or the video, whose parts are other tasks.

    Raises
    ------
    InputError
        If the video or an option cannot be used.
    """
    begun, video = time.time(), task.video
    asked, state, known = _asked_of(video), file_state(video.video), _known(task.folder)
    posed = asked.posed()
    if known is not None and state is not None and known.video_state == state:
        # Unchanged to the file system: its content is not read again.
        keys = keys_of(asked, posed, known.video_sha256)
        if known.key == keys.result or (curves_do and known.curves_key == keys.curves):
            return Outcome(known.row, anew=False)
    source, sha256 = _opened(video, asked)
    keys = keys_of(asked, posed, sha256)
    if known is not None and (known.key == keys.result or (curves_do and known.curves_key == keys.curves)):
        write_json_record(task.folder / RESULT, replace(known, video_state=state))
        return Outcome(known.row, anew=False)
    job = asked.job(source, posed, quiet=True)
    opened = OpenedVideo(task, job, sha256, state, keys, begun)
    if known is not None and known.curves_key == keys.curves and asked.curves is None:
        return _written(opened, task.folder / LOSS_CURVES)
    parts = parts_of(source, task.part) if divide and job.curves is None else []
    return replace(opened, parts=tuple(parts)) if len(parts) > 1 else _written(opened, job.curves)


def contents_of_part(opened: OpenedVideo, number: int) -> NDArray[np.bool_]:
    """Return which frames of a part show another content than the frame before."""

    def make(path: Path) -> None:
        bits = new_contents(opened.seen(), opened.parts[number])
        write_whole(path, bits.astype(np.uint8).tobytes())

    path = _kept(opened.parts_folder / f"{number:05d}.new", Path.read_bytes, make)
    return np.frombuffer(path, np.uint8).astype(bool)


def analysed_part(opened: OpenedVideo, number: int, *new: NDArray[np.bool_]) -> int:
    """Make the loss curves of a part, and return how many frames they have.

    Parameters
    ----------
    opened, number : OpenedVideo, int
        The video, and which of its parts.
    *new : array
        Of each part, `contents_of_part`.
    """
    begins = begins_of(opened.parts, new)
    begin, end = begins[number : number + 2]
    if begin < end:

        def make(path: Path) -> None:
            made = curves_of_part(opened.seen(), opened.analysis(), begin, end)
            assert made is not None
            write_loss_curves(path, made)

        _kept(opened.parts_folder / f"{number:05d}.npz", read_loss_curves, make)
    return end - begin


def finished(opened: OpenedVideo, *frames: int) -> Outcome:
    """Join the parts of a video, and make its results.

    Parameters
    ----------
    opened : OpenedVideo
        The video.
    *frames : int
        Of each part, how many frames its curves have.
    """
    folder = opened.parts_folder
    numbers = (number for number, count in enumerate(frames) if count)
    curves = joined([read_loss_curves(folder / f"{number:05d}.npz") for number in numbers])
    write_loss_curves(folder / LOSS_CURVES, curves)
    outcome = _written(opened, folder / LOSS_CURVES)
    shutil.rmtree(folder, ignore_errors=True)
    return outcome


def _kept(path: Path, read: Callable[[Path], Any], make: Callable[[Path], None]) -> Any:
    """Return what a file holds, which is made unless it is there and can be read."""
    with suppress(InputError, *UNREADABLE):
        return read(path)
    make(path)
    return read(path)


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


def _opened(video: CatalogueVideo, asked: AskedTrack) -> tuple[VideoSource, str]:
    """Return a video, and the SHA-256 of its content."""
    if video.video.endswith(CURVES):
        path = Path(video.video)
        return AnalysedVideo(read_loss_curves(path)), sha256_of_file(path)
    source = open_video(video.video, asked.fps)
    return source, source.sha256()


def _known(folder: Path) -> CatalogueResult | None:
    """Return what the results in a folder were made of; None if there are none, or a file of them is gone."""
    try:
        known = read_json_record(CatalogueResult, folder / RESULT)
    except InputError:
        return None
    return known if all((folder / name).is_file() for name in known.files) else None


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


def remove_parts(out: Path) -> None:
    """Remove what is left of the parts of videos, of runs that were asked for something else."""
    for folder in out.glob(f"{PARTS}*"):
        shutil.rmtree(folder, ignore_errors=True)


def curves_of(task: CatalogueTask) -> LossCurves:
    """Return the loss curves of a video whose results are there."""
    return read_loss_curves(task.folder / LOSS_CURVES)
