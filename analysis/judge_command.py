"""The command `evenlight judge`: a brightness track by several measures of loss."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evenlight.method.contrast.measures import MEASURES
from evenlight.option_panels import ForceOption, QuietOption, asked, expert, output, words_and_files
from evenlight.stimuli.dimming_options import (
    DisplayOption,
    FpsOption,
    JobsOption,
    NoCacheOption,
    TrackArgument,
    VideoArgument,
    names_in,
)


def judge(
    video: VideoArgument,
    track: TrackArgument,
    out: Annotated[Path, output(help="Folder for judgement.json, a figure and report.html.")],
    measures: Annotated[
        str | None,
        asked(
            metavar="NAME,NAME",
            help=f"Which measures of loss: {', '.join(MEASURES)}. Otherwise all.",
            autocompletion=words_and_files(*MEASURES),
        ),
    ] = None,
    display: DisplayOption = None,
    fps: FpsOption = None,
    jobs: JobsOption = 0,
    modulation: Annotated[
        bool, expert(help="Whether to ask ColorVideoVDP, if installed, how visible the dimming itself is.")
    ] = True,
    no_cache: NoCacheOption = False,
    force: ForceOption = False,
    quiet: QuietOption = False,
) -> None:
    """Judge a track by several measures of what is lost, beside constant dimming."""
    from evenlight.analysis.judgement.judgement import judge_track
    from evenlight.data_schema.arguments import must_be_one_of, whole
    from evenlight.data_schema.storage.result_folders import result_folder
    from evenlight.data_schema.tracks.loaded_track import load_track
    from evenlight.method.choices import AnalysisEffort
    from evenlight.stimuli.dimmed.matched_track import display_of
    from evenlight.stimuli.sequences import open_as_read

    whole("jobs", jobs)
    names = tuple(dict.fromkeys(MEASURES if measures is None else names_in(measures)))
    for name in names:
        if name not in MEASURES:
            raise must_be_one_of("measures", name, MEASURES)
    loaded = load_track(track)
    with result_folder(out, "judge", force=force) as folder:
        found = judge_track(
            open_as_read(video, loaded.track.header.film, fps),
            display_of(loaded.track, None if display is None else str(display)),
            loaded,
            names,
            modulation=modulation,
            effort=AnalysisEffort(jobs),
            cached=not no_cache,
            quiet=quiet,
        )
        found.write(folder)
    if not quiet:
        words = "" if found.judgement.modulation else f"{found.judgement.modulation_note}\n"
        typer.echo(f"{found.summary()}\n{words}equal loss is not yet equal quality: docs/validity.md")
        typer.echo(f"results in {out}")
