"""What a reproduction writes: a table of every number, every figure with its points, and the report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from evenlight.analysis.dataset_findings import to_be_looked_at
from evenlight.analysis.earlier_results import files_in
from evenlight.analysis.findings import Findings, write_drawing, write_statistics
from evenlight.analysis.integrity.concern import cautious
from evenlight.analysis.report import Report, Section, Table, write_report
from evenlight.analysis.report_prose import section
from evenlight.analysis.report_sections import files_section, provenance_section, roll_section
from evenlight.analysis.reproduction.adaptation_findings import adaptation_findings
from evenlight.analysis.reproduction.glance import glance_findings
from evenlight.analysis.reproduction.measured_times import measured_times
from evenlight.analysis.reproduction.online_findings import online_findings
from evenlight.analysis.reproduction.online_run import TargetSweep, online_run, target_sweep
from evenlight.analysis.reproduction.reproduced_tables import (
    detail_quality_findings,
    power_findings,
    slope_findings,
)
from evenlight.analysis.reproduction.reproduced_tracks import (
    contrast_findings,
    example_findings,
    sequence_findings,
)
from evenlight.analysis.reproduction.reproduction import PIPELINE, Reproduction
from evenlight.analysis.reproduction.simulated_viewers import viewer_findings
from evenlight.data_schema.analysis_results import AnalysisSummary, Origin
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import Provenance, provenance_now
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import loss_and_slope
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.rate_limit import scalar_rate_limit

TABLES, FIGURES = "tables", "figures"
REPORT, SUMMARY = "report.html", "reproduction.json"
SWEPT = "basement"  # the sequence of the paper's curve of target loss against brightness
TARGETS = 20  # target losses of that curve, up to what the lowest factor loses on average
WALK_FACTOR = 0.5  # its mean loss is the walk's target: the paper does not say which one it held
SHOWN = "library"  # the sequence whose frame shows lost contrast
TITLE = "Temporal brightness management: the paper's tables and figures, reproduced"
SIMULATED = (
    "Simulated participants answer wherever no recorded data were given. They follow models of seeing and "
    "judging whose figures are choices (docs/decisions/simulated-viewers.md): that they prefer one "
    "version, or do not, is no evidence that people do."
)
QUICK = "Quick run, on small pictures and few frames, to see that everything runs: no number here is a result"
MEANINGS = {
    Origin.PUBLISHED: "printed in the paper",
    Origin.AUTHORS: "from the program that its authors published",
    Origin.SIMULATED: "from answers of simulated participants: show how the analysis works",
    Origin.RECORDED: "from answers of people, or from readings of instruments",
    Origin.COMPUTED: "by the model, from rendered sequences, without participants",
    Origin.MEASURED: "a time, taken on this machine while the report was made",
}
# What rests on no answer but on the rate limit alone; the rest says itself where it comes from.
COMPUTED = ("thresholded_contrast", "examples", "sequences", "adaptation", "power", "online")
ON_LIMIT = ("examples", "sequences", "adaptation", "power", "online")
# Whose findings the first page gives.
LED_BY = ("simulated_viewers", "rating", "search", "comparison", "adaptation", "online")


def write_reproduction(made: Reproduction, folder: Path) -> tuple[str, tuple[str, ...]]:
    """Write tables, figures, summary and report; return what came out, and the files but for the pipeline's.

    Parameters
    ----------
    made : Reproduction
        What the pipeline made.
    folder : Path
        Gets `tables/`, `figures/`, `report.html` and `reproduction.json`.
    """
    parts = _parts_of(made)
    if made.plan.quick:
        parts = tuple(_quick(part) for part in parts)
    for part in parts:
        write_part(folder, part)
    origin = _origin(made)
    report = reproduction_report(made, parts, origin)
    write_report(folder / REPORT, report)
    own = (name for name in files_in(folder) if not name.startswith(f"{PIPELINE}/"))
    files = (*own, SUMMARY)
    summary = AnalysisSummary(
        simulated=any(made.tasks.simulated.values()),
        leads={part.name: part.cautious_lead for part in parts},
        refused=made.tasks.refused,
        warnings=warnings_of(made),
        provenance=origin,
        files=files,
        roll=made.tasks.roll,
        quick=made.plan.quick,
    )
    write_json_record(folder / SUMMARY, summary)
    return report.lead, files


def warnings_of(made: Reproduction) -> tuple[str, ...]:
    """Return what is wrong with a reproduction but does not forbid its use."""
    return (*((QUICK,) if made.plan.quick else ()), *made.tasks.warnings)


def _quick(part: Findings) -> Findings:
    """Return a part of a quick run, whose every number and every caption says so."""
    rows = (replace(row, flag="; ".join(filter(None, ("quick run", row.flag)))) for row in part.statistics)
    drawings = (replace(one, caption=f"Quick run, no result: {one.caption}") for one in part.drawings)
    return replace(part, statistics=tuple(rows), drawings=tuple(drawings))


def write_part(folder: Path, part: Findings) -> None:
    """Write `tables/NAME_statistics.csv`, and of each drawing `figures/DRAWING.png` with its points."""
    if part.statistics:
        write_statistics(folder / TABLES, part)
    for drawing in part.drawings:
        write_drawing(folder / FIGURES, drawing)


def _origin(made: Reproduction) -> Provenance:
    """Return software, seed and inputs."""
    inputs = {f"{task} data": digest for task, digest in made.tasks.inputs.items()}
    inputs["display"] = sha256_of_record(made.panel.display)
    inputs["power model"] = sha256_of_record(made.panel.power_model)
    for sequence in (*made.sequences, *made.examples):
        inputs[sequence.name] = sequence.curves.provenance.inputs.get("video", "")
    return provenance_now(made.plan.seed, inputs)


def _parts_of(made: Reproduction) -> tuple[Findings, ...]:
    """Return what the reproduction found, part by part."""
    found = made.tasks.findings
    simulated = made.tasks.simulated["ramp"]
    by_name = {sequence.name: sequence for sequence in made.sequences}
    parts = (
        slope_findings(found["ramp"], made.panel.rate_limit), contrast_findings(by_name[SHOWN]),
        example_findings(made.examples, simulated), sequence_findings(made.sequences, simulated),
        *viewer_findings(made.effects, made.plan, made.panel.display),
        detail_quality_findings(found["rating"], found["comparison"]), found["rating"], found["comparison"],
        found["search"], adaptation_findings([sequence.tracks for sequence in made.sequences]),
        power_findings(made.sequences, made.plan.data), _online_findings(made, by_name[SWEPT].curves),
    )  # fmt: skip
    times = measured_times(made.sequences, made.panel, made.walk)
    return glance_findings({part.name: part for part in parts}, times, made.panel.rate_limit), *parts


def _online_findings(made: Reproduction, swept: LossCurves) -> Findings:
    """Return what the online controller does on the walk, and over target losses."""
    limit = scalar_rate_limit(made.panel.rate_limit, made.panel.display.reflected_luminance)
    controller = Controller(ControllerSettings(_mean_loss(made.walk, WALK_FACTOR)), limit)
    largest = _mean_loss(swept, float(swept.factors[0]))
    sweep = target_sweep(swept, controller, np.linspace(0.0, largest, TARGETS + 1)[1:].tolist())
    return online_findings(online_run(made.walk, controller), TargetSweep(SWEPT, swept.n_frames, sweep))


def _mean_loss(curves: LossCurves, factor: float) -> float:
    """Return the contrast loss under constant dimming, mean over time."""
    loss, _ = loss_and_slope(curves, np.full(curves.n_frames, factor))
    return float(np.average(loss, weights=curves.durations))


def reproduction_report(made: Reproduction, parts: Sequence[Findings], origin: Provenance) -> Report:
    """Return the report.

    Parameters
    ----------
    made, parts : Reproduction, sequence of Findings
        What the pipeline made, and its parts, in the order of the paper.
    origin : Provenance
        Software, seed and inputs.
    """
    first, *others = parts
    named = {part.name: part for part in parts}
    return Report(
        TITLE,
        # What is wrong with the answers comes first, what they say follows with its origin.
        cautious(made.tasks.concerns, f"{named['sequences'].lead} {named['power'].lead}"),
        (
            *to_be_looked_at(made.tasks), *first.sections, _what_came_out(made, parts), _how_to_read(made),
            *(own for part in others for own in _sections(made, part)),
            *((roll_section(made.tasks.roll),) if made.tasks.roll else ()),
            provenance_section({"reproduction": origin}), files_section(_files(parts)),
        ),
        SIMULATED,
        QUICK if made.plan.quick else "",
    )  # fmt: skip


def _what_came_out(made: Reproduction, parts: Sequence[Findings]) -> Section:
    """Return the findings of each experiment, in words."""
    leads, simulated = {part.name: part.lead for part in parts}, made.tasks.simulated
    return section(
        "reproduction/what_came_out",
        simulated=any(simulated[name] for name in LED_BY if name in simulated),
        leads=[leads[name] for name in LED_BY if name in leads],
        raters_are_simulated=simulated["rating"],
    )


def _sections(made: Reproduction, part: Findings) -> Iterator[Section]:
    """Yield the sections of a part with their origin: the first with its heading, the others below it."""
    limit = made.panel.rate_limit
    for place, own in enumerate(part.sections):
        mark, notes = own.mark, own.notes
        if part.name in COMPUTED:
            mark = Origin.COMPUTED.value
            if place == 0 and part.name in ON_LIMIT and limit.simulated:
                notes = (*notes, "The rate limit of these tracks rests on simulated participants.")
        yield replace(
            own,
            below=place > 0 and part.name != "examples",
            mark=mark,
            notes=notes,
            simulated=own.simulated and part.name not in COMPUTED,
        )


def _how_to_read(made: Reproduction) -> Section:
    """Return what the origins mean, and what was done."""
    rows = tuple((kind.value, words) for kind, words in MEANINGS.items())
    return section(
        "reproduction/how_to_read",
        (Table("Where a number comes from.", ("origin", "means"), rows),),
        plan=made.plan,
        display=made.panel.display,
        participants=made.tasks.participants,
        is_simulated=made.tasks.simulated,
    )


def _files(parts: Sequence[Findings]) -> dict[str, str]:
    """Return the files beside the report, with what they hold."""
    files = {
        f"tables/{part.name}_statistics.csv": f"every number of the part {part.name.replace('_', ' ')}"
        for part in parts
        if part.statistics
    }
    for part in parts:
        for drawing in part.drawings:
            files[f"figures/{drawing.name}.png, {drawing.name}_points.csv"] = drawing.caption
    files[f"{PIPELINE}/"] = "data sets, calibration, tracks and loss curves that all of it is made of"
    files[f"{PIPELINE}.sha256"] = "what a later run knows that folder by; only such a folder is replaced"
    files["reproduction.json"] = "software, seed, inputs, warnings, files"
    return files
