"""What a reproduction writes: a table of every number, every figure with its points, and the report."""

from __future__ import annotations

from pathlib import Path

from evenlight.analysis.earlier_results import files_in
from evenlight.analysis.findings import Findings, write_drawing, write_statistics
from evenlight.analysis.report import write_report
from evenlight.analysis.reproduction.reproduction import PIPELINE, Reproduction
from evenlight.analysis.reproduction.reproduction_parts import parts_of
from evenlight.analysis.reproduction.reproduction_report import reproduction_report
from evenlight.data_schema.analysis_summary import AnalysisSummary
from evenlight.data_schema.provenance import Provenance, provenance_now, sha256_of_record
from evenlight.data_schema.text_files import write_json_record

TABLES, FIGURES = "tables", "figures"
REPORT, SUMMARY = "report.html", "reproduction.json"


def write_reproduction(made: Reproduction, folder: Path) -> tuple[str, tuple[str, ...]]:
    """Write tables, figures, summary and report; return what came out, and the files but for the pipeline's.

    Parameters
    ----------
    made : Reproduction
        What the pipeline made.
    folder : Path
        Gets `tables/`, `figures/`, `report.html` and `reproduction.json`.
    """
    parts = parts_of(made)
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
