"""The command that turns a video and a power budget into a brightness track."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.analysis.track_options import (
    AcceptWideBandOption,
    ActuatorOption,
    BatteryOption,
    BudgetUnitOption,
    ContrastModelOption,
    CurvesOption,
    DeviceOption,
    DisplayOption,
    FieldOfViewOption,
    FpsOption,
    JobsOption,
    LimitCurveOption,
    MinFactorOption,
    ModulatedOption,
    NoCacheOption,
    NoPlayerOption,
    OtherDisplayOption,
    PowerModelOption,
    QuietOption,
    RateLimitOption,
    VideoArgument,
    borrowed_line,
    check_video,
    chosen_device,
    require_curves_to_compute,
    require_there,
    results_in,
)
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import require_seed
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.choices import (
    DEFAULT_CALM,
    Device,
    LimitCurve,
    ModulatedLuminance,
    ObjectiveName,
    SolverName,
)
from evenlight.method.contrast.measures import MEASURES, ROBUST, measures_named
from evenlight.option_panels import asked, computation, limits, output

if TYPE_CHECKING:
    from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary


def optimize(
    video: VideoArgument,
    budget: Annotated[float, asked(help="How much brightness or power may be used, in --budget-unit.")],
    out: Annotated[Path, output(help="Folder for track.csv, summary.json, track.png, player.html and more.")],
    budget_unit: BudgetUnitOption = BudgetUnit.FACTOR,
    display: DisplayOption = None,
    power_model: PowerModelOption = "surace2025",
    rate_limit: RateLimitOption = "surace2025",
    contrast_model: ContrastModelOption = "default",
    solver: Annotated[
        SolverName,
        computation(
            help="splitting is fast; slsqp is the paper's; highs and clarabel are general solvers, "
            "for short clips."
        ),
    ] = SolverName.SPLITTING,
    limit_curve: LimitCurveOption = LimitCurve.FITTED,
    modulated: ModulatedOption = ModulatedLuminance.FRAME_MEAN,
    min_factor: MinFactorOption = 0.2,
    field_of_view: FieldOfViewOption = None,
    actuator: ActuatorOption = Actuator.BACKLIGHT,
    fps: FpsOption = None,
    curves: CurvesOption = None,
    tolerance: Annotated[
        float,
        computation(
            help="Error of contrast loss to accept, so that fine detail is counted only where it changes; "
            "0: count all."
        ),
    ] = 0.001,
    jobs: JobsOption = 1,
    device: DeviceOption = Device.CPU,
    weights: Annotated[
        Path | None, asked(help="Table of scenes that count more or less: csv with start_s,end_s,weight.")
    ] = None,
    allowances: Annotated[
        Path | None,
        limits(
            help="Table of moments with another rate limit: csv with start_s,end_s,allowance. An allowance "
            "multiplies the limit; 0 allows no change."
        ),
    ] = None,
    with_: Annotated[
        list[str] | None, asked("--with", metavar="VIDEO", help="Another clip that shares the budget.")
    ] = None,
    start: Annotated[
        Path | None,
        computation(help="Earlier result to start from (track.csv or its folder), of another edit, say."),
    ] = None,
    calm: Annotated[
        float,
        asked(
            metavar="SHARE",
            help="Share of the gain to give up for a track that turns back less often; 0: the exact optimum.",
        ),
    ] = DEFAULT_CALM,
    robust: Annotated[
        bool,
        asked(
            "--robust",
            help="Minimize the worst result among several measures of loss (--measures). Not together with "
            "--curves, --with, --device, --start, --contrast-model or --objective.",
        ),
    ] = False,
    measures: Annotated[
        str | None,
        asked(
            metavar="NAME,NAME",
            help=f"Measures for --robust, separated by commas: {', '.join(MEASURES)}.",
            show_default=",".join(ROBUST),
        ),
    ] = None,
    objective: Annotated[
        ObjectiveName,
        asked(
            help="What to minimize: differences of loss between frames (spread), these and the mean loss, "
            "or the largest loss of any frame."
        ),
    ] = ObjectiveName.SPREAD,
    level_weight: Annotated[
        float | None, asked(metavar="WEIGHT", help="Weight of the mean loss in spread+mean, such as 0.5.")
    ] = None,
    other_display_ok: OtherDisplayOption = False,
    accept_wide_band: AcceptWideBandOption = False,
    battery_wh: BatteryOption = None,
    seed: Annotated[int, computation(help="Seed of the random start of slsqp.")] = 1,
    no_cache: NoCacheOption = False,
    no_player: NoPlayerOption = False,
    quiet: QuietOption = False,
) -> None:
    """Find the brightness track of a video: how bright each frame is shown to meet a power budget.

    Frames lose more nearly the same share of visible contrast than if all were dimmed alike, and brightness
    never changes faster than the rate limit.
    """
    from evenlight.analysis.earlier_results import files_in, remove_earlier_track
    from evenlight.analysis.tracks.asked_track import AskedTrack
    from evenlight.analysis.tracks.track_results import run_optimization
    from evenlight.data_schema.storage.whole_files import results_folder
    from evenlight.stimuli.sequences import open_videos

    check_video(video, min_factor, field_of_view, jobs)
    require_curves_to_compute(curves, jobs, device)
    if not 0 <= calm <= 1:
        raise InputError(f"--calm must lie between 0 and 1, got {calm:g}")
    if not 0 <= tolerance < 1:
        raise InputError(
            f"--tolerance must lie in 0 (count all of every frame) to below 1, got {tolerance:g}"
        )
    judged = _robust_measures(robust, measures)
    if judged:
        given = {"--curves": curves, "--with": with_, "--device": device is not Device.CPU, "--start": start,
                 "--contrast-model": contrast_model != "default",
                 "--objective": objective is not ObjectiveName.SPREAD}  # fmt: skip
        refused = [name for name, is_given in given.items() if is_given]
        if refused:
            raise InputError(f"--robust analyses one video by each measure; leave out {', '.join(refused)}")
    require_seed(seed)
    require_there("--start", start, "a track.csv, or the folder of an earlier result")
    require_there("--weights", weights, "a csv table start_s,end_s,weight")
    require_there("--allowances", allowances, "a csv table start_s,end_s,allowance")
    if start is not None and solver is not SolverName.SPLITTING:
        raise InputError(f"--start is for --solver splitting; {solver.value} starts on its own")
    asked = AskedTrack(
        budget=budget,
        budget_unit=budget_unit,
        display=display,
        power_model=power_model,
        rate_limit=rate_limit,
        contrast_model=contrast_model,
        solver=solver,
        limit_curve=limit_curve,
        modulated=modulated,
        min_factor=min_factor,
        field_of_view=field_of_view,
        actuator=actuator,
        fps=fps,
        curves=curves,
        tolerance=tolerance,
        weights=weights,
        allowances=allowances,
        calm=calm,
        objective=objective,
        level_weight=level_weight,
        other_display_ok=other_display_ok,
        accept_wide_band=accept_wide_band,
        battery_wh=battery_wh,
        seed=seed,
        no_cache=no_cache,
        no_player=no_player,
    )
    panel, request = asked.posed()
    if curves is not None and with_:
        raise InputError("--curves holds the loss curves of one video; leave it out where --with adds others")
    source, *others = open_videos([video, *(with_ or ())], fps)
    computer = Device.CPU if curves else chosen_device(device, panel, asked.model(judged)[0], quiet)
    work = asked.job(
        source, (panel, request), others,
        start=start, robust=judged, jobs=jobs, device=computer, quiet=quiet,
    )  # fmt: skip
    with results_folder(out) as folder:
        summary = run_optimization(work, folder)
        written = files_in(folder)
    remove_earlier_track(out, written)
    if not quiet:
        _print_result(summary, borrowed_line(request.rate_limit, panel) + results_in(out))


def _robust_measures(robust: bool, measures: str | None) -> tuple[str, ...]:
    """Return the measures of a robust track; none if it is not to be one."""
    if measures is not None and not robust:
        raise InputError(f"--measures {measures} is for --robust, which is missing")
    if not robust:
        return ()
    if measures is None:
        return ROBUST
    return measures_named([name for item in measures.split(",") if (name := item.strip())])


def _print_result(summary: OptimizationSummary, closing: str) -> None:
    """Print what is gained in plain words, then what was achieved in figures."""
    from evenlight.analysis.tracks.gain_words import gain_in_words
    from evenlight.analysis.tracks.objective_words import minimized_in_words, spread_in_words
    from evenlight.analysis.wording import detection_in_words, percent

    weighted = "weighted by --weights, " if summary.weighted else ""
    minimized = minimized_in_words(summary)
    procedure = summary.rate_limit_procedure
    known = [procedure.value] if procedure else []
    known += ["simulated"] if summary.simulated else []
    asked = f" ({', '.join(known)})" if known else ""
    accepted = ", whose wide or missing band was accepted" if summary.wide_band_accepted else ""
    for line in gain_in_words(summary):
        typer.echo(line)
    typer.echo(
        f"{summary.frames} frames, mean factor {summary.mean_factor:.4g}\n"
        f"{minimized and minimized + chr(10)}{weighted}{spread_in_words(summary)}\n"
        f"fastest change {percent(summary.max_rate_ratio)} of the rate limit {summary.rate_limit!r}{asked}"
        f"{accepted}{beyond_the_fitted(summary)}\n"
        f"{detection_in_words(summary)}\n"
        f"{closing}"
    )


def beyond_the_fitted(summary: OptimizationSummary) -> str:
    """Return how much faster than the fitted limit brightness changes, where allowances say that it may."""
    allowance, ratio = summary.largest_allowance or 0.0, summary.max_rate_ratio_fitted or 0.0
    if not allowance > 1:
        return ""
    if ratio > 1 + 1e-6:
        return f" as allowed;\nwhere allowances say so, up to {ratio:.3g} times the fitted limit"
    return f" as allowed;\nnowhere beyond the fitted limit, though allowances go up to {allowance:g} times it"
