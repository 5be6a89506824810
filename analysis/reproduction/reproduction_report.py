"""What a reproduction writes: a table of every number, every figure with its points, and the report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from matplotlib.figure import Figure

from evenlight.analysis.dataset_findings import ANALYSES, to_be_looked_at
from evenlight.analysis.integrity.concern import cautious
from evenlight.analysis.report import KeyFigure, Report, Section, write_report
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.report_sections import files_section, provenance_section, roll_section
from evenlight.analysis.reproduction.adaptation import adaptation_findings
from evenlight.analysis.reproduction.online import online_findings
from evenlight.analysis.reproduction.paper_tables import (
    detail_quality_findings,
    power_findings,
    slope_findings,
    viewer_findings,
)
from evenlight.analysis.reproduction.published_beside import key_figures
from evenlight.analysis.reproduction.reproduction import PIPELINE, VIEWING_TASKS, Reproduction
from evenlight.analysis.reproduction.sequence_figures import (
    contrast_findings,
    example_findings,
    sequence_findings,
)
from evenlight.analysis.results import Analysis, Result, write_drawing
from evenlight.data_schema.analysis_results import AnalysisSummary, Origin
from evenlight.data_schema.mapping import mapping_from_record, sha256_of_record
from evenlight.data_schema.provenance import Provenance, provenance_now
from evenlight.data_schema.storage.result_folders import files_in
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import loss_at
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.preset_files import load_power_model
from evenlight.method.rate_limit import scalar_rate_limit

if TYPE_CHECKING:
    import pandas as pd

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
# What rests on no answer but on the rate limit alone; the rest says itself where it comes from.
ON_LIMIT = ("examples", "sequences", "adaptation", "power", "online")
COMPUTED = ("thresholded_contrast", *ON_LIMIT)


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class ReproductionResult(Result):
    """The paper's tables and figures, reproduced.

    Attributes
    ----------
    made : Reproduction
        What the pipeline made.
    parts : tuple of Analysis
        What it shows, in the order of the paper.
    report : Report
        On all parts.
    origin : Provenance
        Of every number.
    """

    made_by: ClassVar = "reproduce"
    made: Reproduction
    parts: tuple[Analysis, ...]
    report: Report
    origin: Provenance

    @property
    def heading(self) -> str:
        """What it is, in a few words."""
        return TITLE

    @property
    def first_lines(self) -> tuple[str, tuple[KeyFigure, ...]]:
        """What came out, and the key figures."""
        return self.report.lead, self.report.key_figures

    @property
    def figures(self) -> Mapping[str, Figure]:
        """The figures of all parts, by name."""
        return {own.name: own.figure for part in self.parts for own in part.drawings}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is wrong but does not forbid the use."""
        return (*((QUICK,) if self.made.plan.quick else ()), *self.made.tasks.warnings)

    def to_frame(self) -> pd.DataFrame:
        """Return every number of every part: the rows of `tables/`, with their part."""
        import pandas as pd

        return pd.DataFrame(
            [{"part": part.name} | mapping_from_record(row) for part in self.parts for row in part.rows]
        )

    def write(self, folder: Path) -> None:
        """Write `tables/`, `figures/`, `report.html` and `reproduction.json`."""
        for part in self.parts:
            part.write_numbers(folder / TABLES)
            for drawing in part.drawings:
                write_drawing(folder / FIGURES, drawing)
        write_report(folder / REPORT, self.report)
        own = (name for name in files_in(folder) if not name.startswith(f"{PIPELINE}/"))
        summary = AnalysisSummary(
            simulated=any(self.made.tasks.simulated.values()),
            leads={part.name: part.lead for part in self.parts},
            refused=self.made.tasks.refused,
            warnings=self.warnings,
            provenance=self.origin,
            files=(*own, SUMMARY),
            roll=self.made.tasks.roll,
            quick=self.made.plan.quick,
        )
        write_json_record(folder / SUMMARY, summary)


def reproduction_result(made: Reproduction) -> ReproductionResult:
    """Return what a reproduction shows, part by part, and the report on it."""
    parts = _parts_of(made)
    if made.plan.quick:
        parts = tuple(_quick(part) for part in parts)
    origin = _origin(made)
    return ReproductionResult(made, parts, reproduction_report(made, parts, origin), origin)


def _quick(part: Analysis) -> Analysis:
    """Return a part of a quick run, whose every number and every caption says so."""
    rows = (replace(row, flag="; ".join(filter(None, ("quick run", row.flag)))) for row in part.rows)
    drawings = (replace(one, caption=f"Quick run, no result: {one.caption}") for one in part.drawings)
    return replace(part, rows=tuple(rows), drawings=tuple(drawings))


def _origin(made: Reproduction) -> Provenance:
    inputs = {f"{task} data": digest for task, digest in made.tasks.inputs.items()}
    inputs["display"] = sha256_of_record(made.display)
    inputs["power model"] = sha256_of_record(load_power_model("surace2025"))
    for sequence in (*made.sequences, *made.examples):
        inputs[sequence.name] = sequence.curves.provenance.inputs.get("video", "")
    return provenance_now(made.plan.seed, inputs)


def _parts_of(made: Reproduction) -> tuple[Analysis, ...]:
    found = made.tasks.findings
    tasks = [found[task] for task in VIEWING_TASKS]
    by_name = {sequence.name: sequence for sequence in made.sequences}
    return (
        slope_findings(found["ramp"], made.limit),
        contrast_findings(by_name[SHOWN]),
        example_findings(made.examples),
        sequence_findings(made.sequences),
        detail_quality_findings(found["rating"], found["comparison"]),
        *viewer_findings(tasks),
        *tasks,
        adaptation_findings(
            {s.name: (s.maps, s.dimmings) for s in made.sequences}, drawn=made.limit.simulated
        ),
        power_findings(made.sequences, made.plan.data),
        _online_findings(made, by_name[SWEPT].curves),
    )


def _online_findings(made: Reproduction, swept: LossCurves) -> Analysis:
    limit = scalar_rate_limit(made.limit, made.display.reflected_luminance)
    controller = Controller(ControllerSettings(_mean_loss(made.walk, WALK_FACTOR)), limit)
    largest = _mean_loss(swept, float(swept.factors[0]))
    targets = np.linspace(0.0, largest, TARGETS + 1)[1:].tolist()
    return online_findings(made.walk, swept, controller, targets, drawn=made.limit.simulated)


def _mean_loss(curves: LossCurves, factor: float) -> float:
    """Return the contrast loss under constant dimming, mean over time."""
    loss = loss_at(curves, np.full(curves.n_frames, factor))
    return float(np.average(loss, weights=curves.durations))


def reproduction_report(made: Reproduction, parts: Sequence[Analysis], origin: Provenance) -> Report:
    """Return the report on the parts, which are in the order of the paper."""
    less, saved = [s.gain for s in made.sequences], [s.saved for s in made.sequences]
    cards = (
        *key_figures((part.rows for part in parts), drawn=made.limit.simulated),
        KeyFigure(
            f"{min(less):.0f} to {max(less):.0f} %",
            "less difference of contrast loss between frames than with constant dimming at the same power",
            "four sequences; the paper prints no number",
        ),
        KeyFigure(
            f"{min(saved):.0f} to {max(saved):.0f} %",
            "of the power of full brightness saved",
            "by the power model",
        ),
    )
    met, independent = (card.value for card in cards[:2])
    raters = {"raters_are_simulated": made.tasks.simulated["rating"]}
    (lead,) = prose("reproduction/lead", gains=less, met=met, independent=independent, **raters)
    return Report(
        TITLE,
        # What is wrong with the answers comes first, what they say follows with its origin.
        cautious(made.tasks.concerns, lead),
        (
            *to_be_looked_at(made.tasks),
            *(own for part in parts for own in _sections(made, part)),
            section(
                "reproduction/how_to_read",
                plan=made.plan,
                display=made.display,
                participants=made.tasks.participants,
                is_simulated=made.tasks.simulated,
            ),
            *((roll_section(made.tasks.roll),) if made.tasks.roll else ()),
            provenance_section({"reproduction": origin}),
            files_section(_files(parts)),
        ),
        SIMULATED,
        QUICK if made.plan.quick else "",
        cards,
    )


def _sections(made: Reproduction, part: Analysis) -> Iterator[Section]:
    """Yield the sections of a part with their origin: the first with its heading, the others below it."""
    if part.name in VIEWING_TASKS:
        simulated = made.tasks.simulated[part.name]
        yield Section(
            ANALYSES[part.name].title, (part.lead,), simulated=simulated, key_figures=part.key_figures
        )
        yield from (replace(own, below=True) for own in part.sections)
        return
    for place, own in enumerate(part.sections):
        below = place > 0 and part.name != "examples"
        if part.name not in COMPUTED:
            yield replace(own, below=below)
            continue
        drawn = place == 0 and part.name in ON_LIMIT and made.limit.simulated
        notes = ("The rate limit of these tracks rests on simulated participants.",) if drawn else ()
        mark = Origin.COMPUTED.value
        yield replace(own, below=below, mark=mark, simulated=False, notes=(*own.notes, *notes))


def _files(parts: Sequence[Analysis]) -> dict[str, str]:
    files = {
        f"tables/{part.name}_statistics.csv": f"every number of the part {part.name.replace('_', ' ')}"
        for part in parts
    }
    for part in parts:
        for drawing in part.drawings:
            files[f"figures/{drawing.name}.png, {drawing.name}_points.csv"] = drawing.caption
    files[f"{PIPELINE}/"] = "data sets, calibration, tracks and loss curves that all of it is made of"
    files["SHA256SUMS"] = "of every file: what a later run knows this folder by, and replaces"
    files[SUMMARY] = "software, seed, inputs, warnings, files"
    return files
