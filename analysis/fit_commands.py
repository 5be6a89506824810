"""The command that turns trials into thresholds and a rate limit, sweeps into display and power models."""

from __future__ import annotations

import functools
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from evenlight.data_schema.rate_limit import RateLimitForm, RateLimitModel, Sigmoid
from evenlight.data_schema.recordings.ramp import Direction, Procedure
from evenlight.option_panels import ForceOption, PreregisteredOption, QuietOption, expert, output
from evenlight.progress import shown_progress

curve_option = functools.partial(typer.Option, rich_help_panel="The curve of the rate limit")
choice_option = functools.partial(typer.Option, rich_help_panel="Which answers, if there are several kinds")


def fit(
    dataset: Annotated[
        Path,
        typer.Argument(
            help="Data set with ramp sessions, sweeps of a display, or both; or a folder of measured power."
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
        expert(
            help="What the polynomial describes. Otherwise chosen by predictive score (joint), or ln_rate."
        ),
    ] = None,
    degree: Annotated[
        int | None,
        expert(help="Degree of the polynomial. Otherwise chosen by predictive score (joint), or 4."),
    ] = None,
    monotone: Annotated[
        bool, expert("--monotone", help="Allow only a curve that never falls with luminance (joint).")
    ] = False,
    sigmoid: Annotated[
        Sigmoid, expert(help="Which psychometric function the joint model has; single thresholds: logistic.")
    ] = Sigmoid.LOGISTIC,
    procedure: Annotated[
        Procedure | None, expert(help="Which question's answers to fit, if there were several.")
    ] = None,
    direction: Annotated[
        Direction | None,
        expert(help="Fit falling or rising ramps. Otherwise those that are seen most easily."),
    ] = None,
    ramp_duration: Annotated[
        float | None,
        expert(
            metavar="SECONDS", help="Fit ramps of this duration. Otherwise those that are seen most easily."
        ),
    ] = None,
    power_model: Annotated[
        str | None, expert(help="For measured power: a power model whose prediction is shown beside it.")
    ] = None,
    checks: Annotated[
        bool,
        curve_option("--checks", help="Say how the joint model fits; needs the extra bayes (ArviZ)."),
    ] = False,
    preregistered: PreregisteredOption = None,
    force: ForceOption = False,
    quiet: QuietOption = False,
) -> None:
    """Turn answers into thresholds and a rate limit, and sweeps into models of a display and its power.

    The rate limit goes to `evenlight optimize --rate-limit`. Measured power is analysed, too.
    """
    from evenlight.analysis.calibration.calibration import NoRateLimitError, calibrate
    from evenlight.analysis.calibration.fit_report import write_fit, write_without_limit
    from evenlight.analysis.calibration.inference_data import arviz
    from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions, default_model
    from evenlight.analysis.plans.preregistration import departures_of, registered_in
    from evenlight.analysis.ramp_loading import TASK, load_ramp_data
    from evenlight.analysis.session_loading import undamaged_roll
    from evenlight.analysis.sweeps.sweep_loading import newest_sweeps
    from evenlight.analysis.sweeps.sweep_report import write_chosen_sweeps
    from evenlight.data_schema.errors import ArgumentError, InputError
    from evenlight.data_schema.provenance import provenance_now
    from evenlight.data_schema.recordings.dataset_layout import POWER_LOG, require_apart
    from evenlight.data_schema.storage.result_folders import result_folder

    require_apart(out, dataset)
    if checks:
        arviz()
    if (dataset / POWER_LOG).is_file():
        registered_in(dataset, (), preregistered)
        from evenlight.analysis.played_power.power_report import write_power_results
        from evenlight.method.preset_files import load_power_model

        panel = load_power_model(power_model) if power_model else None
        said = write_power_results(dataset, out, panel, force=force)
        if not quiet:
            typer.echo("\n".join(said))
        return
    if power_model is not None:
        raise ArgumentError("power_model", "is for a folder of measured power (`evenlight measure played`)")
    options = RateLimitOptions(
        form=form,
        degree=degree,
        ramp_duration=ramp_duration,
        direction=direction,
        procedure=procedure,
        model=model or default_model(form),
        monotone=monotone,
        sigmoid=sigmoid,
    )
    sweeps = newest_sweeps(dataset)
    data, roll = None, undamaged_roll(dataset)
    ramps = not sweeps or TASK in roll.tasks
    plans = registered_in(dataset, (TASK,) if ramps else (), preregistered)
    if ramps:
        data = load_ramp_data(dataset, roll)
        roll = data.roll or roll
        data = replace(data, departures=departures_of(plans, {TASK: (data, options)}))
    with result_folder(out, "fit", force=force) as folder, shown_progress(quiet) as progress:
        results = refused = None
        if data:
            progress.step("fitting thresholds and curve")
            origin = provenance_now(inputs={"dataset": data.sha256})
            try:
                results = write_fit(calibrate(data, options, progress.at), folder, origin, checks)
            except NoRateLimitError as error:
                write_without_limit(error, folder, origin)
                refused = error
        told, doubts = write_chosen_sweeps(sweeps, folder, needed=data is None)
    warnings = (*(results.warnings if results else ()), *doubts)
    for warning in (*warnings, *roll.warnings):
        print(f"evenlight: warning: {warning}", file=sys.stderr)
    if not quiet:
        for line in data.departures if data else ():
            typer.echo(line)
        if results:
            typer.echo(f"{results.summary()}\n{out / 'report.html'} has the details")
        if sweeps:
            typer.echo("\n".join((*told, f"the files of sweeps are in {out}")))
    if refused:
        raise InputError(f"{refused}; {out / 'report.html'} has the answers and thresholds")
