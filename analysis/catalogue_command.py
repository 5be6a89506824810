"""The command that optimizes many videos on a cluster: `evenlight catalogue`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.analysis.track_options import (
    MIN_FACTORS,
    AcceptWideBandOption,
    ActuatorOption,
    BatteryOption,
    BudgetUnitOption,
    ContrastModelOption,
    DisplayOption,
    FieldOfViewOption,
    FpsOption,
    LimitCurveOption,
    MinFactorOption,
    ModulatedOption,
    NoCacheOption,
    NoPlayerOption,
    OtherDisplayOption,
    PowerModelOption,
    QuietOption,
    RateLimitOption,
    require_between,
)
from evenlight.cluster import LOCAL, cluster_option
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.choices import (
    DEFAULT_CALM,
    LimitCurve,
    ModulatedLuminance,
    ObjectiveName,
)
from evenlight.option_panels import asked, computation, output

if TYPE_CHECKING:
    from evenlight.analysis.catalogue.entries import CatalogueVideo
    from evenlight.data_schema.tracks.catalogue import CatalogueRow

FAILED = 1  # exit code where a video failed
PARTS = (10.0, 86400.0)  # [s]


def catalogue(
    source: Annotated[
        str,
        typer.Argument(
            help="The videos: a folder, a glob in quotes such as 'films/**/*.mkv', a URL of these, or a "
            "table (csv) with a column path, and others for what is asked of single videos.",
        ),
    ],
    budget: Annotated[
        float, asked(help="How much brightness or power each video may use, in --budget-unit.")
    ],
    out: Annotated[
        Path,
        output(help="Folder for a folder of results for each video, catalogue.csv, errors.csv, report.html."),
    ],
    budget_unit: BudgetUnitOption = BudgetUnit.FACTOR,
    shared_budget: Annotated[
        bool, asked("--shared-budget", help="One budget for all together: each video gets its share of it.")
    ] = False,
    display: DisplayOption = None,
    power_model: PowerModelOption = "surace2025",
    rate_limit: RateLimitOption = "surace2025",
    contrast_model: ContrastModelOption = "default",
    limit_curve: LimitCurveOption = LimitCurve.FITTED,
    modulated: ModulatedOption = ModulatedLuminance.FRAME_MEAN,
    min_factor: MinFactorOption = 0.2,
    field_of_view: FieldOfViewOption = None,
    actuator: ActuatorOption = Actuator.BACKLIGHT,
    fps: FpsOption = None,
    tolerance: Annotated[
        float,
        computation(help="Error of contrast loss to accept, as of `evenlight optimize`; 0: count all."),
    ] = 0.001,
    calm: Annotated[
        float, asked(metavar="SHARE", help="Share of the gain to give up for calmer tracks; 0: none.")
    ] = DEFAULT_CALM,
    objective: Annotated[
        ObjectiveName, asked(help="What to minimize, as of `evenlight optimize`.")
    ] = ObjectiveName.SPREAD,
    level_weight: Annotated[
        float | None, asked(metavar="WEIGHT", help="Weight of the mean loss in spread+mean, such as 0.5.")
    ] = None,
    other_display_ok: OtherDisplayOption = False,
    accept_wide_band: AcceptWideBandOption = False,
    battery_wh: BatteryOption = None,
    cluster: Annotated[str, cluster_option] = LOCAL,
    part_s: Annotated[
        float,
        computation(
            "--part-s", metavar="SECONDS",
            help="Length of the parts in which a long video is analysed where workers are idle.",
        ),
    ] = 120.0,
    no_cache: NoCacheOption = False,
    no_player: NoPlayerOption = False,
    quiet: QuietOption = False,
) -> None:  # fmt: skip
    """Find the brightness tracks of many or long videos, on all cores or on a cluster.

    Run again, it does only what is missing or has changed. A video that fails stops no other: exit code 1
    then, and errors.csv says why.
    """
    from evenlight.analysis.catalogue.entries import videos_of
    from evenlight.analysis.tracks.asked_track import AskedTrack

    require_between("--min-factor", min_factor, MIN_FACTORS)
    require_between("--calm", calm, (0.0, 1.0))
    require_between("--tolerance", tolerance, (0.0, 0.999))
    require_between("--part-s", part_s, PARTS)
    if shared_budget and objective is not ObjectiveName.SPREAD:
        raise InputError("--shared-budget evens out the spread over all videos; leave out --objective")
    every = AskedTrack(
        budget=budget,
        budget_unit=budget_unit,
        display=display,
        power_model=power_model,
        rate_limit=rate_limit,
        contrast_model=contrast_model,
        limit_curve=limit_curve,
        modulated=modulated,
        min_factor=min_factor,
        field_of_view=field_of_view,
        actuator=actuator,
        fps=fps,
        tolerance=tolerance,
        calm=calm,
        objective=objective,
        level_weight=level_weight,
        other_display_ok=other_display_ok,
        accept_wide_band=accept_wide_band,
        battery_wh=battery_wh,
        no_cache=no_cache,
        no_player=no_player,
    )
    every.posed()  # refuses what would be wrong of all
    videos = videos_of(source, every, out)
    if shared_budget and any(
        (one.asked.budget, one.asked.budget_unit) != (budget, budget_unit) for one in videos
    ):
        raise InputError(f"--shared-budget: leave out the columns budget and budget_unit of {source}")
    rows = _made(videos, out, part_s, cluster, shared_budget, quiet)
    if not quiet:
        _print_result(rows, out)
    if any(row.error for row in rows):
        raise typer.Exit(FAILED)


def _made(
    videos: Sequence[CatalogueVideo], out: Path, part: float, cluster: str, shared: bool, quiet: bool
) -> list[CatalogueRow]:
    """Make the results of all videos, and the tables and the report beside them."""
    from evenlight.analysis.catalogue.catalogue_report import write_catalogue
    from evenlight.analysis.catalogue.catalogue_run import run_catalogue, share_budget
    from evenlight.analysis.catalogue.results import CatalogueTask, remove_kept
    from evenlight.cluster import opened_cluster
    from evenlight.data_schema.storage.whole_files import make_folder, results_folder
    from evenlight.progress import shown_progress

    tasks = [CatalogueTask(video, out.resolve(), part) for video in videos]
    budget = videos[0].asked.budget if shared else None
    with opened_cluster(cluster, quiet) as workers, shown_progress(quiet) as progress:
        make_folder(out)
        failed: dict[int, CatalogueRow] = {}
        if shared:
            tasks, failed = share_budget(tasks, workers, progress)
        made = iter(run_catalogue(tasks, workers, progress))
        rows = [failed[number] if number in failed else next(made) for number in range(len(videos))]
        progress.step("report of the catalogue")
        with results_folder(out) as folder:
            write_catalogue(rows, folder, out, budget)
        if not any(row.error for row in rows):
            remove_kept(out)
    return rows


def _print_result(rows: Sequence[CatalogueRow], out: Path) -> None:
    """Print what came of the catalogue."""
    from evenlight.analysis.catalogue.catalogue_report import lead_of
    from evenlight.analysis.catalogue.entries import REPORT

    typer.echo(lead_of(rows))
    typer.echo(f"results in {out}; {out / REPORT} shows them")
