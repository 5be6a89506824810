"""What is kept of a dimmed walk, and gains that were tuned elsewhere."""

from pathlib import Path

import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.control import LiveRefresh, LoopReport, TuningReport
from evenlight.experiments.playback.live_record import live_control
from evenlight.experiments.playback.walk import WalkResult, between_answers, over_time, walk_summary
from evenlight.experiments.playback.walk_request import settings_of
from evenlight.method.choices import LimitCurve
from evenlight.method.preset_files import load_rate_limit

BENCH = Display("bench", 104.4, 0.2, 1.95, 72.28)


def a_loop(proportional: float) -> LoopReport:
    return LoopReport(proportional, 0.02, 0.0, 2.0, 9.0, 100.0, 1.5, 0.01, 0.01, 0.5)


def test_gains_that_were_tuned_are_those_of_the_walk_with_their_frame_rate(tmp_path: Path) -> None:
    report = TuningReport(
        "v", 0.1, 45.0, 25.0, 0.99, 0.4, 0.5, 6.0, 45.0, a_loop(0.2), a_loop(0.7), 3, Provenance()
    )
    write_json_record(tmp_path / "tuning.json", report)
    settings = settings_of(0.03, tmp_path / "tuning.json")
    assert (settings.proportional, settings.integral, settings.derivative) == (0.7, 0.02, 0.0)
    assert (settings.gain_rate, settings.target_loss) == (45.0, 0.03)  # the target is the walk's own


def test_a_tuning_that_is_none_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nope\.json: no such file; expected a TuningReport"):
        settings_of(0.03, tmp_path / "nope.json")


def test_means_are_over_the_time_in_which_a_picture_stood() -> None:
    """Pictures of 1, 3 and 2 s, the last of which nobody knows: (0.5 + 3 · 0.7 + 2 · 0.6) / 6."""
    rows = [
        LiveRefresh(0, 0.0, 0.5),
        LiveRefresh(1, 1.0, 0.7, contrast_loss=0.2, rate=-3.0, rate_limit=4.0),
        LiveRefresh(2, 4.0, 0.6, contrast_loss=0.1, rate=1.0, rate_limit=2.0),
        LiveRefresh(3, 6.0, 1.0, contrast_loss=1.0, rate=0.0, rate_limit=0.0),
    ]
    limit = load_rate_limit("surace2025"), LimitCurve.SAFE
    kept = live_control(settings_of(0.03, None), limit, ("house", BENCH, "cpu"), rows, simulated=True)
    assert kept.mean_loss == pytest.approx(0.8 / 5)
    assert kept.mean_factor == pytest.approx(3.8 / 6)
    assert kept.max_rate_ratio == 0.75
    assert (kept.limit_curve, kept.rate_limit, kept.simulated) == ("safe", "surace2025", True)
    assert set(kept.provenance.inputs) == {"display", "rate_limit"}


def test_a_walk_that_ended_at_once_has_no_means() -> None:
    limit = load_rate_limit("surace2025"), LimitCurve.FITTED
    kept = live_control(settings_of(0.03, None), limit, ("house", BENCH, "cpu"), [], simulated=False)
    assert (kept.mean_loss, kept.mean_factor, kept.max_rate_ratio) == (None, None, None)


def test_the_mean_of_a_single_picture_is_its_own() -> None:
    assert over_time([LiveRefresh(0, 0.0, 0.5)], [0.5]) == 0.5


def test_the_time_between_answers_is_from_one_that_is_new_to_the_next() -> None:
    """Answers appear at 0.1, 0.2 and 0.5 s: 0.1 and 0.3 s apart."""
    measured = [None, 0, 1, 1, 1, 4, 4]
    rows = [LiveRefresh(k, k / 10, 0.5, measured_refresh=one) for k, one in enumerate(measured)]
    assert between_answers(rows) == pytest.approx(0.2)
    assert between_answers(rows[:2]) is None


@pytest.mark.parametrize(("moves", "warned"), [(False, True), (True, False)])
def test_a_walk_that_gains_nothing_says_so_at_its_end(moves: bool, warned: bool) -> None:
    """Content that loses s (1 - b)^1.5, over more than a minute: constant dimming, or a loss that stays."""
    rows = []
    for k in range(140):
        strength = 0.1 + 0.05 * (k % 2)
        factor = 1 - (0.03 / strength) ** (1 / 1.5) if moves else 0.5
        loss = strength * (1 - factor) ** 1.5
        rows.append(LiveRefresh(k, k / 2, factor, loss, k, factor))
    walked = WalkResult(tuple(row.flip_time for row in rows), 0, ())
    assert ("; nothing is gained: the loss varies" in walk_summary("house", walked, rows, None)) is warned
    assert "nothing is gained" not in walk_summary("house", walked, rows[:100], None)  # under a minute
