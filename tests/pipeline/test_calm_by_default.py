"""Tracks are calm unless asked otherwise; the reproduction and `calm=0` solve the paper's problem exactly."""

import inspect
from dataclasses import replace

import numpy as np
import pytest

import evenlight
from evenlight.analysis.optimize_command import optimize as optimize_command
from evenlight.analysis.reproduction.reproduction import _job
from evenlight.analysis.tracks.optimization_job import AnalysedVideo
from evenlight.analysis.tracks.track_request import TrackRequest
from evenlight.analysis.tracks.track_results import run_optimization
from evenlight.analysis.tracks.track_words import detection_in_words
from evenlight.data_schema.analysis_results import PlottedPoint
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.optimizer.optimize import pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.splitting import SplittingSolver
from evenlight.method.preset_files import load_display, load_power_model, load_rate_limit
from evenlight.stimuli.sequences import built_in_sequence


@pytest.fixture(scope="module")
def tracks(make_curves):
    """A clip of two trembling scenes: its curves, and its tracks as they come, and exact."""
    rng = np.random.default_rng(2)
    strengths = np.repeat([0.3, 0.6], 15) + 0.03 * rng.standard_normal(30)
    curves = make_curves(strengths, frames_per_second=2.5)
    return curves, evenlight.optimize(curves, 0.5), evenlight.optimize(curves, 0.5, calm=0.0)


def test_a_twentieth_of_the_gain_is_given_up_by_default(tracks) -> None:
    _, calm, exact = tracks
    assert (calm.outcome.calm, exact.outcome.calm) == (0.05, 0.0)
    assert inspect.signature(optimize_command).parameters["calm"].default == 0.05
    gain = exact.objective_baseline - exact.objective
    assert exact.objective < calm.objective <= exact.objective + 0.05 * gain
    assert exact.outcome.share_at_limit > 0.5
    assert calm.outcome.share_at_limit == 0
    for made in (calm, exact):
        near = np.abs(made.track.rate) > 0.9 * made.track.rate_limit  # frames last equally long
        assert made.outcome.share_near_limit == pytest.approx(near.mean())
        assert f"near its limit {100 * near.mean():.0f} % of the time" in detection_in_words(made.outcome)


def test_without_calm_it_is_the_solvers_answer_to_the_bit(tracks) -> None:
    curves, _, exact = tracks
    power, limit = load_power_model("surace2025"), load_rate_limit("surace2025")
    problem = pose(curves, Request(0.5, BudgetUnit.FACTOR, power, limit))
    np.testing.assert_array_equal(exact.factors, SplittingSolver().solve(problem).factors)


def test_the_reproduction_solves_the_papers_problem() -> None:
    display, limit = load_display("varjo-xr3"), load_rate_limit("surace2025")
    assert _job(built_in_sequence("sunrise", duration=1.0), 0.5, display, limit).calm == 0


def test_a_share_of_detections_moves_the_limit_and_three_quarters_leave_it(tracks) -> None:
    curves, _, exact = tracks
    usual, slow = (evenlight.optimize(curves, 0.5, calm=0.0, noticed=share) for share in (0.75, 0.25))
    np.testing.assert_array_equal(usual.factors, exact.factors)
    header, limit = slow.track.header, load_rate_limit("surace2025")
    assert (usual.track.header.noticed, header.noticed, exact.track.header.noticed) == (0.75, 0.25, None)
    assert header.provenance.inputs["rate_limit"] == sha256_of_record(limit)
    ratio = np.exp(1.6 * np.log(1 / 9) / (2 * np.log(19)))  # logit 0.25 - logit 0.75
    at_ends = ratio * limit(slow.track.mean_luminance)
    np.testing.assert_allclose(slow.track.rate_limit[:-1], np.minimum(at_ends[:-1], at_ends[1:]))
    assert slow.outcome.watched.noticed < 0.25 + 1e-9
    assert slow.outcome.watched.noticed < exact.outcome.watched.noticed
    with pytest.raises(InputError, match=r"below 1, got 75 \(0.75 is 75 %\)"):
        evenlight.optimize(curves, 0.5, noticed=75)


def test_the_price_of_invisibility_is_what_separate_tracks_gain(tracks, tmp_path) -> None:
    """One search in place of all of the solver's: within a thousandth of constant dimming's difference."""
    curves, calm, _ = tracks
    display, request = TrackRequest(budget=0.5).posed(curves)
    job = TrackRequest(budget=0.5).job(AnalysedVideo(curves), display, request)
    run_optimization(replace(job, price=True, quiet=True), tmp_path)
    assert (tmp_path / "price.png").is_file()
    points = read_rows(PlottedPoint, tmp_path / "price_points.csv")
    found = {(point.series, point.x): point.y for point in points}
    for share in (0.1, 0.25, 0.5, 0.75, 0.9):
        made = evenlight.optimize(curves, 0.5, noticed=share, accept_wide_band=True)
        gain = 1 - made.objective / made.objective_baseline
        assert found["gain", 100 * share] == pytest.approx(100 * gain, abs=0.1)
        seen = made.outcome.watched
        assert found["by the median person", 100 * share] == pytest.approx(100 * seen.noticed, abs=1.0)
    assert found["gain, this track", 75.0] == pytest.approx(
        100 * (1 - calm.objective / calm.objective_baseline)
    )
    assert len(points) == 3 * 6


def test_what_the_published_limit_cannot_tell_is_assumed(tracks) -> None:
    seen = tracks[1].outcome.watched
    assert tracks[1].track.header.watched == seen
    assert 0 < seen.noticed < 0.75
    assert "assumed" in str(tracks[1])
