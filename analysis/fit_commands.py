"""The command that turns trials into thresholds and a rate limit, sweeps into display and power models."""

from __future__ import annotations

import functools
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm, RateLimitModel
from evenlight.data_schema.recordings.ramp import Direction, Procedure
from evenlight.option_panels import output, viewing
from evenlight.progress import Progress, shown_progress

if TYPE_CHECKING:
    from evenlight.analysis.calibration.calibration import Calibration
    from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
    from evenlight.analysis.measurement.sweeps.sweep_loading import ChosenSweep
    from evenlight.analysis.measurement.sweeps.sweep_report import SweepResults
    from evenlight.analysis.ramp_loading import RampData
    from evenlight.stimuli.video.video_source import VideoSource


curve_option = functools.partial(typer.Option, rich_help_panel="The curve of the rate limit")
choice_option = functools.partial(typer.Option, rich_help_panel="Which answers, if there are several kinds")
trial_option = functools.partial(typer.Option, rich_help_panel="The video on which the curve is tried")


def fit(
    dataset: Annotated[
        Path,
        typer.Argument(
            help="Data set with ramp sessions, sweeps of a display, or both; or a folder of measured power "
            "or light."
        ),
    ],
    out: Annotated[Path, output(help="Folder for the results; those of sweeps get folders in it.")],
    model: Annotated[
        RateLimitModel | None,
        curve_option(
            help="joint: one model of all answers. individual: a threshold for each person and level, then a "
            "curve. pooled: as if all answers were one person's.",
            show_default="joint; individual with --form rate",
        ),
    ] = None,
    form: Annotated[
        RateLimitForm | None,
        curve_option(
            help="What the polynomial describes. Otherwise chosen by predictive score (joint), or ln_rate."
        ),
    ] = None,
    degree: Annotated[
        int | None,
        curve_option(help="Degree of the polynomial. Otherwise chosen by predictive score (joint), or 4."),
    ] = None,
    monotone: Annotated[
        bool, curve_option("--monotone", help="Allow only a curve that never falls with luminance (joint).")
    ] = False,
    procedure: Annotated[
        Procedure | None, choice_option(help="Which question's answers to fit, if there were several.")
    ] = None,
    direction: Annotated[
        Direction | None,
        choice_option(help="Fit falling or rising ramps. Otherwise those that are seen most easily."),
    ] = None,
    ramp_duration: Annotated[
        float | None,
        choice_option(
            metavar="SECONDS", help="Fit ramps of this duration. Otherwise those that are seen most easily."
        ),
    ] = None,
    clip: Annotated[
        str | None,
        trial_option(
            metavar="VIDEO",
            help="Video on which the choice of the curve is tried. Otherwise a short built-in sunrise.",
        ),
    ] = None,
    budget: Annotated[float, trial_option(help="Mean brightness factor for that video.")] = 0.4,
    no_clip: Annotated[bool, trial_option("--no-clip", help="Try the choice on no video.")] = False,
    power_model: Annotated[
        str | None, viewing(help="For measured power: a power model whose prediction is shown beside it.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print no progress and no closing lines.")] = False,
) -> None:
    """Turn answers into thresholds and a rate limit, and sweeps into models of a display and its power.

    The rate limit goes to `evenlight optimize --rate-limit`. Measured power and light are analysed, too.
    """
    from evenlight.analysis.calibration.choices.choice_on_clip import open_clip, require_budget
    from evenlight.analysis.calibration.choices.limit_choices_report import LOG_LOG_LIMIT, SAFE_LIMIT
    from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions, default_model
    from evenlight.analysis.earlier_results import files_in, remove_stale
    from evenlight.analysis.measurement.sweeps.sweep_loading import newest_sweeps
    from evenlight.analysis.ramp_loading import TASK, load_ramp_data
    from evenlight.analysis.session_loading import undamaged_roll
    from evenlight.data_schema.errors import InputError
    from evenlight.data_schema.recordings.dataset_layout import POWER_LOG, require_apart
    from evenlight.data_schema.recordings.light import LIGHT_LOG
    from evenlight.data_schema.storage.whole_files import results_folder

    require_apart(out, dataset)
    if (dataset / POWER_LOG).is_file():
        from evenlight.analysis.measurement.played_power.power_report import write_power_results
        from evenlight.method.preset_files import load_power_model

        panel = load_power_model(power_model) if power_model else None
        said = write_power_results(dataset, out, panel)
        if not quiet:
            typer.echo("\n".join(said))
        return
    if (dataset / LIGHT_LOG).is_file():
        from evenlight.analysis.measurement.light.light_results import write_light_results

        said = write_light_results(dataset, out)
        if not quiet:
            typer.echo("\n".join(said))
        return
    if power_model is not None:
        raise InputError("--power-model is for a folder of measured power (`evenlight play --measure-power`)")
    if no_clip and clip is not None:
        raise InputError(f"--no-clip and --clip {clip} contradict each other; give one of them")
    options = RateLimitOptions(
        form=form,
        degree=degree,
        ramp_duration=ramp_duration,
        direction=direction,
        procedure=procedure,
        model=model or default_model(form),
        monotone=monotone,
    )
    require_budget(budget)
    sweeps = newest_sweeps(dataset)
    task, roll = None, undamaged_roll(dataset)
    if not sweeps or TASK in roll.tasks:
        source = None if no_clip else open_clip(clip)
        task = _Task(load_ramp_data(dataset, roll), options, source, budget)
        roll = task.data.roll or roll
    with results_folder(out) as folder, shown_progress(quiet) as progress:
        results = _write_results(task, folder, progress) if task else None
        measured = _write_sweeps(sweeps, folder, needed=task is None) if sweeps else None
        written = files_in(folder)
    if results:  # an earlier fit's edge or curve does not belong to this one's limit
        remove_stale(out, (SAFE_LIMIT, LOG_LOG_LIMIT), written)
    warnings = (*(results.warnings if results else ()), *(measured.warnings if measured else ()))
    for warning in (*warnings, *roll.warnings):
        print(f"evenlight: warning: {warning}", file=sys.stderr)
    if not quiet:
        if results:
            _tell(results, out)
        if measured:
            typer.echo("\n".join((*measured.lines, f"the files of sweeps are in {out}")))


def _write_sweeps(sweeps: tuple[ChosenSweep, ...], folder: Path, *, needed: bool) -> SweepResults:
    """Fit the sweeps and write their files."""
    from evenlight.analysis.measurement.sweeps.sweep_report import write_chosen_sweeps

    return write_chosen_sweeps(sweeps, folder, needed=needed)


@dataclass(frozen=True, slots=True)
class _Task:
    """What is fitted, how, and on which clip the choice of the curve is tried."""

    data: RampData
    options: RateLimitOptions
    source: VideoSource | None
    budget: float


def _write_results(task: _Task, folder: Path, progress: Progress) -> Calibration:
    """Fit, compare the curves, and write every file."""
    from evenlight.analysis.calibration.calibration import calibrate
    from evenlight.analysis.calibration.choices.choice_on_clip import compare_on_clip, curves_of
    from evenlight.analysis.calibration.choices.limit_choices import limit_choices
    from evenlight.analysis.calibration.choices.limit_choices_report import write_limit_choices
    from evenlight.analysis.calibration.fit_report import (
        FitResults,
        write_calibration,
        write_figures,
        write_fit_report,
    )
    from evenlight.data_schema.provenance import provenance_now
    from evenlight.method.preset_files import load_power_model

    progress.step("fitting thresholds and curve")
    calibration = calibrate(task.data, task.options, progress.at)
    inputs = {"dataset": task.data.sha256}
    write_calibration(calibration, folder, provenance_now(inputs=inputs))
    write_figures(calibration, folder)
    progress.step("comparing other curves")
    choices = limit_choices(calibration, task.options)
    comparison = None
    if task.source is not None:
        progress.step(f"analysing {task.source.name}", task.source.n_frames)
        curves = curves_of(task.source, task.data.display, progress.at)
        progress.step("trying other curves on it")
        comparison = compare_on_clip(choices, curves, task.budget, load_power_model("surace2025"))
        inputs["clip"] = task.source.sha256()
    origin = provenance_now(inputs=inputs)
    write_limit_choices(folder, choices, comparison, origin)
    write_fit_report(folder, FitResults(calibration, choices, comparison, origin))
    return calibration


def _tell(calibration: Calibration, out: Path) -> None:
    """Say what was found, in a few lines."""
    data, thresholds = calibration.data, calibration.thresholds
    limit = calibration.rate_limit.limit
    kind = "simulated participants" if data.simulated else "participants"
    typer.echo(_limit_in_words(limit))
    typer.echo(
        f"{len(thresholds)} thresholds of {len(data.participant_ids)} {kind}, and a rate limit "
        f"({calibration.models.chosen.value} model, {limit.form.value} of degree "
        f"{len(limit.coefficients) - 1}), in {out}"
    )
    typer.echo(f"{out / 'report.html'} has the details")


def _limit_in_words(limit: RateLimit) -> str:
    """Return how fast a display may change in the middle of the luminances that were shown."""
    import numpy as np

    from evenlight.method.rate_limit import rate_limit_at

    middle = sum(limit.luminance_range) / 2
    rate = float(rate_limit_at(limit, middle))
    band = ""
    if limit.band_luminance:
        low, high = (
            np.interp(middle, limit.band_luminance, edge) for edge in (limit.band_lower, limit.band_upper)
        )
        band = f" ({limit.band_words}: {low:.3g} to {high:.3g})"
    return f"{limit.display_name} may change by {rate:.3g} cd/m²/s at {middle:.3g} cd/m²{band}"
