"""What the player page of a track shows: its picture, its contrast maps, its power, and what is said."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.player.contrast_tiles import contrast_tiles
from evenlight.analysis.player.picture_recorder import PictureRecorder
from evenlight.analysis.player.player_page import PlayerContent, Proxy, Tiles
from evenlight.analysis.player.proxy_video import PAGE_BYTES
from evenlight.analysis.tracks.frame_samples import FrameSamples
from evenlight.analysis.tracks.optimization_job import OptimizationJob
from evenlight.analysis.tracks.track_figure_data import TrackFigureData
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.power import power
from evenlight.progress import shown_progress
from evenlight.stimuli.sequence_format import SequenceFormat

PLAYER = "player.html"


def player_content(
    job: OptimizationJob,
    data: TrackFigureData,
    curves: LossCurves,
    samples: FrameSamples,
    recorder: PictureRecorder,
) -> PlayerContent:
    """Return what the player page of a track shows.

    Parameters
    ----------
    job, data : OptimizationJob, TrackFigureData
        What was asked, and the track.
    curves, samples, recorder : LossCurves, FrameSamples, PictureRecorder
        Of its video: the curves, some frames, and what makes the picture.
    """
    model, share = job.request.power_model, curves.durations / curves.durations.sum()
    constant = power(model, np.full(curves.n_frames, data.baseline_factor), curves.channel_means)
    full = float(share @ power(model, np.ones(curves.n_frames), curves.channel_means))
    picture = recorder.picture(curves)
    with shown_progress(job.quiet) as progress:
        progress.step(f"maps of lost contrast of {curves.video}")
        contrast, detail = contrast_tiles(samples.held, data, curves.display, job.model)
    shown, why = _of_the_picture(picture, curves)
    notes = [f"{shown} Maps of lost contrast for {len(contrast.frames)} frames."]
    if isinstance(getattr(recorder.source, "format", None), SequenceFormat):
        notes.append(f"{curves.video} is a built-in sequence: rendered, not filmed.")
    if job.request.rate_limit.simulated:
        notes.append("The rate limit is of simulated participants.")
    said = tuple(notes)
    return PlayerContent(data, curves.display, constant, full, picture, contrast, said, f"{why} {detail}")


def _of_the_picture(picture: Proxy | Tiles, curves: LossCurves) -> tuple[str, str]:
    """Say what the picture is, and why it is not the video."""
    if isinstance(picture, Tiles):
        every = float(curves.durations.sum()) * np.diff(picture.frames, append=0)[0] / curves.n_frames
        why = f"The video is too long for a moving picture in a page of {PAGE_BYTES / 1e6:.0f} MB."
        return f"Picture: {len(picture.frames)} stills, one every {every:.3g} s.", why
    shown = f"Picture: {picture.width} × {picture.height} copy, no sound."
    return shown, f"It is H.264 of at most {picture.rate / 1000:.0f} kbit/s, so that the page stays small."
