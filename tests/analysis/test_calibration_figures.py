"""Claims about the figures of a calibration: answers, functions, thresholds and the limit through them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure

from evenlight.analysis.calibration.psychometric.psychometric_figure import (
    by_level,
    drawn_answers,
    psychometric_figure,
)
from evenlight.analysis.calibration.psychometric.thresholds import ThresholdFit, fit_thresholds_of
from evenlight.analysis.calibration.rate_limit.rate_limit_figure import level_means, rate_limit_figure
from evenlight.analysis.figure_style import LIMIT, MUTED, PAGE, PARTICIPANT, FigureFormat, png_bytes
from evenlight.data_schema.recordings.ramp import Procedure, RampTrial, Response
from evenlight.data_schema.threshold import Threshold, ThresholdFlag
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.psychometric import yes_probability
from evenlight.method.rate_limit import rate_limit_at

RATES = (0.2, 0.6, 1.2, 2.4)


def ramps(who: str, factor: float, yes: tuple[int, ...], catch_yes: int = 1, n: int = 6) -> list[RampTrial]:
    """Six ramps at each rate, the first so many of them seen, and ten catch trials."""
    answers = [(rate, k < seen) for rate, seen in zip(RATES, yes, strict=True) for k in range(n)]
    answers += [(0.0, k < catch_yes) for k in range(10)]
    return [
        RampTrial(who, "01", k, "white", factor, 40 * factor, 40 * factor - 5 * rate, rate, 5.0, rate == 0,
                  Response.YES if seen else Response.NO, None, True)
        for k, (rate, seen) in enumerate(answers)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def fits() -> list[ThresholdFit]:
    trials = [
        *ramps("01", 0.5, (0, 2, 5, 6)),
        *ramps("01", 1.0, (0, 1, 4, 6)),
        *ramps("02", 0.5, (1, 3, 6, 6), catch_yes=2),
        *ramps("02", 1.0, (0, 0, 0, 0)),
    ]
    return fit_thresholds_of(trials)


def test_answers_are_pooled_over_the_participants_of_a_level(fits: list[ThresholdFit]) -> None:
    (own,) = (group for level, group in by_level(fits).items() if level.factor == 0.5)
    rates, yes, trials = drawn_answers(own)
    np.testing.assert_allclose(rates, np.multiply(RATES, 100 / 20.0))  # %/s of 20 cd/m^2
    assert yes.tolist() == [1, 5, 11, 12]
    assert trials.tolist() == [12, 12, 12, 12]


def test_each_participant_is_drawn_once_in_each_panel_and_as_fitted(fits: list[ThresholdFit]) -> None:
    figure = psychometric_figure(fits)[0]
    panels = [axes for axes in figure.axes if axes.collections]
    assert len(panels) == 2
    levels = sorted(by_level(fits).items(), key=lambda item: item[0].luminance)
    for panel, (level, own) in zip(panels, levels, strict=True):
        curves = [line for line in panel.lines if line.get_color() == PARTICIPANT]
        assert len(curves) == 2
        for curve, fit in zip(curves, own, strict=True):
            rate = np.asarray(curve.get_xdata()) * level.luminance / 100
            np.testing.assert_allclose(curve.get_ydata(), yes_probability(rate, fit.fit.function))


def test_a_threshold_that_cannot_be_used_is_hollow_and_not_in_the_mean(
    fits: list[ThresholdFit], texts_on: Callable[[Figure], list[str]]
) -> None:
    unseen = next(fit.threshold for fit in fits if fit.threshold.flag is ThresholdFlag.ALL_NO)
    usable = next(
        f.threshold for f in fits if f.threshold.factor == 1.0 and f.threshold.participant_id == "01"
    )
    figure = psychometric_figure(fits)[0]
    dots = [line for axes in figure.axes for line in axes.lines if line.get_marker() == "o"]
    hollow = [line.get_xdata()[1] for line in dots if line.get_markerfacecolor() == "white"]
    assert hollow == [pytest.approx(100 * unseen.threshold / unseen.luminance)]
    written = texts_on(figure)
    assert f"{usable.threshold:.3g} cd/m²/s" in written


def test_the_psychometric_functions_are_legible(
    fits: list[ThresholdFit], require_legible: Callable[[Figure, FigureFormat], None]
) -> None:
    require_legible(psychometric_figure(fits, simulated=True)[0], PAGE)


def test_a_participants_catch_trials_are_counted_once(
    fits: list[ThresholdFit], texts_on: Callable[[Figure], list[str]]
) -> None:
    written = " ".join(texts_on(psychometric_figure(fits)[0]))
    assert "96 ramps and 40 catch trials" in written  # 2 participants at 2 levels, with 24 and 10 at each


def thresholds(rates: dict[str, list[float]], flag: ThresholdFlag = ThresholdFlag.NONE) -> list[Threshold]:
    """Thresholds of some participants at 10, 20, ... cd/m^2, with intervals of a factor of 2."""
    return [
        Threshold(who, "white", 0.1 * (k + 1), 10.0 * (k + 1), rate, rate / 2, rate * 2, 0.35, 1.5, 0.05,
                  0.02, 0.1, 48, 12, flag)
        for who, own in rates.items()
        for k, rate in enumerate(own)
    ]  # fmt: skip


def test_a_level_mean_is_geometric_with_an_interval_of_students_t() -> None:
    # ln thresholds 0 and 2: mean 1, standard error 1, and t(0.975) with one degree of freedom is 12.706.
    ((luminance, mean, low, high),) = level_means(thresholds({"01": [1.0], "02": [np.exp(2.0)]}))
    assert luminance == 10.0
    assert mean == pytest.approx(np.e)
    np.testing.assert_allclose([low, high], np.exp([1 - 12.7062, 1 + 12.7062]), rtol=1e-4)


def test_one_participants_level_has_the_interval_of_the_threshold() -> None:
    assert level_means(thresholds({"01": [1.0]})) == [(10.0, 1.0, 0.5, 2.0)]


@pytest.mark.parametrize(("people", "bars", "arrows"), [(2, 0, 0), (4, 1, 1)])
def test_a_wide_interval_of_a_level_does_not_stretch_the_axis(people: int, bars: int, arrows: int) -> None:
    """Of two people no interval is drawn; of four, one that leaves the axis (1 to 9 cd/m²/s) has an arrow."""
    shown = thresholds({f"{k}": [9.0 if k else 1.0] for k in range(people)})
    axes = rate_limit_figure(load_rate_limit("surace2025"), shown)[0].axes[0]
    assert axes.get_ylim()[1] < 12
    assert len([bar for bar in axes.containers if bar.has_yerr]) == bars
    assert sum(len(line.get_xdata()) for line in axes.lines if line.get_marker() == "^") == arrows


def test_a_threshold_that_is_left_out_does_not_stretch_the_axis() -> None:
    shown = thresholds({"01": [0.3, 0.6], "02": [0.5, 0.9]})
    unseen = thresholds({"03": [0.2, 20.0]}, ThresholdFlag.ALL_NO)  # the second lies far above the band
    axes = rate_limit_figure(load_rate_limit("surace2025"), [*shown, *unseen])[0].axes[0]
    assert axes.get_ylim()[1] < 12
    marks = {line.get_marker(): line.get_xdata() for line in axes.lines if line.get_color() == MUTED}
    assert marks["x"] == [unseen[0].luminance]
    assert marks["^"] == [unseen[1].luminance]


def test_the_curve_is_the_limit_and_dashed_only_outside_the_measured_range() -> None:
    limit = load_rate_limit("surace2025")
    low, high = limit.luminance_range
    axes = rate_limit_figure(limit)[0].axes[0]
    curves = [line for line in axes.lines if line.get_color() == LIMIT]
    assert len(curves) == 3
    for line in curves:
        x = np.asarray(line.get_xdata())
        np.testing.assert_allclose(line.get_ydata(), rate_limit_at(limit, x))
        measured = (x >= low).all() and (x <= high).all()
        assert (line.get_linestyle() == "-") == measured


def test_every_threshold_and_the_whole_band_have_room() -> None:
    limit = load_rate_limit("surace2025")
    made = thresholds({"01": [0.3, 0.6, 1.0], "02": [0.5, 9.0, 2.0]})
    axes = rate_limit_figure(limit, made)[0].axes[0]
    (right, top) = axes.get_xlim()[1], axes.get_ylim()[1]
    assert right > limit.luminance_range[1]
    assert top > max(9.0, *limit.band_upper)


def test_simulated_participants_are_called_so_and_others_are_not(
    texts_on: Callable[[Figure], list[str]],
) -> None:
    limit = load_rate_limit("surace2025")
    made = thresholds({"01": [0.3, 0.6], "02": [0.5, 0.9]})
    for simulated in (True, False):
        named = dataclasses.replace(limit, simulated=simulated)
        words = " ".join(texts_on(rate_limit_figure(named, made)[0]))
        assert ("2 simulated participants" in words) == simulated


@pytest.mark.parametrize(
    ("procedure", "words"),
    [(Procedure.YES_NO, "noticed in 75 %"), (Procedure.TWO_INTERVAL, "identified correctly in 75 %")],
)
def test_the_title_says_what_happens_at_the_limit(
    procedure: Procedure, words: str, texts_on: Callable[[Figure], list[str]]
) -> None:
    limit = dataclasses.replace(load_rate_limit("surace2025"), procedure=procedure)
    assert words in " ".join(texts_on(rate_limit_figure(limit)[0]))


def test_the_rate_limit_is_legible(require_legible: Callable[[Figure, FigureFormat], None]) -> None:
    limit = load_rate_limit("surace2025")
    made = thresholds({"01": [0.3, 0.6], "02": [0.5, 0.9]})
    made += thresholds({"03": [2.5]}, ThresholdFlag.ALL_NO)
    require_legible(rate_limit_figure(limit, made, limit)[0], PAGE)


def test_a_limit_without_band_and_points_is_drawn() -> None:
    bare = dataclasses.replace(
        load_rate_limit("surace2025"), band_luminance=(), band_lower=(), band_upper=(),
        point_luminance=(), point_rate=(),
    )  # fmt: skip
    assert png_bytes(rate_limit_figure(bare)[0]).startswith(b"\x89PNG")
