"""A brightness track, and constant dimming, by several measures of loss: numbers and files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import stats

from evenlight.analysis import figure_style as style
from evenlight.analysis.judgement.modulation import installed_metric, judged_modulation
from evenlight.analysis.report import Cell, KeyFigure, Picture, Report, Table, write_report
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.results import Result
from evenlight.analysis.tracks.frame_samples import FrameSamples
from evenlight.analysis.tracks.optimization_job import OptimizationJob, loss_curves_of
from evenlight.analysis.tracks.other_measures import measured_track
from evenlight.analysis.tracks.track_words import less_or_more
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import mapping_from_record, sha256_of_record
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.brightness_track import require_display_of
from evenlight.data_schema.tracks.judgement import (
    Judgement,
    MeasureAgreement,
    ModulationStretch,
)
from evenlight.data_schema.tracks.loaded_track import LoadedTrack, mean_factor
from evenlight.method.choices import ONE_CORE, AnalysisEffort
from evenlight.method.contrast.curve_lookup import loss_at
from evenlight.method.contrast.measures import COUNTED, measure_named
from evenlight.method.optimizer.request import Request
from evenlight.method.preset_files import load_power_model, load_rate_limit
from evenlight.stimuli.dimmed.track_fit import require_fit, require_times
from evenlight.stimuli.video.video_source import VideoSource
from evenlight.stimuli.video.viewing_geometry import PIXEL_FOR_PIXEL

if TYPE_CHECKING:
    import pandas as pd

LOWEST_FACTOR = 0.2  # of the curves, unless the track goes lower: those that `evenlight optimize` has
ROW = 2.4  # em of height, of a measure
LITTLE = 0.3  # rank correlation below which measures hardly agree


def judge_track(
    source: VideoSource,
    display: Display,
    loaded: LoadedTrack,
    measures: Sequence[str],
    *,
    modulation: bool = True,
    effort: AnalysisEffort = ONE_CORE,
    cached: bool = False,
    quiet: bool = False,
) -> JudgedTrack:
    """Judge a track by measures, some of `MEASURES`; and by ColorVideoVDP how visible its movement is.

    Raises
    ------
    InputError
        If the track is none of the video's, or was made for another display.
    """
    track, constant = loaded.track, loaded.baseline
    made = track.header
    require_display_of(made, display, display.name)
    require_fit(source, track)
    # Of a request, loss curves take nothing.
    presets = load_power_model("surace2025"), load_rate_limit("surace2025")
    job = OptimizationJob(
        source,
        display,
        Request(made.budget, made.budget_unit, *presets),
        min_factor=min(LOWEST_FACTOR, constant, float(track.factors.min())),
        field_of_view=made.field_of_view or PIXEL_FOR_PIXEL,
        actuator=made.actuator,
        effort=effort,
        cached=cached,
        quiet=quiet,
    )
    models = {name: measure_named(name) for name in measures}
    losses = {
        name: _losses(replace(job, model=model, model_name=name), loaded) for name, model in models.items()
    }
    left_out: tuple[tuple[ModulationStretch, ...], str] = (), "Left out by --no-modulation"
    stretches, note = (
        judged_modulation(source, display, track, installed_metric()) if modulation else left_out
    )
    inputs = {"video": source.sha256(), "track": loaded.sha256, "display": sha256_of_record(display)}
    inputs |= {f"measure_{name}": sha256_of_record(model) for name, model in models.items()}
    return JudgedTrack(
        Judgement(
            video=source.name,
            display=display.name,
            field_of_view=made.field_of_view,
            frames=len(track.times),
            mean_factor=mean_factor(track),
            constant_factor=constant,
            measured=tuple(measured_track(name, *both) for name, both in losses.items()),
            agreements=agreements_of({name: evenly for name, (_, evenly) in losses.items()}),
            modulation=stretches,
            modulation_note=note,
            provenance=provenance_now(inputs=inputs),
        )
    )


def _losses(job: OptimizationJob, loaded: LoadedTrack) -> tuple[Array, Array]:
    """Return the losses of the frames by the job's measure: dimmed by the track, and evenly, (N,)."""
    curves = loss_curves_of(job, FrameSamples(most=1, least=1))
    require_times(job.source.name, curves.times, loaded.track)
    evenly = np.full(curves.n_frames, loaded.baseline)
    return loss_at(curves, loaded.track.factors), loss_at(curves, evenly)


def agreements_of(losses: Mapping[str, Array]) -> tuple[MeasureAgreement, ...]:
    """Return the rank correlation of each pair of measures over the frames, evenly dimmed, (N,)."""
    return tuple(
        MeasureAgreement(a, b, rank_correlation(losses[a], losses[b])) for a, b in combinations(losses, 2)
    )


def rank_correlation(first: Array, second: Array) -> float | None:
    """Return Spearman's rank correlation; None where one is the same in all frames.

    >>> round(rank_correlation(np.array([0.1, 0.2, 0.3, 0.4]), np.array([1.0, 3.0, 2.0, 4.0])), 3)
    0.8
    """
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return None
    return float(np.clip(stats.spearmanr(first, second).statistic, -1.0, 1.0))


@dataclass(frozen=True, slots=True, repr=False)
class JudgedTrack(Result):
    """What several measures say of a track: `judgement.json` as a result.

    Attributes
    ----------
    judgement : Judgement
        All numbers.
    """

    made_by: ClassVar = "judge"
    judgement: Judgement

    @property
    def heading(self) -> str:
        """What it is."""
        return f"{self.judgement.video}, judged by several measures"

    @property
    def first_lines(self) -> tuple[str, tuple[KeyFigure, ...]]:
        """What the measures say, the most favourable one first, and where they disagree."""
        own, figures = self.judgement, []
        ranked = sorted(
            (one for one in own.measured if one.gain is not None), key=lambda one: -(one.gain or 0)
        )
        ends = dict.fromkeys((*ranked[:1], *ranked[-1:]))  # the best and the worst; the same of one measure
        for one in ends:
            gain, words = one.gain or 0.0, f"difference of loss, by the measure {one.measure}"
            beside = f"{100 * one.spread:.2f} points, {100 * one.spread_constant:.2f} at constant dimming"
            figures.append(KeyFigure(less_or_more(gain), words, beside, warns=gain < 0))
        if known := [pair for pair in own.agreements if pair.correlation is not None]:
            least = min(known, key=lambda pair: pair.correlation or 0.0)
            rho, words = least.correlation or 0.0, f"{least.first} and {least.second}"
            figures.append(KeyFigure(f"{rho:.2f}", "lowest rank correlation", words, warns=rho < LITTLE))
        if own.modulation:
            worst = min(own.modulation, key=lambda one: one.jod)
            beside = f"{worst.jod_flicker:.2f} for a flicker of 2 %; 10 is no difference"
            figures.append(KeyFigure(f"{worst.jod:.2f} JOD", "movement, by ColorVideoVDP", beside))
        said = [f"{less_or_more(one.gain or 0.0)} ({one.measure})" for one in ends]
        lead = prose("judge_lead", video=own.video, said=said, constant=f"{own.constant_factor:.3g}")
        return lead[0], tuple(figures)

    @property
    def figures(self) -> Mapping[str, Figure]:
        """Its figure."""
        return {"judgement": judgement_figure(self.judgement)}

    def to_frame(self) -> pd.DataFrame:
        """Return what each measure says, a row each: `measured` in `judgement.json`."""
        import pandas as pd

        return pd.DataFrame([mapping_from_record(one) for one in self.judgement.measured])

    def write(self, folder: Path) -> None:
        """Write `judgement.json`, `judgement.png` and `report.html`."""
        write_json_record(folder / "judgement.json", self.judgement)
        picture = style.write_figure(folder / "judgement.png", judgement_figure(self.judgement))
        write_report(folder / "report.html", self.report(picture))

    def report(self, picture: bytes) -> Report:
        """Return the report around its picture."""
        lead, key_figures = self.first_lines
        caption = "Difference of loss by each measure (left), and rank correlation of the measures (right)."
        own, pictures = self.judgement, [Picture(picture, caption)]
        measures = section("judge_measures", _measure_tables(own), pictures, judgement=own)
        movement = section("judge_modulation", _modulation_tables(own), judgement=own)
        sections = (measures, movement, section("judge_limits"))
        return Report(self.heading, lead, sections, key_figures=key_figures)


def _measure_tables(judgement: Judgement) -> list[Table]:
    rows: list[tuple[Cell, ...]] = []
    for one in judgement.measured:
        compared = None if one.gain is None else less_or_more(one.gain)
        losses = (one.mean_loss, one.mean_loss_constant, one.largest_loss, one.largest_loss_constant)
        spreads = (f"{100 * number:.2f}" for number in (one.spread, one.spread_constant))
        rows.append((one.measure, *spreads, compared, *(f"{100 * number:.2f}" for number in losses)))
    numbers = Table(
        "Loss of visible contrast of the track and of constant dimming, by each measure: mean "
        "difference between two frames [percentage points], mean and largest of the frames [%].",
        ("measure", "difference", "constant", "compared", "mean loss", "constant", "largest", "constant"),
        tuple(rows),
    )
    counted = tuple((one.measure, COUNTED.get(one.measure)) for one in judgement.measured)
    return [numbers, Table("What each measure counts as lost.", ("measure", "lost"), counted)]


def _modulation_tables(judgement: Judgement) -> list[Table]:
    rows: list[tuple[Cell, ...]] = []
    for one in judgement.modulation:
        factors = f"{one.lowest_factor:.3f} to {one.highest_factor:.3f}"
        jods = f"{one.jod:.3f}", f"{one.jod_flicker:.3f}"
        rows.append((f"{one.begin:.1f} to {one.end:.1f}", factors, *jods))
    columns = ("time [s]", "factor", "JOD, track", "JOD, flicker of 2 %")
    return [Table("Quality beside the same stretch dimmed evenly.", columns, tuple(rows))] if rows else []


def judgement_figure(judgement: Judgement) -> Figure:
    """Draw the spread of loss by each measure, and the rank correlation of each pair of measures."""
    words = (
        "Left: how differently the frames lose contrast, beside constant dimming. Right: rank "
        "correlation of the measures over the frames, at constant dimming."
    )
    with style.look():
        em, n = style.PAGE.em, len(judgement.measured)
        title = f"{judgement.video} by {n} measure{'s' * (n > 1)} of loss"
        lines, above = style.heading_lines(title, words, style.PAGE.width - 4 * em, em)
        top, height = above + 3.0 * em, max(n, 2) * ROW * em
        figure = style.new_figure(top + height + 6 * em)
        style.lines_at(figure, 2 * em, lines)
        half = (style.PAGE.width - 24 * em) / 2
        _spreads(style.axes_at(figure, 9.5 * em, top, half + 2.5 * em, height), judgement)
        _agreements(style.axes_at(figure, 22 * em + half, top, half - 2 * em, height), judgement)
    return figure


def _spreads(axes: Axes, judgement: Judgement) -> None:
    """Draw the spread of the track as a share of that of constant dimming: the measures' units differ."""
    rows = np.arange(len(judgement.measured))
    shares = [np.nan if one.gain is None else 100 * (1 - one.gain) for one in judgement.measured]
    axes.axvline(100, color=style.BASELINE, label="constant dimming")
    axes.hlines(rows, np.minimum(shares, 100), np.maximum(shares, 100), color=style.FAINT, lw=3)
    axes.plot(shares, rows, "D", color=style.OURS, label="track")
    axes.set(xlabel="difference of loss between frames [% of constant dimming's]")
    axes.set(xlim=(0, 1.08 * np.nanmax([*shares, 100.0])), ylim=(len(rows) - 0.5, -0.5))
    axes.set_yticks(rows, [one.measure for one in judgement.measured])
    style.legend_above(axes)


def _agreements(axes: Axes, judgement: Judgement) -> None:
    names = [one.measure for one in judgement.measured]
    matrix = np.eye(len(names))
    for pair in judgement.agreements:
        i, j = names.index(pair.first), names.index(pair.second)
        matrix[i, j] = matrix[j, i] = np.nan if pair.correlation is None else pair.correlation
    axes.imshow(matrix, cmap="PuOr", vmin=-1, vmax=1, aspect="auto")
    for i, j in np.ndindex(matrix.shape):
        words = "–" if np.isnan(matrix[i, j]) else f"{matrix[i, j]:.2f}"
        dark = abs(matrix[i, j]) > 0.6
        axes.text(j, i, words, ha="center", va="center", color="white" if dark else "black")
    axes.set_xticks(range(len(names)), names, rotation=35, ha="right")
    axes.set_yticks(range(len(names)), names)
