"""The files of a judgement: tables, a figure and a report."""

from __future__ import annotations

from pathlib import Path

from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.judgement.judgement import (
    JudgedVideo,
    agreements_of,
    losses_by,
    provenance_of,
    require_judgeable,
)
from evenlight.analysis.judgement.judgement_figure import judgement_figure
from evenlight.analysis.judgement.modulation import installed_metric, judged_modulation
from evenlight.analysis.report import Picture, Report, Section, Table, write_report
from evenlight.analysis.report_prose import section
from evenlight.analysis.tracks.objective_words import less_or_more
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.data_schema.tracks.judgement import Judgement, MeasureAgreement, MeasuredTrack
from evenlight.data_schema.tracks.loaded_track import mean_factor


def judge_track(judged: JudgedVideo, measures: tuple[str, ...], modulation: bool, folder: Path) -> Judgement:
    """Judge a track by measures, and write every result into a folder.

    Parameters
    ----------
    judged : JudgedVideo
        The track, its video and display.
    measures : tuple of str
        Names of measures.
    modulation : bool
        Whether ColorVideoVDP is asked how visible the movement is.
    folder : Path
        For `judgement.json`, `judgement.csv`, `agreement.csv`, `judgement.png` and `report.html`.

    Raises
    ------
    InputError
        If the track is none of the video's, or was made for another display.
    """
    require_judgeable(judged)
    losses = [losses_by(judged, measure) for measure in measures]
    stretches, note = (
        judged_modulation(judged, installed_metric()) if modulation else ((), "Left out by --no-modulation")
    )
    track = judged.loaded.track
    judgement = Judgement(
        video=judged.source.name,
        display=judged.display.name,
        field_of_view=track.header.field_of_view,
        frames=len(track.times),
        mean_factor=mean_factor(track),
        constant_factor=judged.loaded.baseline,
        measured=tuple(one.summary() for one in losses),
        agreements=agreements_of(losses),
        modulation=stretches,
        modulation_note=note,
        provenance=provenance_of(judged, measures),
    )
    picture = png_bytes(judgement_figure(judgement))
    write_json_record(folder / "judgement.json", judgement)
    write_rows(folder / "judgement.csv", MeasuredTrack, judgement.measured)
    write_rows(folder / "agreement.csv", MeasureAgreement, judgement.agreements)
    write_whole(folder / "judgement.png", picture)
    write_report(folder / "report.html", judgement_report(judgement, picture))
    return judgement


def judgement_report(judgement: Judgement, picture: bytes) -> Report:
    """Return the report of a judgement.

    Parameters
    ----------
    judgement : Judgement
        What the measures say.
    picture : bytes
        Its `judgement_figure`.
    """
    caption = "Spread of loss by each measure (left), and rank correlation of the measures (right)."
    measures = section(
        "judge_measures", [_measure_table(judgement)], [Picture(picture, caption)], judgement=judgement
    )
    gains = [(one.gain, one.measure) for one in judgement.measured if one.gain is not None]
    lead = (
        f"Frames of {judgement.video} differ in loss {_range_in_words(gains)} than under constant dimming "
        "at equal power."
        if gains
        else f"By no measure do the frames of {judgement.video} lose differently at constant dimming."
    )
    sections = (measures, _modulation_section(judgement), section("judge_limits"))
    return Report(f"{judgement.video}, judged by several measures", lead, sections)


def _range_in_words(gains: list[tuple[float, str]]) -> str:
    """Return the largest and the smallest gain of measures, with their names."""
    words = [f"{less_or_more(gain)} ({measure})" for gain, measure in (max(gains), min(gains))]
    return words[0] if len(gains) == 1 else f"from {words[0]} to {words[1]}"


def _measure_table(judgement: Judgement) -> Table:
    """Return what each measure says, as a table."""
    return Table(
        "Contrast loss of the track and of constant dimming at equal power, by each measure.",
        ("measure", "spread", "constant", "compared", "mean loss", "constant", "largest", "constant"),
        tuple(
            (
                one.measure,
                one.spread,
                one.spread_constant,
                None if one.gain is None else less_or_more(one.gain),
                one.mean_loss,
                one.mean_loss_constant,
                one.largest_loss,
                one.largest_loss_constant,
            )
            for one in judgement.measured
        ),
    )


def _modulation_section(judgement: Judgement) -> Section:
    """Return how visible ColorVideoVDP finds the movement."""
    rows = tuple(
        (
            f"{one.begin:.1f} to {one.end:.1f}",
            f"{one.lowest_factor:.3f} to {one.highest_factor:.3f}",
            f"{one.jod:.3f}",
            f"{one.jod_flicker:.3f}",
        )
        for one in judgement.modulation
    )
    columns = ("time [s]", "factor", "JOD, track", "JOD, flicker of 2 %")
    tables = [Table("Quality beside the same stretch dimmed evenly.", columns, rows)] if rows else []
    return section("judge_modulation", tables, judgement=judgement)
