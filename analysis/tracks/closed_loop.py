"""The second half of the loop: from a data set of ramp sessions to a brightness track and a report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from evenlight.analysis.calibration.calibration import Calibration, calibrate
from evenlight.analysis.calibration.calibration_sections import (
    calibration_section,
    population_section,
)
from evenlight.analysis.calibration.fit_report import write_calibration, write_figures
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.calibration.rate_limit_section import rate_limit_section
from evenlight.analysis.integrity.concern import cautious
from evenlight.analysis.player.player_content import PLAYER
from evenlight.analysis.ramp_loading import load_ramp_data
from evenlight.analysis.report import Report, write_report
from evenlight.analysis.report_sections import (
    contrast_map_section,
    files_section,
    introduction_section,
    provenance_section,
    track_section,
)
from evenlight.analysis.tracks.gain_words import gain_in_words
from evenlight.analysis.tracks.optimization_job import OptimizationJob
from evenlight.analysis.tracks.track_results import run_optimization
from evenlight.analysis.wording import sentence
from evenlight.data_schema.provenance import Provenance, provenance_now
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.choices import DEFAULT_CALM
from evenlight.method.optimizer.request import Request
from evenlight.method.preset_files import load_power_model, load_rate_limit, usable_limit
from evenlight.stimuli.video.video_source import VideoSource

CALIBRATION, TRACK, REPORT = "calibration", "track", "report.html"
SEE_IT = (
    f"{TRACK}/{PLAYER}",
    "See it play: the video at full brightness, with the track, dimmed constantly.",
)

FILES = {
    "dataset/": "trials of every participant, as recorded",
    "dataset.sha256": "what a later demo knows this one's data set by; only such a data set is replaced",
    "calibration/thresholds.csv": "thresholds of each participant and level, with intervals",
    "calibration/rate_limit.json": "the fitted rate limit, which the optimizer read",
    "calibration/fit_summary.json": "what the fit rests on",
    "track/track.csv": "the brightness factor of each frame, and what it does",
    "track/player.html": "the video beside its dimmed versions, and the track, in a browser",
    "track/summary.json": "what the track achieves",
    "track/loss_curves.npz": "contrast loss of each frame at every factor, for another run",
}


def close_loop(dataset: Path, source: VideoSource, budget: float, folder: Path, quiet: bool = False) -> None:
    """Fit a data set, optimize a video within the rate limit that comes out, and report both.

    Parameters
    ----------
    dataset, source : Path, VideoSource
        Ramp sessions, and the video.
    budget, quiet : float, bool
        Mean brightness factor, and whether to show no progress.
    folder : Path
        Where `calibration/`, `track/` and `report.html` go.
    """
    data = load_ramp_data(dataset)
    calibration = calibrate(data, RateLimitOptions())
    fitted = folder / CALIBRATION
    origin = provenance_now(inputs={"dataset": data.sha256})
    write_calibration(calibration, fitted, origin)
    write_figures(calibration, fitted, load_rate_limit("surace2025"))
    # The optimizer reads the file that the fit wrote, as it would on another day.
    # However few the participants: it is a demonstration, and its report says how well the limit is known.
    limit = usable_limit(load_rate_limit(fitted / "rate_limit.json"), data.display, accept_wide_band=True)
    request = Request(budget, BudgetUnit.FACTOR, load_power_model("surace2025"), limit)
    job = OptimizationJob(source, data.display, request, calm=DEFAULT_CALM, player=True, quiet=quiet)
    summary = run_optimization(job, folder / TRACK)
    write_report(folder / REPORT, _report(calibration, summary, origin, folder))


def _report(
    calibration: Calibration, summary: OptimizationSummary, origin: Provenance, folder: Path
) -> Report:
    """Return the report on what lies in the folder."""
    fitted, track, simulated = folder / CALIBRATION, folder / TRACK, calibration.data.simulated
    return Report(
        "From ramps to a brightness track",
        cautious(calibration.concerns, " ".join(f"{sentence(line)}." for line in gain_in_words(summary))),
        (
            introduction_section(),
            calibration_section(calibration, (fitted / "psychometric.png").read_bytes()),
            population_section(calibration.levels, simulated),
            rate_limit_section(calibration, (fitted / "rate_limit.png").read_bytes()),
            replace(track_section(summary, (track / "track.png").read_bytes(), simulated), links=(SEE_IT,)),
            contrast_map_section((track / "contrast_map.png").read_bytes(), simulated),
            provenance_section(origins_of(calibration, origin, summary)),
            files_section(FILES),
        ),
    )


def origins_of(
    calibration: Calibration, fit: Provenance, summary: OptimizationSummary
) -> dict[str, Provenance]:
    """Return where data set, rate limit and track come from; the fit's inputs name the data set's SHA-256.

    The data set's origin is that of its first session, without a seed if other sessions have another one.
    """
    made = [session.manifest.provenance for session in calibration.data.sessions]
    alike = all(origin.seed == made[0].seed for origin in made)
    dataset = made[0] if alike else replace(made[0], seed=None)
    return {"data set": dataset, "rate limit": fit, "track": summary.provenance}
