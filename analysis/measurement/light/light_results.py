"""The results of a recording of light: figures, a file for programs, and the lines that sum it up."""

from __future__ import annotations

from pathlib import Path

from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.measurement.light.light_figures import latency_figure, response_figure, ripple_figure
from evenlight.analysis.measurement.light.light_findings import LightFindings, analyse_light
from evenlight.analysis.measurement.light.light_recording import load_light_recording
from evenlight.analysis.report_prose import prose
from evenlight.data_schema.provenance import provenance_now, sha256_of_file
from evenlight.data_schema.recordings.dataset_layout import CLOCK_PINGS
from evenlight.data_schema.recordings.light import (
    LIGHT_ARRIVALS,
    LIGHT_LOG,
    LIGHT_RESULTS,
    LIGHT_SAMPLES,
    PATCH_FLIPS,
)
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.storage.whole_files import results_folder, write_whole

RECORDED = (LIGHT_LOG, LIGHT_SAMPLES, LIGHT_ARRIVALS, CLOCK_PINGS, PATCH_FLIPS)


def write_light_results(folder: Path, out: Path | None) -> list[str]:
    """Write results and figures of a recording of light, and return lines that sum it up.

    Parameters
    ----------
    folder : Path
        The recording, as `evenlight measure light` writes it.
    out : Path or None
        Where to, which may be the same; None to write nothing.

    Raises
    ------
    InputError
        If the recording cannot be used; it names the file and what is wrong.
    """
    recording = load_light_recording(folder)
    inputs = {name: sha256_of_file(folder / name) for name in RECORDED if (folder / name).exists()}
    findings = analyse_light(recording, provenance_now(inputs=inputs))
    results = findings.results
    if out is not None:
        pictures = _pictures(findings)
        with results_folder(out) as staging:
            write_json_record(staging / LIGHT_RESULTS, results)
            for name, png in pictures.items():
                write_whole(staging / name, png)
    mark = "SIMULATED: " if results.simulated else ""
    return [f"{mark}{line}" for line in (*prose("light_lines", results=results), *results.notes)]


def _pictures(findings: LightFindings) -> dict[str, bytes]:
    """Return the figures that there is something to show in, by the names of their files."""
    figures = {
        "pwm.png": ripple_figure if findings.ripple else None,
        "response.png": response_figure if findings.overlays else None,
        "latency.png": latency_figure if findings.results.latency else None,
    }
    return {name: png_bytes(draw(findings)) for name, draw in figures.items() if draw}
