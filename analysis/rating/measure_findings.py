"""Which measure of loss the ratings of a data set speak for: numbers, a figure, words, a contrast model."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from evenlight.analysis.figure_style import (
    FAINT,
    LIMIT,
    OURS,
    PAGE,
    FigureFormat,
    axes_at,
    heading_lines,
    lines_at,
    look,
    new_figure,
    png_bytes,
    text_size,
)
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.rating.measure_candidates import condition_losses, measure_candidates, rated_stimuli
from evenlight.analysis.rating.measure_fit import FittedCandidate, MeasureFit, fit_measure, told_choices
from evenlight.analysis.report import Cell, Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.session_loading import TaskData
from evenlight.data_schema.analysis_results import Origin, PlottedPoint, Statistic
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.viewing import RatingTrial, Stimulus

SHOWN = 16  # candidates of the grid in table and figure, beside the named ones
LIKELIHOOD = "ln likelihood less that of the best"


def measure_findings(
    data: TaskData[RatingTrial], stimuli: Path, report: Callable[[str], None] = lambda sequence: None
) -> Findings:
    """Fit the free choices of the measure of loss to the ratings of a data set.

    Parameters
    ----------
    data : TaskData of RatingTrial
        All sessions of the task.
    stimuli : Path
        Folder of the stimuli that were rated.
    report : callable, optional
        Called with the sequence whose frames are measured.

    Raises
    ------
    InputError
        If the stimuli are not those that were rated, or the ratings tell no measure from another.
    """
    candidates = measure_candidates()
    known = rated_stimuli(stimuli, _shown_stimuli(data))
    losses = {}
    for name, stimulus in known.items():
        report(name)
        losses.update(condition_losses({name: stimulus}, candidates))
    fit = fit_measure(data.trials, losses, candidates)
    origin = Origin.SIMULATED if data.simulated else Origin.RECORDED
    caption = (
        "How well measures of loss explain the ratings: natural logarithm of their likelihood, less that of "
        "the best. Grey: the 95 % set."
    )
    drawing = Drawing(
        "measure", png_bytes(measure_figure(fit, data.simulated)), caption, _points(fit, origin)
    )
    return Findings(
        name="measure",
        lead=prose("measure_lead", fit=fit, simulated=data.simulated)[0],
        statistics=tuple(_statistics(fit, origin)),
        drawings=(drawing,),
        sections=(
            section(
                "measure_fit", (_table(fit),), (drawing.picture,), simulated=data.simulated, fit=fit,
                told=told_choices(fit.n_sequences),
            ),
        ),
        presets={} if fit.usual.possible else {"fitted.contrast_model.toml": fit.best.candidate.model},
    )  # fmt: skip


def _shown_stimuli(data: TaskData[RatingTrial]) -> dict[str, Stimulus | None]:
    """Return the sequences that were rated, with what the sessions say they showed."""
    shown: dict[str, Stimulus | None] = dict.fromkeys(trial.sequence for trial in data.trials)
    for session in data.sessions:
        for stimulus in session.manifest.stimuli:
            before = shown.get(stimulus.name)
            if before is not None and before.track_sha256 != stimulus.track_sha256:
                raise InputError(
                    f"{session.folder}: showed another track of {stimulus.name} than sessions before it; a "
                    "measure can be fitted to ratings of the same stimuli only"
                )
            if stimulus.name in shown:
                shown[stimulus.name] = stimulus
    return shown


def _told(fit: MeasureFit) -> list[FittedCandidate]:
    """Return the candidates to be shown: the best of the grid, and all named ones with the plain mean."""
    best = fit.candidates[:SHOWN]
    named = [own for own in fit.candidates if own.candidate.name and own.candidate.pooling == 1]
    return [own for own in fit.candidates if own in best or own in named]


def _table(fit: MeasureFit) -> Table:
    """Return how well each candidate does."""
    rows: list[tuple[Cell, ...]] = [
        (
            own.candidate.words, own.log_likelihood - fit.best.log_likelihood,
            "yes" if own.possible else "no", own.effect.estimate,
        )
        for own in _told(fit)
    ]  # fmt: skip
    rows.append(("no loss at all", fit.without - fit.best.log_likelihood, "", None))
    rows.append(("an effect of its own in each sequence", fit.free - fit.best.log_likelihood, "", None))
    return Table(
        f"Measures of loss beside {fit.n} ratings by {fit.n_groups} participants: ln likelihood less that "
        "of the best, whether it is in the 95 % set, and its effect in log-odds of a higher rating per SD of "
        f"the loss. Of {len(fit.candidates)} candidates the {SHOWN} best and all named ones.",
        ("measure", LIKELIHOOD, "in the 95 % set", "effect"),
        tuple(rows),
    )


def _statistics(fit: MeasureFit, origin: Origin) -> Iterator[Statistic]:
    """Return every number, of all candidates."""
    of: dict[str, Any] = {"unit": "1", "origin": origin, "n": fit.n_groups}
    for own in fit.candidates:
        words = own.candidate.words
        short = own.log_likelihood - fit.best.log_likelihood
        flag = "" if own.possible else "not in the 95 % set"
        model = "cumulative-link mixed model"
        yield Statistic("candidates", words, LIKELIHOOD, short, method=model, flag=flag, **of)
        effect = own.effect
        yield Statistic(
            "candidates", words, "log-odds of a higher rating per SD of the loss", effect.estimate,
            p_value=effect.p_value, method=f"{model}, Wald", flag=effect.flag, **of,
        )  # fmt: skip
    tests = (
        ("likelihood ratio of the best against no loss", fit.best.log_likelihood - fit.without,
         fit.p_of_loss),
        ("likelihood ratio of free effects against the best", fit.free - fit.best.log_likelihood,
         fit.p_of_the_rest),
    )  # fmt: skip
    for what, gain, p_value in tests:
        yield Statistic("tests", "all", what, 2 * gain, p_value=p_value, method="chi-squared", **of)


def _points(fit: MeasureFit, origin: Origin) -> tuple[PlottedPoint, ...]:
    """Return every number that the figure draws."""
    return tuple(
        PlottedPoint(
            "measures", "in the 95 % set" if own.possible else "not in it", own.candidate.words,
            own.log_likelihood - fit.best.log_likelihood, None, LIKELIHOOD, "1", "measure", "1", origin,
            n=fit.n_groups,
        )
        for own in _told(fit)
    )  # fmt: skip


def measure_figure(fit: MeasureFit, simulated: bool, medium: FigureFormat = PAGE) -> Figure:
    """Draw the support of each candidate, best at the top.

    Parameters
    ----------
    fit : MeasureFit
        What is drawn.
    simulated : bool
        Whether simulated participants rated.
    medium : FigureFormat
        Where it is shown.
    """
    rows = _told(fit)
    with look(medium):
        em = medium.em
        left, width, names = 1.2 * em, medium.width - 2.4 * em, 28 * em
        who = "simulated participants" if simulated else "participants"
        title = f"Which measure of loss explains the ratings of {fit.n_groups} {who}?"
        words = "Filled, in the grey: measures that the ratings leave possible (95 %). Ring: the usual one."
        lines, above = heading_lines(title, words, width, em)
        height = 1.7 * em * len(rows)
        figure = new_figure(medium, above + height + 4.4 * em)
        lines_at(figure, left, lines)
        axes = axes_at(figure, left + names, above + em, width - names, height)
        for place, own in enumerate(rows):
            x = own.log_likelihood - fit.best.log_likelihood
            axes.axhline(-place, color=FAINT, linewidth=text_size() / 14, zorder=0)
            face = OURS if own.possible else "white"
            axes.plot(x, -place, "o", color=OURS, markerfacecolor=face, markersize=0.7 * text_size())
            if own.candidate == fit.usual.candidate:
                axes.plot(x, -place, "o", color=LIMIT, markerfacecolor="none", markersize=1.3 * text_size())
        axes.set(yticks=[-k for k in range(len(rows))], ylim=(-len(rows) + 0.4, 0.6), xlabel=LIKELIHOOD)
        axes.set_yticklabels([own.candidate.words for own in rows])
        axes.tick_params(axis="y", length=0)
        axes.axvspan(-fit.reach, 0, color=FAINT, alpha=0.5, linewidth=0, zorder=-1)
        lowest = min(own.log_likelihood for own in rows) - fit.best.log_likelihood
        axes.set_xlim(1.08 * min(lowest, -fit.reach), 0.06 * fit.reach)
        axes.spines["left"].set_visible(False)
    return figure
