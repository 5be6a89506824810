"""The second half of the loop: from a data set of ramp sessions to a brightness track and a report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from evenlight.analysis.calibration.calibration import Calibration, calibrate
from evenlight.analysis.calibration.fit_report import write_calibration, write_pictures
from evenlight.analysis.calibration.ramp_findings import ramp_findings
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.integrity.concern import cautious
from evenlight.analysis.player.player_page import PLAYER
from evenlight.analysis.ramp_loading import load_ramp_data
from evenlight.analysis.report import Picture, Report, Section, Table, write_report
from evenlight.analysis.report_prose import section
from evenlight.analysis.report_sections import CLAIM, files_section, provenance_section
from evenlight.analysis.results import Analysis
from evenlight.analysis.tracks.first_page import key_figures, verdict
from evenlight.analysis.tracks.optimization_job import OptimizationJob
from evenlight.analysis.tracks.price_figure import about
from evenlight.analysis.tracks.track_results import run_optimization
from evenlight.analysis.tracks.track_words import detail_sentences, detection_in_words, rate_in_words
from evenlight.analysis.wording import sentence
from evenlight.data_schema.provenance import Provenance, provenance_now
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.choices import DEFAULT_CALM
from evenlight.method.optimizer.request import Request
from evenlight.method.preset_files import load_rate_limit, power_model_for, usable_limit, whole_device
from evenlight.stimuli.video.video_source import VideoSource
from evenlight.stimuli.video.viewing_geometry import geometry_words

CALIBRATION, TRACK, REPORT = "calibration", "track", "report.html"
SEE_IT = (
    f"{TRACK}/{PLAYER}",
    "See it play: the video at full brightness, with the track, dimmed constantly.",
)

BUDGETS = {
    BudgetUnit.FACTOR: "mean brightness factor",
    BudgetUnit.POWER: "share of full power",
    BudgetUnit.WATT: "W, mean power",
}
FILES = {
    "dataset/": "trials of every participant, as recorded",
    "SHA256SUMS": "of every file: what a later demo knows this one by, and replaces",
    "calibration/thresholds.csv": "thresholds of each participant and level, with intervals",
    "calibration/rate_limit.json": "the fitted rate limit, which the optimizer read",
    "calibration/fit_summary.json": "what the fit rests on",
    "track/track.csv": "the brightness factor of each frame, and what it does",
    "track/player.html": "the video beside its dimmed versions, and the track, in a browser",
    "track/summary.json": "what the track achieves",
    "track/loss_curves.npz": "contrast loss of each frame at every factor, for another run",
}


def close_loop(
    dataset: Path, source: VideoSource, budget: float, folder: Path, quiet: bool = False
) -> OptimizationSummary:
    """Fit a data set, optimize a video within the rate limit that comes out, report both; return the track's.

    Parameters
    ----------
    dataset, source, budget : Path, VideoSource, float
        Ramp sessions; the video; its mean brightness factor.
    folder, quiet : Path, bool
        Where `calibration/`, `track/` and `report.html` go; whether to show no progress.
    """
    data = load_ramp_data(dataset)
    calibration = calibrate(data, RateLimitOptions())
    fitted = folder / CALIBRATION
    origin = provenance_now(inputs={"dataset": data.sha256})
    write_calibration(calibration, fitted, origin)
    found = ramp_findings(calibration, load_rate_limit("surace2025"))
    write_pictures(found, fitted)
    # The optimizer reads the file that the fit wrote, as it would on another day.
    # However few the participants: it is a demonstration, and its report says how well the limit is known.
    limit = usable_limit(load_rate_limit(fitted / "rate_limit.json"), data.display, accept_wide_band=True)
    display = whole_device(data.display)
    request = Request(budget, BudgetUnit.FACTOR, power_model_for(display), limit)
    job = OptimizationJob(source, display, request, calm=DEFAULT_CALM, player=True, price=True, quiet=quiet)
    summary = run_optimization(job, folder / TRACK)
    write_report(folder / REPORT, _report(calibration, found, summary, origin, folder))
    return summary


def _report(
    calibration: Calibration, found: Analysis, summary: OptimizationSummary, origin: Provenance, folder: Path
) -> Report:
    track, simulated = folder / TRACK, calibration.data.simulated
    curve, thresholds, _ = found.sections  # not every threshold
    made = track_section(summary, (track / "track.png").read_bytes(), simulated)
    price = Picture((track / "price.png").read_bytes(), about(summary))
    return Report(
        "From ramps to a brightness track",
        cautious(calibration.concerns, sentence(verdict(summary)) + "."),
        (
            section("demo_introduction"),
            replace(made, links=(SEE_IT,), pictures=(*made.pictures, price)),
            contrast_map_section((track / "contrast_map.png").read_bytes(), simulated),
            thresholds,
            curve,
            provenance_section(origins_of(calibration, origin, summary)),
            files_section(FILES),
        ),
        key_figures=key_figures(summary),
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


def track_section(summary: OptimizationSummary, track_png: bytes, simulated: bool = False) -> Section:
    """Return what the optimizer made of a video; the picture is its `track_figure`."""
    caption = (
        "Brightness factor, visible contrast lost and rate of change over time, for the track (blue) and for "
        "constant dimming at the same power (orange). The rate, above 0 where the modulation brightens, "
        "must stay out of the red areas. Below: frames at the marked times, at full brightness and as they "
        "are shown."
    )
    return section(
        "track",
        (_summary_table(summary),),
        (Picture(track_png, caption),),
        simulated=simulated,
        summary=summary,
        gained=detail_sentences(summary),
        meaning=f"{sentence(rate_in_words(summary))}. {detection_in_words(summary)}",
        claim=CLAIM,
    )


def _summary_table(summary: OptimizationSummary) -> Table:
    s, procedure = summary, summary.rate_limit_procedure
    asked = "" if procedure is None else f" ({procedure.value.replace('_', ' ')})"
    seen = geometry_words(s.field_of_view, s.pixels_per_degree)
    loss, difference = (
        (s.mean_contrast_loss, s.mean_contrast_loss_baseline),
        (s.objective, s.objective_baseline),
    )
    power = f"the power model {s.power_model}" if s.power_model else "no power model"
    watts = (
        ("mean power", s.mean_power, s.baseline_power, "W"),
        ("power at full brightness", s.full_power, s.full_power, "W"),
    )
    return Table(
        f"{s.video} on {s.display}, seen {seen}, with {power} and the rate limit {s.rate_limit}{asked}.",
        ("quantity", "track", "constant dimming", "unit"),
        (
            ("budget asked", s.budget, s.budget, BUDGETS[s.budget_unit]),
            ("budget used", s.achieved, s.budget, BUDGETS[s.budget_unit]),
            ("mean brightness factor", s.mean_factor, s.baseline_factor, "1"),
            *(watts if s.power_model else ()),
            ("visible contrast lost", *map(_percent, loss), "%"),
            ("difference of loss between two frames", *map(_percent, difference), "points"),
            ("best possible difference", 100 * s.lower_bound, None, "points"),
            ("fastest change, of the rate limit", _percent(s.max_rate_ratio), 0.0, "%"),
            ("at the rate limit, of the time", _percent(s.share_at_limit), 0.0, "%"),
            ("near it (above 90 % of it), of the time", _percent(s.share_near_limit), 0.0, "%"),
            ("reversals of the brightness", s.reversals_per_s, 0.0, "1/s"),
            ("length", s.duration, s.duration, "s"),
            ("frames", s.frames, s.frames, "1"),
            ("time for loss curves", s.curves_s, None, "s"),
            (f"time for the solver ({s.solver}, {s.iterations} iterations)", s.solve_s, None, "s"),
        ),
    )


def _percent(share: float | None) -> float | None:
    return None if share is None else 100 * share


def contrast_map_section(contrast_map_png: bytes, simulated: bool = False) -> Section:
    """Return where contrast is lost in one frame; the picture is its `contrast_map_figure`."""
    caption = (
        "A frame, and its visible and lost contrast under the track's factor and under constant dimming."
    )
    return section("contrast_map", (), (Picture(contrast_map_png, caption),), simulated=simulated)
