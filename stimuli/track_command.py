"""The commands of `evenlight track`: what is done with a track that was made."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.option_panels import QuietOption, expert
from evenlight.stimuli.dimmed.apply_options import DimmedVersion, ExportFormat

track = typer.Typer(invoke_without_command=True)


USES = {
    ExportFormat.FFMPEG: "ffmpeg -i VIDEO -filter_complex_script {out} -acodec copy -pix_fmt yuv420p OUT",
    ExportFormat.MPV: "mpv --script={out} VIDEO",
    ExportFormat.JSON: "times, factors and gamma, as docs/data-dictionary.md describes them",
}


@track.callback()
def start(context: typer.Context) -> None:
    """Hand a track on to other programs."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@track.command()
def export(
    track: Annotated[
        Path, typer.Argument(help="The track: the folder that `evenlight optimize` wrote, or track.csv.")
    ],
    to: Annotated[ExportFormat, typer.Option(help="A script for FFmpeg or mpv, or JSON.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="File to write.")],
    version: Annotated[
        DimmedVersion, typer.Option(help="Dimmed by the track, or constantly at equal power.")
    ] = DimmedVersion.OURS,
    display: Annotated[
        str | None,
        expert(help="Display of an older track, which does not name it itself: a preset or a toml file."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the file if it exists.")] = False,
    quiet: QuietOption = False,
) -> None:
    """Write a track for another program: FFmpeg, mpv, or anything that reads JSON."""
    from evenlight.data_schema.storage.whole_files import require_free
    from evenlight.data_schema.tracks.loaded_track import load_track
    from evenlight.stimuli.dimmed.matched_track import display_of
    from evenlight.stimuli.dimmed.track_export import exported_track, write_export

    require_free(out, force=force)
    if to is ExportFormat.MPV and out.suffix != ".lua":
        raise InputError(f"--out {out}: mpv knows scripts by their ending; give a name in .lua")
    loaded = load_track(track)
    made = exported_track(loaded, display_of(loaded.track, display), version)
    write_export(out, made, to.value)
    if not quiet:
        typer.echo(f"{out}: {len(made.times)} frames of {made.video}; {USES[to].format(out=out)}")
