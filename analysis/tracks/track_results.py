"""The files of brightness tracks, offline and online: tables, summaries, figures."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from evenlight.analysis.figure_style import write_png
from evenlight.analysis.player.picture_recorder import PictureRecorder
from evenlight.analysis.player.player_content import PLAYER, player_content
from evenlight.analysis.player.player_page import write_player_page
from evenlight.analysis.tracks.contrast_map_figure import contrast_map_figure, contrast_maps
from evenlight.analysis.tracks.control_figures import target_figure, tuning_figure
from evenlight.analysis.tracks.control_run import ControlJob, ControlledVideo, ControlResult
from evenlight.analysis.tracks.frame_samples import FrameSamples, thumbnails_of
from evenlight.analysis.tracks.gain_words import gain_sentences, uses_same_power
from evenlight.analysis.tracks.objective_words import minimized_in_words
from evenlight.analysis.tracks.optimization import OptimizedClip, optimize_video
from evenlight.analysis.tracks.optimization_job import (
    AnalysedVideo,
    OptimizationJob,
    clip_folder,
    loss_curves_of,
)
from evenlight.analysis.tracks.track_figure import track_figure
from evenlight.analysis.tracks.track_figure_data import TrackFigureData, compared_at
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.brightness_track import write_track
from evenlight.data_schema.tracks.control import TargetRow
from evenlight.data_schema.tracks.loss_curves import write_loss_curves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.one_blas_thread import one_blas_thread
from evenlight.method.optimizer.evaluate import limit_without_allowances
from evenlight.progress import shown_progress


def run_optimization(job: OptimizationJob, folder: Path) -> OptimizationSummary:
    """Analyse, optimize, and write every result into a folder.

    Of several clips that share the budget, each gets a folder of its own in it, numbered and named for it.
    """
    recorders = _recorders(job)
    result = optimize_video(job, [recorder.watch for recorder in recorders])
    write_json_record(folder / "summary.json", result.summary)
    several = len(result.clips) > 1
    for number, clip in enumerate(result.clips, start=1):
        path = folder / clip_folder(number, clip.problem.curves.video) if several else folder
        _write_clip(clip, job, path, recorders[number - 1] if recorders else None)
        if several:
            write_json_record(path / "summary.json", clip.summary)
    return result.summary


def _recorders(job: OptimizationJob) -> list[PictureRecorder]:
    """Return what makes the pictures of the videos' player pages; none if there are to be none."""
    sources = (job.source, *job.others) if job.player and not isinstance(job.source, AnalysedVideo) else ()
    return [PictureRecorder(source, cached=job.cached, quiet=job.quiet) for source in sources]


def _write_clip(
    clip: OptimizedClip, job: OptimizationJob, folder: Path, recorder: PictureRecorder | None
) -> None:
    """Write the loss curves, the track, the figures and the player page of a clip."""
    folder.mkdir(exist_ok=True)
    curves, data = clip.problem.curves, figure_data_of(clip)
    write_loss_curves(folder / "loss_curves.npz", curves)
    write_track(folder / "track.csv", clip.track)
    with shown_progress(job.quiet) as progress:
        progress.step(f"drawing {curves.video}")
        _draw(data, clip.samples, curves.display, job.model, folder)
    if recorder is not None:
        write_player_page(folder / PLAYER, player_content(job, data, curves, clip.samples, recorder))


def figure_data_of(clip: OptimizedClip) -> TrackFigureData:
    """Return the content of the figure of a clip's track."""
    problem, summary = clip.problem, clip.summary
    return TrackFigureData(
        track=clip.track,
        baseline_factor=problem.baseline_factor,
        baseline_loss=problem.loss(problem.baseline()),
        objective=summary.objective,
        objective_baseline=summary.objective_baseline,
        thumbnails=thumbnails_of(clip.samples.held),
        lowest_factor=problem.lowest_factor,
        achieved=summary.achieved,
        clips=summary.clips,
        same_power=uses_same_power(summary),
        weighing=clip.weighing,
        fitted_limit=limit_without_allowances(problem, clip.track.factors),
        minimized=minimized_in_words(summary),
        gained=gain_sentences(summary),
    )


@one_blas_thread
def run_control(asked: ControlJob, folder: Path) -> tuple[ControlResult, list[TargetRow]]:
    """Analyse a video, run the controller over it, and write every result into a folder.

    Parameters
    ----------
    asked : ControlJob
        What is asked.
    folder : Path
        For `track.csv`, `track.json`, `summary.json`, `control.json`, `loss_curves.npz`, the figures; and
        `player.html`, `tuning.json`, `target_sweep.csv` where they are asked for.

    Returns
    -------
    ControlResult, list of TargetRow
        What came of it, and of each other target.
    """
    samples, began = FrameSamples(), time.perf_counter()
    recorders = _recorders(asked.work)
    curves = loss_curves_of(asked.work, samples, *(recorder.watch for recorder in recorders))
    video = ControlledVideo(curves, asked, time.perf_counter() - began)
    with shown_progress(asked.work.quiet) as progress:
        progress.step(f"controlling {curves.video}")
        done = video.controlled()
        rows = video.sweep(done.settings) if asked.sweep else []
    write_loss_curves(folder / "loss_curves.npz", curves)
    write_track(folder / "track.csv", done.track)
    write_json_record(folder / "summary.json", done.summary)
    write_json_record(folder / "control.json", done.control)
    data = _figure_data_of_control(done, samples, asked.settings.lowest_factor)
    with shown_progress(asked.work.quiet) as progress:
        progress.step(f"drawing {curves.video}")
        _draw(data, samples, done.display, asked.work.model, folder)
    for recorder in recorders:
        write_player_page(folder / PLAYER, player_content(asked.work, data, curves, samples, recorder))
    if done.tuning is not None and done.tuning_runs is not None:
        write_json_record(folder / "tuning.json", done.tuning)
        write_png(folder / "tuning.png", tuning_figure(done.tuning, curves.times, done.tuning_runs))
    if rows:
        write_rows(folder / "target_sweep.csv", TargetRow, rows)
        figure = target_figure(rows, curves.video, (curves.n_frames, asked.settings.lowest_factor))
        write_png(folder / "target_sweep.png", figure)
    return done, rows


def _figure_data_of_control(
    done: ControlResult, samples: FrameSamples, lowest_factor: float
) -> TrackFigureData:
    """Return the content of the figure of the controller's track."""
    return TrackFigureData(
        track=done.track,
        baseline_factor=done.summary.baseline_factor,
        baseline_loss=done.baseline_loss,
        objective=done.summary.objective,
        objective_baseline=done.summary.objective_baseline,
        thumbnails=thumbnails_of(samples.held),
        lowest_factor=lowest_factor,
        achieved=done.summary.achieved,
        same_power=uses_same_power(done.summary),
        gained=gain_sentences(done.summary),
    )


def _draw(
    data: TrackFigureData, samples: FrameSamples, display: Display, model: ContrastModel, folder: Path
) -> None:
    """Draw the track over time, and where contrast is lost in the frame in which it matters most."""
    write_png(folder / "track.png", track_figure(data))
    if not samples.held:  # the frames of loss curves are not at hand
        return
    track = data.track
    difference = np.abs(data.baseline_loss - track.contrast_loss)
    index, pixels = max(samples.held, key=lambda held: float(difference[held[0]]))
    ours, constant = contrast_maps(pixels, compared_at(data, index), display, model)
    name = f"{track.header.video} at {track.times[index]:.1f} s"
    write_png(folder / "contrast_map.png", contrast_map_figure(pixels, ours, constant, name))
