"""The online controller's figures: steadiness against constant dimming, and brightness over the target."""

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from online_spread_coverage import coverage, walk_ratios
from scipy import stats

from evenlight.analysis.reproduction.online import online_findings
from evenlight.analysis.results import Analysis
from evenlight.analysis.tracks.loss_spread import spread_ratio
from evenlight.data_schema.analysis_results import Origin
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.rate_limit import scalar_rate_limit

TARGETS = [0.05, 0.1, 0.2, 0.5]
CONTROLLER = Controller(ControllerSettings(0.1), scalar_rate_limit(load_rate_limit("surace2025")))


@pytest.fixture(scope="module")
def rooms(make_curves: Callable[..., LossCurves]) -> LossCurves:
    """A walk from bright to dark rooms and back, at 5 Hz for two minutes."""
    times = np.arange(600) / 5
    return make_curves(
        0.25 + 0.1 * np.sin(times / 8), luminance=40 - 20 * np.sin(times / 8), frames_per_second=5.0
    )


@pytest.fixture(scope="module")
def found(rooms: LossCurves) -> Analysis:
    return online_findings(rooms, rooms, CONTROLLER, TARGETS)


def drawn(found: Analysis, panel: str, series: str) -> list[float]:
    points = (p for own in found.drawings for p in own.points if (p.panel, p.series) == (panel, series))
    return [point.y for point in points]


def test_constant_dimming_has_the_mean_brightness_of_the_controller(
    found: Analysis, rooms: LossCurves
) -> None:
    factors, (constant, *_) = (
        drawn(found, "brightness factor", series) for series in ("online controller", "constant dimming")
    )
    assert constant == pytest.approx(np.mean(factors), rel=1e-12)
    expected = (0.25 + 0.1 * np.sin(rooms.times / 8)) * (1 - constant)
    np.testing.assert_allclose(drawn(found, "contrast loss", "constant dimming"), expected, atol=1e-12)


def test_ratio_is_that_of_the_standard_deviations_over_time() -> None:
    rng = np.random.default_rng(1)
    loss, other, durations = rng.uniform(size=50), rng.uniform(size=50), rng.integers(1, 4, 50)
    found = spread_ratio(loss, other, durations.astype(float))
    # A frame of n seconds counts as n frames of one.
    assert found.sd == pytest.approx(np.repeat(loss, durations).std(), rel=1e-12)
    assert found.sd_constant == pytest.approx(np.repeat(other, durations).std(), rel=1e-12)
    assert found.ratio == pytest.approx(found.sd / found.sd_constant, rel=1e-12)


def test_interval_of_independent_frames_is_that_of_textbooks() -> None:
    # SDs of n independent normal values: var(ln ratio) = 1/(2n) + 1/(2n). The series estimate of it scatters
    # (4 degrees of freedom), so its mean square over many series is compared.
    rng = np.random.default_rng(2)
    n, halves = 400, []
    for _ in range(400):
        found = spread_ratio(rng.normal(size=n), rng.normal(size=n), np.ones(n))
        assert found.ci_low is not None
        assert found.ci_high is not None
        halves.append(np.log(found.ci_high / found.ci_low) / 2 / stats.t.ppf(0.975, 4))
    # chi-square with 4 · 400 degrees of freedom: a standard error of 3.5 %
    assert np.mean(np.square(halves)) * n == pytest.approx(1.0, abs=4 * 0.035)


def test_interval_holds_the_ratio_of_such_walks() -> None:
    # 400 walks; content correlated over 5 s of 182. Nominal 95 % ± 1.96 sqrt(0.95 · 0.05 / 400) = ± 2.1 %,
    # and the claim is 92 to 98 %: 4000 walks gave 96.1 %.
    ratios = walk_ratios(182.0, 5.0, 400, seed=3)
    assert 0.92 - 0.021 <= coverage(ratios) <= min(0.98 + 0.021, 0.995)


def test_a_walk_too_short_for_its_content_is_flagged() -> None:
    slow = walk_ratios(60.0, 20.0, 20, seed=4)
    assert sum("correlation times" in found.flag for found in slow) >= 15
    fast = walk_ratios(182.0, 1.0, 20, seed=4)
    assert not any(found.flag for found in fast)


def test_correlation_time_is_the_contents() -> None:
    # A square wave of period 40 s: its autocorrelation falls linearly and is 1/e near 6 s.
    wave = np.sign(np.sin(2 * np.pi * (np.arange(4000) + 0.5) / 200))
    found = spread_ratio(wave, wave, np.full(4000, 0.2))
    assert found.correlation_time == pytest.approx(20 * (1 - 1 / np.e) / 2, abs=0.4)
    assert found.ratio == 1.0


@pytest.mark.parametrize("n", [1, 5])
def test_content_that_never_changes_has_no_ratio(make_curves: Callable[..., LossCurves], n: int) -> None:
    curves = make_curves(np.full(n, 0.3))
    found = online_findings(curves, curves, CONTROLLER, [0.05, 0.1])
    ratio = next(row for row in found.rows if row.what.startswith("SD of the controller /"))
    assert ratio.value is None
    assert "never changes" in ratio.flag
    assert "nothing to steady" in found.lead
    assert found.warnings


def test_a_perfectly_steady_loss_has_ratio_0_and_no_interval() -> None:
    found = spread_ratio(np.full(20, 0.1), np.linspace(0, 1, 20), np.ones(20))
    assert (found.ratio, found.ci_low, found.ci_high) == (0.0, None, None)
    assert found.flag


def test_a_larger_target_saves_more_until_the_lowest_factor(found: Analysis) -> None:
    factors = drawn(found, "mean brightness factor", "online controller")
    assert len(factors) == len(TARGETS)
    assert factors[0] < 1
    assert all(a > b for a, b in itertools.pairwise(factors))
    assert factors[-1] == pytest.approx(0.2, abs=1e-9)
    assert drawn(found, "mean contrast loss reached", "online controller")[1] == pytest.approx(0.1, abs=0.01)


def test_findings_set_the_published_beside_ours(found: Analysis) -> None:
    assert found.name == "online"
    printed = [row.value for row in found.rows if row.origin is Origin.PUBLISHED]
    assert printed == [0.12, 0.19, pytest.approx(0.12 / 0.19)]
    ratio = next(row for row in found.rows if row.what.startswith("SD of the controller /"))
    assert ratio.n == 600
    assert ratio.value is not None
    assert ratio.value < 1
    # 120 s hold 12 correlation times of this content: an interval would hold the truth too seldom.
    assert (ratio.ci_low, ratio.ci_high) == (None, None)
    assert "no interval" in ratio.flag
    assert "95 %" not in found.lead
    fastest = next(row.value for row in found.rows if row.what.startswith("largest ratio"))
    assert fastest is not None
    assert fastest <= 1
    assert ratio.flag.startswith("partly determined: gains and rate limit; ")
    assert len(found.drawings[0].points) == 5 * 600  # two losses, the target, two factors
    (line,) = [row for row in found.sections[0].tables[0].rows if row[1].startswith("SD of the controller /")]
    assert line[2:4] == ("0.632", f"{ratio.value:.3g}")
    assert line[5:8] == ("computed", "partly determined", "gains and rate limit")
