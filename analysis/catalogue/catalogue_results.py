"""The work of a catalogue: the results of each video, as tasks for workers, and by what they are known again.

Whatever a task did before its worker died is known by its files: it is not done twice. The folder of a
catalogue is on a file system that all workers share.
"""

from __future__ import annotations

import dataclasses
import enum
import hashlib
import json
import shutil
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evenlight.analysis.catalogue.entries import CURVES, CatalogueVideo
from evenlight.analysis.catalogue.video_listing import file_state
from evenlight.analysis.figure_style import ASKED, FiguresAsked, figures_like
from evenlight.analysis.tracks.optimization_job import AnalysedVideo
from evenlight.analysis.tracks.track_request import TrackRequest
from evenlight.analysis.tracks.track_results import run_optimization
from evenlight.analysis.tracks.track_words import alike, less_or_more
from evenlight.cluster import AHEAD, SchedulerLostError, Workers, result_of, software
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, sha256_of_record
from evenlight.data_schema.printed import in_one_line
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.storage.result_folders import files_in, result_folder
from evenlight.data_schema.storage.text_files import read_json_record, write_json_record
from evenlight.data_schema.tracks.catalogue import CatalogueResult, CatalogueRow, row_of
from evenlight.data_schema.tracks.loss_curves import read_loss_curves
from evenlight.method.optimizer.request import Request
from evenlight.progress import Progress
from evenlight.result_requests import write_request
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.video_source import VideoSource

if TYPE_CHECKING:
    from distributed import Future

LOOK_EVERY = 1.0  # [s] for what is done
LONGEST_WAIT = 60.0  # [s] for a worker that was given up and writes the same results
DEFECT = "a defect of Evenlight, or of a package that it uses"
RESULT, LOSS_CURVES = "catalogue.json", "loss_curves.npz"
OF_CURVES = ("min_factor", "field_of_view", "actuator", "fps", "damaged", "stream")
# Options that tell nothing of a result: files, whose content counts, and what is only kept or allowed.
NOT_OF_RESULT = (
    "display", "power_model", "rate_limit", "curves", "weights", "allowances", "no_cache", "other_display_ok",
    "accept_wide_band", "jobs", "device", "others", "start", "robust", "measures",
)  # fmt: skip


def run_catalogue(
    videos: Sequence[CatalogueVideo], workers: Workers, progress: Progress, *, force: bool = False
) -> list[CatalogueRow]:
    """Make the results of all videos, and return a row for each; one that fails stops no other.

    Raises
    ------
    InputError
        If the scheduler has gone.
    """
    progress.step("videos", len(videos))
    waiting, under_way = deque(range(len(videos))), dict["Future", int]()
    rows: dict[int, CatalogueRow] = {}
    try:
        while waiting or under_way:
            while waiting and len(under_way) < AHEAD * workers.places():
                number = waiting.popleft()
                under_way[workers.submit(_made, videos[number], force, ASKED.get())] = number
            for future in workers.done_of(under_way, LOOK_EVERY):
                number = under_way.pop(future)
                rows[number], anew = _outcome(future, videos[number])
                if anew:
                    progress.note(in_words(rows[number]))
            progress.at(len(rows), len(videos))
    finally:
        workers.client.cancel(list(under_way))
    return [rows[number] for number in range(len(videos))]


def _outcome(future: Future, video: CatalogueVideo) -> tuple[CatalogueRow, bool]:
    """Return what a task has returned; if it failed, the row that says so."""
    try:
        outcome: tuple[CatalogueRow, bool] = result_of(future)
        return outcome
    except SchedulerLostError:
        raise
    except InputError as error:
        message = str(error)
    except MemoryError:
        message = "needs more memory than its worker has"
    except Exception as error:  # whatever it is, it must not stop the others
        message = f"{DEFECT}: {type(error).__name__}: {error}"
    return CatalogueRow(video.name, video.shown, error=in_one_line(message) or "unknown"), True


def in_words(row: CatalogueRow) -> str:
    """Return what came of a video."""
    name = in_one_line(row.name)
    if row.error:
        return f"{name}: failed: {row.error}"
    ours, constant = alike(row.objective or 0.0, row.objective_baseline or 0.0)
    beside = f"than with constant dimming ({ours} points, constant {constant})"
    gain = "nothing to gain" if row.gain is None else f"loss differs {less_or_more(row.gain)} {beside}"
    return f"{name}: {row.frames} frames, {gain}"


def _made(video: CatalogueVideo, force: bool, figures: FiguresAsked) -> tuple[CatalogueRow, bool]:
    """Return the row of a video, and whether its results were made now; else they were there, as wanted.

    They are made in a folder that appears whole. A file that is as it was is not read to see that.
    """
    begun, asked, known = time.time(), _asked_of(video), _known(video.folder)
    if known is not None and not all((video.folder / f"track.{kind}").is_file() for kind in figures.kinds):
        known = replace(known, key="")  # what is drawn of it is wanted otherwise
    posed, state = asked.posed(), file_state(video.video)
    if state is not None:
        state = f"{video.shown} {state}"  # another file may have its size and its time
    same_file = known is not None and state is not None and known.video_state == state
    if known is not None and same_file and _keys_of(asked, posed, known.video_sha256)[0] == known.key:
        return replace(known.row, name=video.name, video=video.shown), False
    if video.video.endswith(CURVES):
        source: VideoSource = AnalysedVideo(read_loss_curves(Path(video.video)))
        sha256 = sha256_of_file(Path(video.video))
    else:
        source = open_video(video.video, asked.fps, asked.damaged, asked.stream)
        sha256 = source.sha256()
    key, curves_key = _keys_of(asked, posed, sha256)
    if known is not None and known.key == key:
        with result_folder(video.folder, "catalogue", force=force, wait=LONGEST_WAIT) as fresh:
            shutil.copytree(video.folder, fresh, dirs_exist_ok=True)
            write_json_record(fresh / RESULT, replace(known, video_state=state))
        return replace(known.row, name=video.name, video=video.shown), False
    job = replace(asked.job(source, *posed), quiet=True, price=True)
    job = replace(job, effort=replace(job.effort, jobs=job.effort.jobs or 1))  # others have the other cores
    if job.curves is None and known is not None and known.curves_key == curves_key:
        job = replace(job, curves=video.folder / LOSS_CURVES)
    written = result_folder(video.folder, "catalogue", force=force, wait=LONGEST_WAIT)
    with figures_like(figures), written as fresh:
        summary = run_optimization(job, fresh)
        of = {"video": video.video, "out": video.folder}
        if not video.video.endswith(CURVES):
            write_request(fresh, "optimize", vars(asked) | of, {video.video: sha256})
        row = row_of(video.name, video.shown, summary, time.time() - begun)
        result = CatalogueResult(key, curves_key, sha256, row, state, files_in(fresh))
        write_json_record(fresh / RESULT, result)
    return row, True


def _keys_of(asked: TrackRequest, posed: tuple[Display, Request], video_sha256: str) -> tuple[str, str]:
    """Return what the result and the loss curves of a video depend on, each as a SHA-256."""
    display, request = posed
    made_of: dict[str, Any] = {
        "video": video_sha256,
        "display": sha256_of_record(display),
        "contrast_model": sha256_of_record(asked.model()[0]),
        "software": software(),
        "options": {name: _plain(getattr(asked, name)) for name in OF_CURVES},
    }
    curves = _sha256(made_of)
    options = {field.name for field in dataclasses.fields(asked)} - set(NOT_OF_RESULT)
    made_of["options"] = {name: _plain(getattr(asked, name)) for name in options}
    model = request.power_model
    made_of["power_model"] = None if model is None else sha256_of_record(model)
    made_of["rate_limit"] = sha256_of_record(request.rate_limit)
    made_of["sections"] = [mapping_from_record(one) for one in (*request.weights, *request.allowances)]
    return _sha256(made_of), curves


def _plain(value: Any) -> Any:
    return value.value if isinstance(value, enum.Enum) else value


def _sha256(content: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _asked_of(video: CatalogueVideo) -> TrackRequest:
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
    )


def _known(folder: Path) -> CatalogueResult | None:
    """Return what the results in a folder were made of; None if there are none, or a file of them is gone."""
    try:
        known = read_json_record(CatalogueResult, folder / RESULT)
    except InputError:
        return None
    return known if all((folder / name).is_file() for name in known.files) else None
