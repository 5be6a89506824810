"""The files of brightness tracks, offline and online: tables, summaries, figures."""

from __future__ import annotations

import time
from itertools import zip_longest
from pathlib import Path

import numpy as np

from evenlight.analysis.figure_style import write_figure
from evenlight.analysis.player.picture_recorder import PictureRecorder
from evenlight.analysis.player.player_page import PLAYER, player_content, write_player_page
from evenlight.analysis.results import write_drawing
from evenlight.analysis.tracks.contrast_map_figure import contrast_map_figure, contrast_maps
from evenlight.analysis.tracks.control_run import ControlJob, control_video
from evenlight.analysis.tracks.frame_samples import FrameSamples
from evenlight.analysis.tracks.optimization import give_back_memory, optimize_video
from evenlight.analysis.tracks.optimization_job import (
    AnalysedVideo,
    OptimizationJob,
    clip_folder,
    loss_curves_of,
)
from evenlight.analysis.tracks.price_figure import price_figure
from evenlight.analysis.tracks.track_figure import DrawnTrack, track_figure
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, write_track
from evenlight.data_schema.tracks.loss_curves import LossCurves, write_loss_curves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.one_blas_thread import one_blas_thread
from evenlight.progress import shown_progress

TRACK, SUMMARY, CURVES = "track.csv", "summary.json", "loss_curves.npz"


def write_track_files(
    folder: Path, track: BrightnessTrack, summary: OptimizationSummary, curves: LossCurves
) -> None:
    """Write a track with what belongs to it: `track.csv`, `summary.json`, `loss_curves.npz`, `track.json`."""
    write_loss_curves(folder / CURVES, curves)
    write_json_record(folder / SUMMARY, summary)
    write_track(folder / TRACK, track, beside=(CURVES, SUMMARY))


def run_optimization(job: OptimizationJob, folder: Path) -> OptimizationSummary:
    """Analyse, optimize, and write every result into a folder.

    Of several clips that share the budget, each gets a folder of its own in it, numbered and named for it.
    """
    recorders = _recorders(job)
    summary, clips = optimize_video(job, [recorder.watch for recorder in recorders])
    several = len(clips) > 1
    if several:
        write_json_record(folder / SUMMARY, summary)
    if job.price and summary.watched and not job.robust:
        with shown_progress(job.quiet, f"price of invisibility of {summary.video}"):
            write_drawing(folder, price_figure(job, [curves for curves, _ in clips], summary))
    for number, ((curves, data), recorder) in enumerate(zip_longest(clips, recorders), start=1):
        path = folder / clip_folder(number, curves.video) if several else folder
        path.mkdir(parents=True, exist_ok=True)
        _write_track(curves, data, job, path, recorder)
    return summary


@one_blas_thread
def run_control(asked: ControlJob, folder: Path) -> tuple[OptimizationSummary, float | None, tuple[str, ...]]:
    """Analyse a video, run the controller over it, and write every result into a folder.

    Returns the summary, and what else `control_video` tells.
    """
    samples, began, job = FrameSamples(), time.perf_counter(), asked.work
    recorder = next(iter(_recorders(job)), None)
    curves = loss_curves_of(job, samples, None if recorder is None else recorder.watch)
    curves_s = time.perf_counter() - began
    with shown_progress(job.quiet, f"controlling {curves.video}"):
        drawn, ratio, warnings = control_video(curves, asked, samples, curves_s)
    _write_track(curves, drawn, job, folder, recorder)
    return drawn.summary, ratio, warnings


def _recorders(job: OptimizationJob) -> list[PictureRecorder]:
    sources = (job.source, *job.others) if job.player and not isinstance(job.source, AnalysedVideo) else ()
    return [PictureRecorder(source, cached=job.cached, quiet=job.quiet) for source in sources]


def _write_track(
    curves: LossCurves, data: DrawnTrack, job: OptimizationJob, folder: Path, recorder: PictureRecorder | None
) -> None:
    give_back_memory()
    write_track_files(folder, data.track, data.summary, curves)
    give_back_memory()
    with shown_progress(job.quiet, f"drawing {curves.video}"):
        _draw(data, curves.display, job.model, folder)
    give_back_memory()
    if recorder is not None:
        write_player_page(folder / PLAYER, player_content(job, data, curves, recorder))


def _draw(data: DrawnTrack, display: Display, model: ContrastModel, folder: Path) -> None:
    """Draw the track over time, and where contrast is lost in the frame in which it matters most."""
    write_figure(folder / "track.png", track_figure(data))
    if not data.samples:  # the frames of loss curves are not at hand
        return
    track = data.track
    difference = np.abs(data.baseline_loss - track.contrast_loss)
    index, pixels = max(data.samples, key=lambda held: float(difference[held[0]]))
    ours, constant = contrast_maps(pixels, data.compared_at(index), display, model)
    name = f"{track.header.video} at {track.times[index]:.1f} s"
    write_figure(folder / "contrast_map.png", contrast_map_figure(pixels, ours, constant, name))
