"""The files of a controlled video: track, summaries, figures."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from evenlight.analysis.figure_style import write_png
from evenlight.analysis.tracks.contrast_map_figure import contrast_map, contrast_map_figure
from evenlight.analysis.tracks.control_figure import tuning_figure
from evenlight.analysis.tracks.control_run import Control, Controlled, ControlledVideo
from evenlight.analysis.tracks.control_sweep_figure import target_figure
from evenlight.analysis.tracks.frame_samples import FrameSamples
from evenlight.analysis.tracks.optimization import curves_of
from evenlight.analysis.tracks.thumbnails import thumbnails_of
from evenlight.analysis.tracks.track_figure import track_figure
from evenlight.analysis.tracks.track_story import TrackStory, uses_same_power
from evenlight.data_schema.brightness_track import write_track
from evenlight.data_schema.control import TargetRow
from evenlight.data_schema.loss_curves import write_loss_curves
from evenlight.data_schema.text_files import write_json_record, write_rows


def run_control(asked: Control, folder: Path) -> tuple[Controlled, list[TargetRow]]:
    """Analyse a video, run the controller over it, and write every result into a folder.

    Parameters
    ----------
    asked : Control
        What is asked.
    folder : Path
        For `track.csv`, `track.json`, `summary.json`, `control.json`, `loss_curves.npz`, the figures; and
        `tuning.json`, `target_sweep.csv` where they are asked for.

    Returns
    -------
    Controlled, list of TargetRow
        What came of it, and of each other target.
    """
    samples, began = FrameSamples(), time.perf_counter()
    curves = curves_of(asked.work, samples)
    video = ControlledVideo(curves, asked, time.perf_counter() - began)
    done = video.controlled()
    write_loss_curves(folder / "loss_curves.npz", curves)
    write_track(folder / "track.csv", done.track)
    write_json_record(folder / "summary.json", done.summary)
    write_json_record(folder / "control.json", done.control)
    _draw(asked, folder, done, samples)
    if done.tuning is not None and done.tuning_runs is not None:
        write_json_record(folder / "tuning.json", done.tuning)
        write_png(folder / "tuning.png", tuning_figure(done.tuning, curves.times, done.tuning_runs))
    rows = video.sweep(done.settings) if asked.sweep else []
    if rows:
        write_rows(folder / "target_sweep.csv", TargetRow, rows)
        figure = target_figure(rows, curves.video, (curves.n_frames, asked.settings.lowest_factor))
        write_png(folder / "target_sweep.png", figure)
    return done, rows


def _draw(asked: Control, folder: Path, done: Controlled, samples: FrameSamples) -> None:
    """Draw the track over time, and where contrast is lost in the frame in which that differs most."""
    track, constant = done.track, done.summary.baseline_factor
    story = TrackStory(
        track=track,
        baseline_factor=constant,
        baseline_loss=done.baseline_loss,
        objective=done.summary.objective,
        objective_baseline=done.summary.objective_baseline,
        thumbnails=thumbnails_of(samples.held),
        lowest_factor=asked.settings.lowest_factor,
        achieved=done.summary.achieved,
        same_power=uses_same_power(done.summary),
    )
    write_png(folder / "track.png", track_figure(story))
    difference = np.abs(done.baseline_loss - track.contrast_loss)
    index, pixels = max(samples.held, key=lambda held: float(difference[held[0]]))
    panel = done.display
    ours, same = (
        contrast_map(pixels, float(factor), panel, asked.work.model)
        for factor in (track.factors[index], constant)
    )
    name = f"{track.header.video} at {track.times[index]:.1f} s"
    write_png(folder / "contrast_map.png", contrast_map_figure(pixels, ours, same, name))
