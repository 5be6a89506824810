"""What is kept of a dimmed walk, and gains that were tuned elsewhere."""

from pathlib import Path

import pytest

from data_schema.control import LoopReport, TuningReport
from data_schema.display import Display
from data_schema.errors import InputError
from data_schema.live_control import LiveRefresh
from data_schema.provenance import Provenance
from data_schema.text_files import write_json_record
from experiments.live_record import live_control, settings_of
from method.choices import LimitCurve
from method.preset_files import load_rate_limit

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


def test_means_are_over_the_refreshes_whose_loss_was_known() -> None:
    rows = [LiveRefresh(0, 0.0, 0.5), LiveRefresh(1, 0.1, 0.7, contrast_loss=0.2)]
    limit = load_rate_limit("surace2025"), LimitCurve.SAFE
    kept = live_control(settings_of(0.03, None), limit, ("house", BENCH, "cpu"), rows, simulated=True)
    assert kept.mean_loss == 0.2
    assert kept.mean_factor == pytest.approx(0.6)
    assert (kept.limit_curve, kept.rate_limit, kept.simulated) == ("safe", "surace2025", True)
    assert set(kept.provenance.inputs) == {"display", "rate_limit"}


def test_a_walk_that_ended_at_once_has_no_means() -> None:
    limit = load_rate_limit("surace2025"), LimitCurve.FITTED
    kept = live_control(settings_of(0.03, None), limit, ("house", BENCH, "cpu"), [], simulated=False)
    assert (kept.mean_loss, kept.mean_factor) == (None, None)
