"""The command `evenlight judge`: a brightness track by several measures of loss."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.analysis.track_options import (
    DisplayOption,
    FpsOption,
    JobsOption,
    NoCacheOption,
    QuietOption,
    VideoArgument,
)
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast.measures import MEASURES
from evenlight.option_panels import asked, output, words_and_files

TOLERANCE = 0.001  # of loss, as of `evenlight optimize`

if TYPE_CHECKING:
    from evenlight.data_schema.tracks.judgement import Judgement


def judge(
    video: VideoArgument,
    track: Annotated[
        Path,
        typer.Argument(
            help="Its track: the folder that `evenlight optimize` wrote, or track.csv with track.json "
            "beside it."
        ),
    ],
    out: Annotated[Path, output(help="Folder for judgement.json, the tables, a figure and report.html.")],
    measure: Annotated[
        list[str] | None,
        asked(
            metavar="NAME",
            help=f"Which measure of loss: {', '.join(MEASURES)}. Otherwise all.",
            autocompletion=words_and_files(*MEASURES),
        ),
    ] = None,
    display: DisplayOption = None,
    fps: FpsOption = None,
    jobs: JobsOption = 1,
    modulation: Annotated[
        bool, asked(help="Whether to ask ColorVideoVDP, if installed, how visible the dimming itself is.")
    ] = True,
    no_cache: NoCacheOption = False,
    quiet: QuietOption = False,
) -> None:
    """Judge a track by several measures of what is lost, beside constant dimming at equal power."""
    from evenlight.analysis.judgement.judgement import JudgedVideo
    from evenlight.analysis.judgement.judgement_results import judge_track
    from evenlight.data_schema.storage.whole_files import results_folder
    from evenlight.data_schema.tracks.loaded_track import load_track
    from evenlight.method.choices import AnalysisEffort
    from evenlight.method.contrast.measures import measure_named
    from evenlight.stimuli.dimmed.matched_track import display_of
    from evenlight.stimuli.sequences import open_video

    if jobs < 0:
        raise InputError(f"--jobs must be 0 (all cores) or more, got {jobs}")
    names = tuple(dict.fromkeys(measure or MEASURES))
    for name in names:
        measure_named(name)
    loaded = load_track(track)
    source, effort = open_video(video, fps), AnalysisEffort(TOLERANCE, jobs)
    judged = JudgedVideo(source, display_of(loaded.track, display), loaded, effort, not no_cache, quiet)
    with results_folder(out) as folder:
        found = judge_track(judged, names, modulation, folder)
    if not quiet:
        _print_result(found, out)


def _print_result(found: Judgement, out: Path) -> None:
    """Print what each measure says, in a line."""
    from evenlight.analysis.tracks.objective_words import less_or_more

    for one in found.measured:
        gain = "" if one.gain is None else f" ({less_or_more(one.gain, 1)})"
        typer.echo(
            f"{one.measure}: loss differs by {one.spread:.4g} between two frames, {one.spread_constant:.4g} "
            f"at constant dimming{gain}; mean {one.mean_loss:.4g} and {one.mean_loss_constant:.4g}"
        )
    for stretch in found.modulation:
        typer.echo(
            f"ColorVideoVDP, {stretch.begin:.1f} to {stretch.end:.1f} s: {stretch.jod:.3f} JOD for the "
            f"movement, {stretch.jod_flicker:.3f} for a flicker of 2 %"
        )
    if not found.modulation:
        typer.echo(found.modulation_note)
    typer.echo(f"equal loss of visible contrast is not yet equal quality: docs/validity.md\nresults in {out}")
