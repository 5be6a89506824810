"""What a reproduction writes: a table of every number, every figure with its points, and the report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from evenlight.analysis.earlier_results import files_in
from evenlight.analysis.findings import Findings, write_drawing, write_statistics
from evenlight.analysis.published import SEQUENCES, published
from evenlight.analysis.report import Cell, Report, Section, Table, write_report
from evenlight.analysis.report_prose import section
from evenlight.analysis.report_sections import files_section, provenance_section
from evenlight.analysis.reproduction.adaptation_findings import adaptation_findings
from evenlight.analysis.reproduction.online_findings import RATIO, online_findings
from evenlight.analysis.reproduction.online_run import TargetSweep, online_run, target_sweep
from evenlight.analysis.reproduction.reproduced_tables import (
    DIFFERENCE,
    detail_quality_findings,
    find,
    interval_in_words,
    power_findings,
    slope_findings,
)
from evenlight.analysis.reproduction.reproduced_tracks import (
    contrast_findings,
    example_findings,
    sequence_findings,
)
from evenlight.analysis.reproduction.reproduction import PIPELINE, Reproduction
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import AnalysisSummary, Origin, Statistic
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
MEANINGS = {
    Origin.PUBLISHED: "printed in the paper, or from the program that its authors published",
    Origin.SIMULATED: "from answers of simulated participants: show how the analysis works",
    Origin.RECORDED: "from answers of people, or from readings of instruments",
    Origin.COMPUTED: "by the model, from rendered sequences, without participants",
}
# What rests on no answer but on the rate limit alone; the rest says itself where it comes from.
COMPUTED = ("thresholded_contrast", "examples", "sequences", "adaptation", "power", "online")
ON_LIMIT = ("examples", "sequences", "adaptation", "power", "online")
LED_BY = ("rating", "search", "comparison", "adaptation", "online")  # whose findings the first page gives
NAME = "at_a_glance"
LAG = "integral of |static - dynamic response| over time: per pixel"  # what the paper integrates
Line = tuple[str, Statistic, Statistic | None, float | None]  # place, published, ours, no effect


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
    for part in parts:
        write_part(folder, part)
    origin = _origin(made)
    report = reproduction_report(made, parts, origin)
    write_report(folder / REPORT, report)
    own = (name for name in files_in(folder) if not name.startswith(f"{PIPELINE}/"))
    files = (*own, SUMMARY)
    summary = AnalysisSummary(
        simulated=any(made.tasks.simulated.values()),
        leads={part.name: part.lead for part in parts},
        refused=made.tasks.refused,
        warnings=made.tasks.warnings,
        provenance=origin,
        files=files,
    )
    write_json_record(folder / SUMMARY, summary)
    return report.lead, files


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
        detail_quality_findings(found["rating"], found["comparison"]), found["rating"], found["comparison"],
        found["search"], adaptation_findings([sequence.tracks for sequence in made.sequences]),
        power_findings(made.sequences, made.plan.data), _online_findings(made, by_name[SWEPT].curves),
    )  # fmt: skip
    return _glance_findings({part.name: part for part in parts}), *parts


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
        f"{named['sequences'].lead} {named['power'].lead}",  # what participants say follows with its origin
        (
            *first.sections, _what_came_out(made, parts), _how_to_read(made),
            *(own for part in others for own in _sections(made, part)),
            provenance_section({"reproduction": origin}), files_section(_files(parts)),
        ),
        SIMULATED,
    )  # fmt: skip


def _what_came_out(made: Reproduction, parts: Sequence[Findings]) -> Section:
    """Return the findings of each experiment, in words."""
    leads, simulated = {part.name: part.lead for part in parts}, made.tasks.simulated
    return section(
        "reproduction/what_came_out",
        simulated=any(simulated[name] for name in LED_BY if name in simulated),
        leads=[leads[name] for name in LED_BY],
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


def _glance_findings(parts: Mapping[str, Findings]) -> Findings:
    """Return the paper's headline numbers with ours beside them."""
    lines = [
        *_quality(parts),
        *_adaptation(parts["adaptation"]),
        *_power(parts["power"]),
        *_online(parts["online"]),
    ]
    rows = [row for _, theirs, own, _ in lines for row in (theirs, own) if row is not None]
    cells = tuple(_cells(line) for line in lines)
    table = Table(
        "Numbers that the paper prints, or that follow from two of them, and ours.",
        ("what", "where", "published", "ours", "95 % confidence interval", "direction", "origin of ours"),
        cells,
    )
    simulated = any(row.origin is Origin.SIMULATED for row in rows)
    return Findings(
        NAME, "", tuple(rows), (), (section("reproduction/glance", (table,), simulated=simulated),)
    )


def _printed(group: str, what: str, value: float, unit: str, places: str) -> Statistic:
    """Return a row of what the paper prints."""
    return Statistic(NAME, group, what, value, unit, Origin.PUBLISHED, method=places)


def _own(row: Statistic | None, what: str) -> Statistic | None:
    """Return one of our rows as a row of this table."""
    return None if row is None else replace(row, table=NAME, what=what)


def _quality(parts: Mapping[str, Findings]) -> Iterator[Line]:
    """Yield how much better ours is rated, and how often it is chosen."""
    own = parts["detail_quality"].statistics
    for name in SEQUENCES:
        key = f"detail_quality.{name}"
        gain = published(f"{key}.ours_mean").number - published(f"{key}.baseline_mean").number
        what, place = "rating, ours less constant", published(f"{key}.ours_mean").place
        theirs = _printed(name, what, gain, "rating points", f"{place}, difference of two means")
        yield place, theirs, _own(_row(own, name, DIFFERENCE), what), 0.0
    for name in SEQUENCES:
        chosen = published(f"detail_quality.{name}.chosen_percent")
        what = "share that chose ours as the one that changed"
        theirs = _printed(name, what, chosen.number / 100, "1", chosen.place)
        yield chosen.place, theirs, _own(_row(own, name, "ours chosen"), what), None


def _row(rows: Sequence[Statistic], group: str, what: str) -> Statistic | None:
    """Return a row that is not a published one."""
    return find([row for row in rows if row.origin is not Origin.PUBLISHED], group, what)


def _power(part: Findings) -> Iterator[Line]:
    """Yield the share of power that ours saves."""
    for name in SEQUENCES:
        printed = {version: published(f"power.{name}.{version}") for version in ("ours", "full")}
        what, place = "power saved, share of full brightness", printed["ours"].place
        theirs = _printed(name, what, 1 - printed["ours"].number / printed["full"].number, "1", place)
        ours, full = (_row(part.statistics, name, f"average power, {v}") for v in ("ours", "full brightness"))
        saved = None
        if ours is not None and full is not None and ours.value is not None and full.value:
            saved = replace(ours, table=NAME, what=what, value=1 - ours.value / full.value, unit="1",
                            ci_low=None, ci_high=None, interval=None)  # fmt: skip
        yield place, theirs, saved, 0.0


def _online(part: Findings) -> Iterator[Line]:
    """Yield how much steadier contrast loss is under the online controller."""
    ours, constant = published("online.sd_ours"), published("online.sd_baseline")
    what = "SD of contrast loss, controller over constant"
    theirs = _printed("house", what, ours.number / constant.number, "1", ours.place)
    row = _row(part.statistics, "house", RATIO)
    yield ours.place, theirs, _own(row, what), 1.0


def _adaptation(part: Findings) -> Iterator[Line]:
    """Yield how much further adaptation lags without a rate limit than within it."""
    for name in SEQUENCES:
        printed = [published(f"adaptation.{name}.{track}") for track in ("unconstrained", "constrained")]
        what, place = "lag of the cones, without rate limit over within it", printed[0].place
        theirs = _printed(name, what, printed[0].number / printed[1].number, "1", place)
        free, held = (
            _row(part.statistics, name, f"{LAG}, {track}")
            for track in ("without a rate limit", "within the rate limit")
        )
        own = None
        if free is not None and held is not None and free.value is not None and held.value:
            own = replace(free, table=NAME, what=what, value=free.value / held.value, unit="1")
        yield place, theirs, own, 1.0


def _cells(line: Line) -> tuple[Cell, ...]:
    """Return a line of the table."""
    place, theirs, ours, none = line
    name = "Walk through the house" if theirs.group == "house" else in_words(theirs.group)
    what = f"{name}: {theirs.what}"
    if ours is None:
        return what, place, theirs.value, None, None, None, None
    way = _direction(theirs, ours, none)
    return what, place, theirs.value, ours.value, interval_in_words(ours), way, ours.origin.value


def _direction(theirs: Statistic, ours: Statistic, none: float | None) -> str | None:
    """Return whether ours lies on the same side of "no effect" as what is printed, and whether clearly so."""
    if none is None or theirs.value is None or ours.value is None:
        return None
    same = "same" if (theirs.value - none) * (ours.value - none) > 0 else "opposite"
    if ours.ci_low is not None and ours.ci_high is not None:
        return f"{same}, unclear" if ours.ci_low <= none <= ours.ci_high else same
    return same
