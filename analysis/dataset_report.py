"""The report on a data set: the findings of its tasks, one after the other."""

from __future__ import annotations

from evenlight.analysis.dataset_findings import DatasetFindings
from evenlight.analysis.report import Report, Section
from evenlight.analysis.report_sections import files_section, provenance_section
from evenlight.data_schema.provenance import Provenance

TITLES = {
    "ramp": "How fast a change is noticed",
    "rating": "Quality of details",
    "comparison": "Noticing the modulation",
    "search": "Finding things",
}
SIMULATED = (
    "Simulated: the answers come from simulated participants. They show how the experiments and their "
    "analysis work, and say nothing about people."
)


def dataset_report(found: DatasetFindings, origin: Provenance) -> Report:
    """Return the report on a data set.

    Parameters
    ----------
    found : DatasetFindings
        What it shows.
    origin : Provenance
        Software, seed and inputs of the analysis.
    """
    sections = [section for findings in found.findings.values() for section in findings.sections]
    return Report(
        "What the data show",
        " ".join(findings.lead for findings in found.findings.values()),
        (
            *((_warnings(found),) if found.warnings else ()),
            *sections,
            provenance_section({"analysis": origin}),
            files_section(_files(found)),
        ),
        SIMULATED,
    )


def _warnings(found: DatasetFindings) -> Section:
    """Return what the reader should be warned of first."""
    return Section("To be looked at", notes=found.warnings, simulated=any(found.simulated.values()))


def _files(found: DatasetFindings) -> dict[str, str]:
    """Return the files that were written, with what they hold."""
    files = {}
    for task, findings in found.findings.items():
        files[f"{findings.name}_statistics.csv"] = f"every number of {TITLES[task].lower()}"
        for drawing in findings.drawings:
            files[f"{drawing.name}.png, {drawing.name}_points.csv"] = drawing.caption
    if "ramp" in found.findings:
        files["thresholds.csv"] = "thresholds of each participant and level, with intervals"
        files["rate_limit.json"] = "the fitted rate limit, for `evenlight optimize --rate-limit`"
        files["fit_summary.json"] = "what the fit rests on, for programs"
    return files
