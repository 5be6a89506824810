"""PWM, response times and latency come out of light of known truth; what cannot be known is refused."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from evenlight.analysis.measurement.light.light_figures import latency_figure, response_figure, ripple_figure
from evenlight.analysis.measurement.light.light_findings import LightFindings, analyse_light
from evenlight.analysis.measurement.light.light_recording import LightRecording, _clipped_share
from evenlight.analysis.measurement.light.ripple import find_ripple
from evenlight.analysis.measurement.played_power.clock_line import ClockEstimate, ClockLine
from evenlight.analysis.report_prose import prose
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.light import LightLog
from evenlight.data_schema.recordings.played_power import ClockMethod

DARK, BRIGHT = 0.02, 0.4
HALF_OF_TEN_TO_NINETY = np.log(2) / np.log(9)  # when an exponential change is half made, of its 10 to 90 %


def pwm(times: np.ndarray, frequency: float, depth: float, duty: float = 0.5) -> np.ndarray:
    """A light of two levels, H and L, with (H - L) / (H + L) = depth."""
    return np.where((times * frequency + 0.31) % 1 < duty, 1 + depth, 1 - depth)


def steady(
    rate: float, frequency: float, depth: float, seconds: float = 2.0
) -> tuple[np.ndarray, np.ndarray]:
    """A white of 12 bits, with noise of 0.1 % of full scale."""
    times = np.arange(0, seconds, 1 / rate)
    noise = 0.001 * np.random.default_rng(3).standard_normal(len(times))
    return times, np.round((DARK + BRIGHT * pwm(times, frequency, depth) + noise) * 4095) / 4095


@dataclass(frozen=True)
class Truth:
    """A display, and a photodiode at it."""

    rate: float = 10_000.0
    rise: float = 0.006  # 10 to 90 % of an exponential change [s]
    fall: float = 0.004
    delay: float = 0.0231  # from a flip until the light begins to change [s]
    noise: float = 0.004  # 1 % of the change
    ripple: float = 0.0  # [Hz]
    depth: float = 0.5
    n_edges: int = 40
    never_shown: tuple[int, ...] = ()  # changes that the display leaves out
    drift: float = 0.0  # of the light, each second
    high_pass: float = 0.0  # time constant of an AC-coupled input [s]

    def recording(self) -> LightRecording:
        rng = np.random.default_rng(1)
        flips = np.cumsum([1.0, 2.0, *(rng.integers(13, 18, self.n_edges - 1) / 60)])
        lit = np.arange(len(flips)) % 2 == 0
        times = np.arange(0, flips[-1] + 0.28, 1 / self.rate)
        light, level = np.zeros(len(times)), 0.0
        for k, (flip, end) in enumerate(zip(flips, [*flips[1:], times[-1] + 1], strict=True)):
            aim = level if k in self.never_shown else float(lit[k])
            own = (times >= flip + self.delay) & (times < end + self.delay)
            constant = (self.rise if aim > level else self.fall) / np.log(9)
            light[own] = aim + (level - aim) * np.exp(-(times[own] - flip - self.delay) / constant)
            level = aim + (level - aim) * np.exp(-(end - flip) / constant)
        light *= 1 + self.drift * times
        if self.ripple:
            light *= pwm(times, self.ripple, self.depth)
        values = BRIGHT * light
        if self.high_pass:
            keep, passed = np.exp(-1 / (self.rate * self.high_pass)), 0.0
            for k, step in enumerate(np.diff(values, prepend=0.0).tolist()):
                values[k] = passed = keep * (passed + step)
        values = values + DARK * (not self.high_pass) + self.noise * rng.standard_normal(len(times))
        log = LightLog(False, "a photodiode", self.rate, None, not self.high_pass, None, 60.0, "top left")
        clock = ClockEstimate(ClockMethod.PINGS, ClockLine(0.0, 0.0), 0.0, 1e-5, 10)
        return LightRecording(log, times, values, flips, lit, clock)


def found(truth: Truth) -> LightFindings:
    return analyse_light(truth.recording(), Provenance())


@pytest.mark.parametrize(
    ("rate", "frequency"),
    [(5000.0, 60.0), (5000.0, 244.7), (10_000.0, 1000.3), (5000.0, 2000.0), (48_000.0, 2000.0)],
)
@pytest.mark.parametrize("depth", [0.05, 0.3, 1.0])
def test_frequency_and_depth_are_within_half_a_percent(rate: float, frequency: float, depth: float) -> None:
    ripple = find_ripple(*steady(rate, frequency, depth), rate, DARK, dc_coupled=True).ripple
    assert ripple.frequency == pytest.approx(frequency, rel=0.005)
    assert ripple.frequency_ci_low - 0.01 < frequency < ripple.frequency_ci_high + 0.01
    assert ripple.depth == pytest.approx(depth, abs=0.005)
    few = rate == 5000.0 and frequency == 2000.0  # five phases
    assert ripple.depth_is_least == few
    assert (ripple.duty is None) == few


@pytest.mark.parametrize("depth", [0.05, 0.3])
@pytest.mark.parametrize("round_", [False, True])
def test_the_interval_of_the_depth_holds_what_is_true(depth: float, round_: bool) -> None:
    """At least 16 of 20 intervals of 95 %: fewer would be a chance of 1 in 400."""
    times, held = np.arange(0, 1, 1e-4), 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        phase = (times * 240.3 + rng.random()) % 1
        wave = np.sin(2 * np.pi * phase) if round_ else np.where(phase < 0.5, 1.0, -1.0)
        values = DARK + BRIGHT * (1 + depth * wave) + 0.004 * rng.standard_normal(len(times))
        ripple = find_ripple(times, values, 1e4, DARK, dc_coupled=True).ripple
        held += ripple.depth_ci_low <= depth <= ripple.depth_ci_high
        assert ripple.depth_ci_high - ripple.depth_ci_low < 0.01
    assert held >= 16


def test_a_duty_that_four_phases_cannot_tell_is_not_stated() -> None:
    times = np.arange(48_000) / 48_000
    values = 0.4 + 0.2 * np.sin(2 * np.pi * 12_000 * times + 0.3)
    values += 1e-3 * np.random.default_rng(1).standard_normal(len(times))
    ripple = find_ripple(times, values, 48_000.0, 0.0, dc_coupled=True).ripple
    assert ripple.duty is None
    assert ripple.depth_is_least


def test_the_spread_of_latency_is_that_within_a_direction() -> None:
    """A rise of 20 ms and a fall of 1 ms: their middles are 6 ms apart, and each has hardly any spread."""
    assert found(Truth(rise=0.02, fall=0.001)).results.latency.sd < 5e-4


def test_without_darkness_the_depth_is_a_lower_limit() -> None:
    """(H - L) / (H + L + 2 dark) = 0.3 * 0.4 / (0.4 + 0.02)."""
    ripple = find_ripple(*steady(10_000.0, 240.0, 0.3), 10_000.0, None, dc_coupled=True).ripple
    assert ripple.depth_is_least
    assert ripple.depth == pytest.approx(0.3 * 0.4 / 0.42, abs=0.005)


def test_noise_has_no_pwm_and_is_told_how_small_one_may_be() -> None:
    """A sine of amplitude A over N samples of noise s stands out where A > s * sqrt(some 60 / N)."""
    rng, times = np.random.default_rng(7), np.arange(0, 2, 1e-4)
    falsely = 0
    for _ in range(50):
        values = DARK + BRIGHT + 0.001 * rng.standard_normal(len(times)) + 0.01 * times  # and some drift
        ripple = find_ripple(times, values, 1e4, DARK, dc_coupled=True).ripple
        falsely += ripple.frequency is not None
        assert ripple.smallest_seen is None or 1e-5 < ripple.smallest_seen < 1e-3
    assert falsely <= 1
    hidden = values + ripple.smallest_seen * BRIGHT * 1.5 * np.sin(2 * np.pi * 333 * times)
    assert find_ripple(times, hidden, 1e4, DARK, dc_coupled=True).ripple.frequency == pytest.approx(
        333, rel=0.005
    )


def test_half_the_sampling_rate_is_the_end_of_what_is_looked_at() -> None:
    ripple = find_ripple(*steady(1000.0, 2300.0, 0.5), 1000.0, DARK, dc_coupled=True).ripple
    assert ripple.highest_frequency == pytest.approx(500.0)
    assert ripple.frequency == pytest.approx(300.0, rel=0.005)  # mirrored: 2300 - 2 * 1000
    assert (
        "above 500 Hz would not be seen, or as a lower one"
        in prose("light_lines", results=found(Truth(rate=1000.0)).results)[-1]
    )


def test_an_ac_coupled_input_states_no_depth() -> None:
    times, values = steady(48_000.0, 240.0, 0.3)
    assert find_ripple(times, values - values.mean(), 48_000.0, None, dc_coupled=False).ripple.depth is None
    claimed = find_ripple(
        times, values - values.mean(), 48_000.0, None, dc_coupled=True
    ).ripple  # and says otherwise
    assert claimed.frequency == pytest.approx(240.0, rel=0.005)
    assert claimed.depth is None


@pytest.mark.parametrize(("rise", "fall"), [(0.001, 0.0015), (0.006, 0.004), (0.02, 0.012)])
@pytest.mark.parametrize("rate", [1000.0, 48_000.0])
def test_response_and_latency_are_those_of_the_display(rate: float, rise: float, fall: float) -> None:
    results = found(Truth(rate=rate, rise=rise, fall=fall)).results
    assert (results.n_edges, results.n_flips, results.n_extra) == (40, 40, 0)
    for response, true in zip(results.response_times, (rise, fall), strict=True):
        assert response.time == pytest.approx(true, abs=max(0.05 * true, 2 / rate))
        assert response.ci_low - 2 / rate < true < response.ci_high + 2 / rate
        assert response.is_most == (true < 3 / rate)
    within = 1e-3 if rate == 1000.0 else 1e-4
    true = 0.0231 + HALF_OF_TEN_TO_NINETY * np.array([rise, fall])
    assert results.latency.median_rising == pytest.approx(true[0], abs=within)
    assert results.latency.median_falling == pytest.approx(true[1], abs=within)


def test_a_pwm_is_divided_out_of_the_edges() -> None:
    results = found(Truth(ripple=240.3, depth=0.5)).results
    assert results.averaged_over is None
    assert [one.time for one in results.response_times] == pytest.approx([0.006, 0.004], rel=0.05)
    assert not any(one.is_most for one in results.response_times)
    assert results.latency.median_rising == pytest.approx(0.0231 + HALF_OF_TEN_TO_NINETY * 0.006, abs=2e-4)


def test_a_pwm_that_goes_dark_makes_the_response_an_upper_limit() -> None:
    results = found(Truth(ripple=240.3, depth=1.0)).results
    assert results.averaged_over == pytest.approx(1 / 240.3, rel=0.005)
    assert results.n_edges == 40
    for response, true in zip(results.response_times, (0.006, 0.004), strict=True):
        assert response.is_most
        assert response.time > true


def test_changes_that_were_never_shown_are_counted() -> None:
    """Two changes left out, white to black and back: the white lasts, and two flips have no edge."""
    findings = found(Truth(never_shown=(11, 12)))
    assert (findings.results.n_edges, findings.results.n_extra) == (38, 0)
    assert np.flatnonzero(~np.isfinite(findings.latencies)).tolist() == [10, 11]
    assert "not verified: 2 of its 40 changes" in " ".join(findings.results.notes)
    assert [one.time for one in findings.results.response_times] == pytest.approx([0.006, 0.004], rel=0.05)


def test_a_flash_that_no_flip_made_is_counted() -> None:
    recording = Truth().recording()
    dark = (recording.times > recording.flips[5] + 0.08) & (recording.times < recording.flips[5] + 0.09)
    assert not recording.lit[5]
    flashed = replace(recording, values=np.where(dark, recording.values + BRIGHT, recording.values))
    results = analyse_light(flashed, Provenance()).results
    assert results.n_extra == 2  # up and down
    assert "2 edges belong to none" in " ".join(results.notes)


def test_light_that_does_not_change_with_the_patch_is_said() -> None:
    recording = Truth().recording()
    noise = DARK + 0.001 * np.random.default_rng(2).standard_normal(len(recording.times))
    results = analyse_light(replace(recording, values=noise), Provenance()).results
    assert (results.n_edges, results.latency, results.response_times) == (0, None, ())
    assert "is the photodiode on it" in " ".join(results.notes)


@pytest.mark.parametrize("truth", [Truth(delay=0.3), Truth(noise=0.3)])
def test_a_display_later_than_an_interval_and_noise_make_no_latency(truth: Truth) -> None:
    """The noise is three quarters of the change; at 0.3 s each change comes after the next flip."""
    results = found(truth).results
    assert (results.n_edges, results.latency, results.response_times) == (0, None, ())
    assert "does not change clearly with the patch" in " ".join(results.notes)


def test_a_drift_of_the_light_is_none_of_the_response() -> None:
    results = found(Truth(drift=-0.02)).results  # a quarter of the light, in all
    assert results.n_edges == 40
    assert [one.time for one in results.response_times] == pytest.approx([0.006, 0.004], rel=0.05)


def test_an_ac_coupled_input_has_a_latency_and_no_response() -> None:
    results = found(Truth(rate=20_000.0, high_pass=0.05)).results
    assert (results.n_edges, results.n_extra, results.response_times) == (40, 0, ())
    assert results.latency.median_rising == pytest.approx(0.0231 + HALF_OF_TEN_TO_NINETY * 0.006, abs=5e-4)
    assert "AC-coupled" in " ".join(results.notes)


def test_a_light_that_never_rests_has_no_response_time() -> None:
    results = found(Truth(rise=0.3, fall=0.3)).results
    assert results.response_times == ()
    assert "still moving" in " ".join(results.notes)


def test_a_diode_wired_the_other_way_round_gives_the_same() -> None:
    recording = Truth(ripple=240.3, depth=0.3).recording()
    results = analyse_light(replace(recording, values=1 - recording.values), Provenance()).results
    assert results.ripple.depth == pytest.approx(0.3, abs=0.005)
    assert (results.n_edges, results.n_extra) == (40, 0)
    assert [one.time for one in results.response_times] == pytest.approx([0.006, 0.004], rel=0.05)


def test_clipped_light_is_told_on_a_known_and_on_an_unknown_scale() -> None:
    times, values = steady(10_000.0, 240.0, 0.3)
    assert _clipped_share(values, 1.0, dc_coupled=True) == 0.0
    assert _clipped_share(np.minimum(values * 2.2, 1.0), 1.0, dc_coupled=True) == pytest.approx(0.5, abs=0.02)
    sine = np.sin(times * 500) + 0.01 * np.random.default_rng(1).standard_normal(len(times))
    assert _clipped_share(sine, None, dc_coupled=False) == 0.0
    # A sine is above 0.5 for a third of its period.
    assert _clipped_share(np.minimum(sine, 0.5), None, dc_coupled=False) == pytest.approx(1 / 3, abs=0.02)


def test_each_figure_says_what_it_shows() -> None:
    findings = found(Truth(ripple=240.3, depth=0.3, never_shown=(11, 12)))
    titles = [
        " ".join(text.get_text() for text in draw(findings).texts)
        for draw in (ripple_figure, response_figure, latency_figure)
    ]
    assert "PWM of 240.3 Hz, depth " in titles[0]
    assert "Response up 6" in titles[1]
    assert "38 of 40 changes have their edge" in titles[2]
    none = analyse_light(
        replace(findings.recording, values=findings.recording.values * 0 + DARK), Provenance()
    )
    assert "No PWM found" in ripple_figure(none).texts[0].get_text()
