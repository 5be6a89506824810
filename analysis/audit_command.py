"""The command that audits the paper's published numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evenlight.progress import shown_progress


def audit(
    out: Annotated[Path, typer.Option(help="Folder for audit_statistics.csv, figures and report.html.")],
    quiet: Annotated[bool, typer.Option("--quiet", help="Print no progress and no closing lines.")] = False,
) -> None:
    """Check what the paper's published numbers themselves can support, and what they cannot."""
    from evenlight.analysis.audit.audit_findings import TITLE, audit_findings
    from evenlight.analysis.findings import write_findings
    from evenlight.analysis.report import Report, write_report
    from evenlight.data_schema.storage.whole_files import results_folder

    with results_folder(out) as folder, shown_progress(quiet) as progress:
        progress.step("trying every distribution and every pairing")
        findings = audit_findings()
        write_findings(folder, findings)
        write_report(folder / "report.html", Report(TITLE, findings.lead, findings.sections))
    if not quiet:
        typer.echo(findings.lead)
        typer.echo(f"{out / 'report.html'} has the tables and figures, audit_statistics.csv every number")
