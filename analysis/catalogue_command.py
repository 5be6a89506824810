"""The command that optimizes many videos on a cluster: `evenlight catalogue`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from evenlight.analysis.tracks.track_request import TrackRequest, WantedOfAll
from evenlight.cluster import LOCAL, cluster_option
from evenlight.option_panels import ForceOption, QuietOption, output, with_options

FAILED = 1  # exit code where a video failed


@dataclass(frozen=True, kw_only=True)
class CatalogueOptions:
    """What `evenlight catalogue` takes beside what is wanted of all videos."""

    source: Annotated[
        str,
        typer.Argument(
            help="The videos: a folder, a glob in quotes such as 'films/**/*.mkv', a URL of these, or a "
            "table (csv) with a column path, and others for what is asked of single videos.",
        ),
    ]
    out: Annotated[
        Path,
        output(help="Folder for a folder of results for each video, catalogue.csv, report.html."),
    ]
    cluster: Annotated[str, cluster_option] = LOCAL
    force: ForceOption = False
    quiet: QuietOption = False


def _catalogue(wanted: WantedOfAll, of: CatalogueOptions) -> None:
    """Find the brightness tracks of many videos, on all cores or on a cluster.

    Run again, it does only what is missing or has changed. A video that fails stops no other: exit code 1
    then, and catalogue.csv says why.
    """
    from evenlight.analysis.catalogue.catalogue_report import Catalogue
    from evenlight.analysis.catalogue.catalogue_results import run_catalogue
    from evenlight.analysis.catalogue.entries import REPORT, RESERVED, videos_of
    from evenlight.cluster import opened_cluster
    from evenlight.data_schema.storage.result_folders import growing_folder
    from evenlight.progress import shown_progress

    wanted.check()
    every = TrackRequest(**vars(wanted))
    every.posed()  # refuses what would be wrong of all
    videos = videos_of(of.source, every, of.out)
    with (
        opened_cluster(of.cluster, of.quiet) as workers,
        growing_folder(of.out, "catalogue", RESERVED, force=of.force),
        shown_progress(of.quiet) as progress,
    ):
        found = Catalogue(tuple(run_catalogue(videos, workers, progress, force=of.force)), of.out)
        progress.step("report of the catalogue")
        found.write(of.out)
    if not of.quiet:
        typer.echo(found.first_lines[0])
        typer.echo(f"results in {of.out}; {of.out / REPORT} shows them")
    if any(row.error for row in found.rows):
        raise typer.Exit(FAILED)


catalogue = with_options(_catalogue, WantedOfAll, CatalogueOptions)
