"""The command that turns a video and a power budget into a brightness track."""

from __future__ import annotations

from dataclasses import replace

import typer

from evenlight.analysis.tracks.track_request import OneVideo, TrackRequest, closing_words
from evenlight.data_schema.errors import InputError
from evenlight.option_panels import with_options


def _optimize(wanted: TrackRequest, one: OneVideo) -> None:
    """Find the brightness track of a video: how bright each frame is shown to meet a power budget.

    Frames lose more nearly the same share of visible contrast than if all were dimmed alike, and brightness
    never changes faster than the rate limit.
    """
    from evenlight.analysis.tracks.first_page import told
    from evenlight.analysis.tracks.track_results import run_optimization
    from evenlight.analysis.tracks.track_words import detection_in_words, rate_in_words
    from evenlight.data_schema.storage.result_folders import result_folder
    from evenlight.stimuli.sequences import open_videos

    wanted.check()
    display, request = wanted.posed()
    if wanted.curves is not None and wanted.others:
        raise InputError("`curves` holds the loss curves of one video; leave it out where `others` adds some")
    names = [one.video, *(map(str, wanted.others or ()))]
    source, *others = open_videos(names, wanted.fps, damaged=wanted.damaged, stream=wanted.stream)
    job = replace(wanted, others=None).job(source, display, request)
    effort = wanted.effort(display, job.model, one.quiet)
    job = replace(job, others=tuple(others), effort=effort, quiet=one.quiet, price=True)
    with result_folder(one.out, "optimize", force=one.force) as folder:
        summary = run_optimization(job, folder)
    if not one.quiet:
        frames = f"{summary.frames} frames, mean factor {summary.mean_factor:.4g}; {rate_in_words(summary)}"
        closing = closing_words(request.rate_limit, display, one.out)
        typer.echo("\n".join([*told(summary), detection_in_words(summary), frames, closing]))


optimize = with_options(_optimize, TrackRequest, OneVideo)
