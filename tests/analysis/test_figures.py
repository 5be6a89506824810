"""Claims about the figures: they show the data they are given, whole and legibly, whatever the data."""

from __future__ import annotations

import dataclasses
import io
import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.lines import Line2D
from matplotlib.text import Text

from analysis.contrast_map_figure import ContrastMap, contrast_map, contrast_map_figure, map_picture
from analysis.figure_style import (
    BASELINE,
    COLUMN,
    LIMIT,
    LOST,
    OURS,
    PAGE,
    PARTICIPANT,
    SLIDE,
    Medium,
    png_bytes,
    write_png,
)
from analysis.psychometric_figure import psychometric_figure
from analysis.psychometric_panels import by_level, pooled_answers
from analysis.rate_limit_figure import level_means, rate_limit_figure
from analysis.thresholds import ThresholdFit, fit_thresholds_of
from analysis.thumbnails import dimmed_picture, small_picture, thumbnails_of
from analysis.track_figure import drawn_rates, track_figure
from analysis.track_story import TrackStory, outcome_in_words
from data_schema.brightness_track import BrightnessTrack, BudgetUnit, TrackHeader
from data_schema.provenance import Provenance
from data_schema.ramp import Procedure, RampTrial, Response
from data_schema.threshold import Threshold, ThresholdFlag
from method.contrast_loss import contrast_loss
from method.luminance import emitted_luminance
from method.preset_files import load_display, load_rate_limit
from method.psychometric import yes_probability
from method.rate_limit import rate_limit_at

MEDIA = pytest.mark.parametrize("medium", [PAGE, SLIDE, COLUMN], ids=["page", "slide", "column"])
SMALL = dataclasses.replace(PAGE, dots_per_inch=50.0)


def story(n: int = 30, video: str = "made", pictures: int = 3, **columns: Any) -> TrackStory:
    """A track with every column of its own shape, so that none can be taken for another."""
    steps = np.arange(n)
    given = {
        "times": steps / 25,
        "factors": 0.5 + 0.3 * np.sin(steps / 5),
        "contrast_loss": 0.2 + 0.1 * np.cos(steps / 4),
        "mean_luminance": np.full(n, 20.0),
        "rate": np.append(np.sin(steps[1:]), 0.0),
        "rate_limit": 1.5 + 0.3 * np.cos(steps / 3),
        "power": np.full(n, 1.0),
        **columns,
    }
    header = TrackHeader(
        video, "varjo-xr3", "f", "surace2025", "surace2025", 0.5, BudgetUnit.FACTOR, "splitting", Provenance()
    )
    picture = np.full((9, 16, 3), 128, np.uint8)
    chosen = sorted({int(k) for k in np.linspace(0, n - 1, pictures)}) if pictures else []
    thumbnails = tuple((k, picture) for k in chosen)
    constant = 0.3 + 0.05 * np.sin(steps / 2)
    return TrackStory(BrightnessTrack(**given, header=header), 0.5, constant, 0.01, 0.02, thumbnails)


def lines_of(figure: Figure, place: int, colour: str) -> list[Line2D]:
    """The lines of one colour in one panel."""
    return [line for line in figure.axes[place].lines if line.get_color() == colour]


def test_the_lines_of_a_track_are_its_data() -> None:
    told = story()
    figure = track_figure(told)
    expected = [
        (0, OURS, told.track.factors),
        (1, OURS, told.track.contrast_loss),
        (1, BASELINE, told.baseline_loss),
    ]
    for place, colour, values in expected:
        (line,) = lines_of(figure, place, colour)
        assert line.get_drawstyle() == "steps-post"
        np.testing.assert_array_equal(line.get_xdata()[:-1], told.track.times)
        np.testing.assert_array_equal(line.get_ydata()[:-1], values)
    (baseline,) = lines_of(figure, 0, BASELINE)
    assert set(baseline.get_ydata()) == {told.baseline_factor}


@pytest.mark.parametrize(
    ("low", "high", "bounded", "full"),
    [(0.48, 0.52, False, False), (0.21, 0.4, True, False), (0.7, 1.0, False, True), (0.2, 1.0, True, True)],
)
def test_the_factors_fill_their_panel_and_only_what_is_in_view_is_drawn(
    low: float, high: float, bounded: bool, full: bool
) -> None:
    told = dataclasses.replace(story(factors=np.linspace(low, high, 30)), baseline_factor=(low + high) / 2)
    panel = track_figure(told).axes[0]
    bottom, top = panel.get_ylim()
    assert 0 <= bottom < low < high < top
    assert 0.15 <= top - bottom <= max(2 * (high - low), 0.16)
    assert all(bottom <= tick <= min(top, 1) for tick in panel.get_yticks())
    assert len(panel.get_yticks()) >= 2
    legend = panel.get_legend()
    assert legend is not None
    assert ("not allowed" in [text.get_text() for text in legend.get_texts()]) == bounded
    assert bool(panel.patches) == bounded
    assert any(set(line.get_ydata()) == {1.0} for line in panel.lines) == full


def test_a_clip_that_loses_nothing_is_not_said_to_lose_a_share() -> None:
    even = dataclasses.replace(story(contrast_loss=np.zeros(30)), objective=0.0, objective_baseline=0.0)
    assert "the same share" in outcome_in_words(even)
    black = dataclasses.replace(even, baseline_loss=np.zeros(30))
    assert outcome_in_words(black).startswith("No visible contrast is lost in any frame")


def test_rates_are_drawn_with_their_sign_up_to_the_last_step() -> None:
    told = story()
    (line,) = lines_of(track_figure(told), 2, OURS)
    np.testing.assert_array_equal(line.get_xdata(), told.track.times)
    np.testing.assert_array_equal(line.get_ydata()[:-1], told.track.rate[:-1])


def test_rates_are_drawn_between_the_limits_of_both_directions() -> None:
    told = story()
    figure = track_figure(told)
    assert figure.axes[2].get_ylabel() == "rate [cd/m²/s]"
    for sign, line in zip((1, -1), lines_of(figure, 2, LIMIT), strict=True):
        assert line.get_drawstyle() == "steps-post"
        np.testing.assert_array_equal(line.get_xdata()[:-1], told.track.times)
        np.testing.assert_array_equal(line.get_ydata()[:-1], sign * told.track.rate_limit)


@pytest.mark.parametrize("spread", [1.0, 1e4], ids=["narrow", "wide"])
def test_every_limit_and_every_rate_has_room_in_the_figure(spread: float) -> None:
    panel = track_figure(story(rate_limit=np.geomspace(1.0, spread, 30))).axes[2]
    bottom, top = panel.get_ylim()
    for line in panel.lines:
        assert bottom < np.min(line.get_ydata())
        assert top > np.max(line.get_ydata())


def test_limits_that_vary_widely_make_rates_shares_of_them() -> None:
    told = story(4, rate=np.array([0.01, -3.0, 0.0, 0.0]), rate_limit=np.array([0.02, 4.0, 0.0, 0.0]))
    panel = track_figure(told).axes[2]
    (line,) = lines_of(track_figure(told), 2, OURS)
    np.testing.assert_allclose(line.get_ydata()[:-1], [50.0, -75.0, 0.0])  # of 0.02, 4 and nothing
    assert panel.get_ylabel() == "rate / ΔL [%]"
    upper, lower = lines_of(track_figure(told), 2, LIMIT)
    assert set(upper.get_ydata()) == {100.0}
    assert set(lower.get_ydata()) == {-100.0}


def test_a_change_where_none_is_allowed_has_no_share_of_its_limit() -> None:
    told = story(3, rate=np.array([0.01, -0.1, 0.0]), rate_limit=np.array([0.02, 0.0, 4.0]))
    np.testing.assert_array_equal(drawn_rates(told.track)[0], [50.0, -np.inf])


def test_a_picture_for_each_thumbnail_at_full_brightness_and_dimmed() -> None:
    told = story(pictures=3)
    pictures = [np.asarray(axes.images[0].get_array()) for axes in track_figure(told).axes if axes.images]
    assert len(pictures) == 6
    pairs = zip(pictures[::2], pictures[1::2], strict=True)
    for (index, original), (full, dimmed) in zip(told.thumbnails, pairs, strict=True):
        np.testing.assert_array_equal(full, original)
        np.testing.assert_array_equal(dimmed, dimmed_picture(original, told.track.factors[index]))


DEGENERATE: dict[str, Callable[[], TrackStory]] = {
    "one frame": lambda: story(1, pictures=1),
    "two frames": lambda: story(2, pictures=2),
    "no thumbnails": lambda: story(pictures=0),
    "many thumbnails": lambda: story(100, pictures=40),
    "very long": lambda: story(10_000, pictures=6),
    "constant": lambda: story(factors=np.full(30, 0.5), contrast_loss=np.full(30, 0.1), rate=np.zeros(30)),
    "all black": lambda: story(
        contrast_loss=np.zeros(30),
        mean_luminance=np.zeros(30),
        rate=np.zeros(30),
        rate_limit=np.zeros(30),
        power=np.zeros(30),
    ),
    "some black": lambda: story(rate_limit=np.where(np.arange(30) < 9, 0.0, 2.0)),
    "uneven": lambda: story(times=np.cumsum(np.geomspace(1e-3, 10.0, 30))),
    "late": lambda: story(times=1e6 + np.arange(30) / 25),
    "strange name": lambda: story(video="$a_1$ ünï 東京 \\ {x}^2\n" + "long " * 40 + "\udcff.mp4"),
}


@pytest.mark.parametrize("name", DEGENERATE)
def test_odd_tracks_are_drawn_without_warning(name: str) -> None:
    assert png_bytes(track_figure(DEGENERATE[name](), SMALL)).startswith(b"\x89PNG")


def boxes_of(figure: Figure) -> list[tuple[str, Any]]:
    """What is written on the figure and its axes, with where it is drawn [pixels]."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    shown = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]
    hidden = {t for axes in figure.axes if not axes.axison for axis in (axes.xaxis, axes.yaxis)
              for t in axis.findobj(Text)}  # fmt: skip
    ticks = {t for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for t in outside(axis)}
    return [(t.get_text(), t.get_window_extent(renderer)) for t in shown if t not in hidden | ticks]


def outside(axis: Axis) -> set[Text]:
    """The numbers of ticks that lie beyond the ends of an axis, and so are not drawn."""
    low, high = sorted(axis.get_view_interval())
    every = axis.get_major_ticks() + axis.get_minor_ticks()
    far = [tick for tick in every if not low <= tick.get_loc() <= high]
    return {label for tick in far for label in (tick.label1, tick.label2)}


def assert_legible(figure: Figure, medium: Medium) -> None:
    """Nothing written leaves the figure, and no two words lie on each other."""
    boxes = boxes_of(figure)
    width, height = figure.bbox.width, figure.bbox.height
    for words, box in boxes:
        inside = box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height
        assert inside, f"{words!r} leaves the figure"
    touching = 0.15 * medium.em * medium.dots_per_inch  # boxes are higher than the letters in them
    for (one, a), (other, b) in itertools.combinations(boxes, 2):
        across = min(a.x1, b.x1) - max(a.x0, b.x0)
        down = min(a.y1, b.y1) - max(a.y0, b.y0)
        assert min(across, down) < touching, f"{one!r} and {other!r} overlap"


@MEDIA
def test_a_track_is_legible_in_every_medium(medium: Medium) -> None:
    assert_legible(track_figure(story(video="a_rather_long_name_of_a_video.mp4", pictures=8), medium), medium)


def test_a_figure_has_the_same_bytes_whenever_it_is_drawn(tmp_path: Path) -> None:
    before = dict(mpl.rcParams)
    first, second = (png_bytes(track_figure(story(), SMALL)) for _ in range(2))
    assert first == second
    assert dict(mpl.rcParams) == before  # drawing leaves no setting behind
    write_png(tmp_path / "track.png", track_figure(story(), SMALL))
    assert (tmp_path / "track.png").read_bytes() == first


def test_a_figure_has_the_size_of_its_medium() -> None:
    for medium in (PAGE, SLIDE, COLUMN):
        pixels = imread(io.BytesIO(png_bytes(track_figure(story(), medium))))
        height, width = (side * medium.dots_per_inch for side in (medium.height, medium.width))
        np.testing.assert_allclose(pixels.shape[:2], (height, width), atol=1)


def test_a_baseline_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match="each of the 30 frames, got 2"):
        dataclasses.replace(story(), baseline_loss=np.zeros(2))


def test_a_small_picture_averages_squares_of_pixels() -> None:
    frame = np.zeros((2, 4, 3), np.uint16)
    frame[:, :2] = 65535  # the left square is white, the right one half white
    frame[0, 2:] = 65535
    assert small_picture(frame, width=2)[..., 0].tolist() == [[255, 128]]


def test_a_frame_no_wider_than_asked_keeps_its_pixels() -> None:
    frame = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    np.testing.assert_array_equal(small_picture(frame, width=3), frame)


def test_fewer_samples_than_thumbnails_are_all_taken() -> None:
    frame = np.zeros((2, 2, 3), np.uint8)
    assert [index for index, _ in thumbnails_of([(7, frame), (9, frame)], count=6)] == [7, 9]
    assert thumbnails_of([]) == ()


# contrast maps


def checked_frame() -> np.ndarray:
    """Faint fine detail on a bright and on a dark ground."""
    rng = np.random.default_rng(1)
    ground = np.repeat([[200.0], [30.0]], 32, axis=0) * np.ones((1, 64))
    return np.repeat((ground + rng.normal(0, 6, (64, 64))).clip(0, 255)[..., None], 3, axis=2).astype(
        np.uint8
    )


def test_the_map_of_an_undimmed_frame_has_lost_nothing() -> None:
    undimmed = contrast_map(checked_frame(), 1.0, load_display("varjo-xr3"))
    assert undimmed.reference.any()
    assert undimmed.lost_share == 0
    assert undimmed.loss == 0


def test_the_loss_beside_a_map_is_that_of_the_definition() -> None:
    display, frame = load_display("varjo-xr3"), checked_frame()
    by_definition = contrast_loss(emitted_luminance(frame, display), 0.3, display)
    assert by_definition > 0
    assert contrast_map(frame, 0.3, display).loss == pytest.approx(by_definition, abs=1e-12)


def test_lost_contrast_is_red_and_counted_among_what_was_visible() -> None:
    reference = np.array([[True, True, True, False, False]])
    dimmed = np.array(
        [[True, False, True, False, True]]
    )  # the last appears by dimming: neither lost nor kept
    made = ContrastMap(0.5, 10.0, reference, dimmed, 0.2)
    assert made.lost_share == pytest.approx(1 / 3)
    black, white, red = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), to_rgb(LOST)
    assert [tuple(pixel) for pixel in map_picture(made)[0]] == [white, red, white, black, black]


@MEDIA
def test_a_contrast_map_is_legible_in_every_medium(medium: Medium) -> None:
    frame, display = checked_frame(), load_display("varjo-xr3")
    maps = [contrast_map(frame, b, display) for b in (0.6, 0.3)]
    assert_legible(contrast_map_figure(frame, *maps, "a_video.mp4 at 12.3 s", medium), medium)


def test_a_contrast_map_tells_band_and_loss_and_a_black_frame_that_nothing_is_visible() -> None:
    frame, display = checked_frame(), load_display("varjo-xr3")
    made = contrast_map(frame, 0.3, display)
    words = " ".join(words for words, _ in boxes_of(contrast_map_figure(frame, made, made, "x", SMALL)))
    assert f"{made.frequency:.3g} cpd" in words
    assert f"{100 * made.lost_share:.1f} %" in words
    black = contrast_map(np.zeros((16, 16, 3), np.uint8), 0.5, display)
    drawn = contrast_map_figure(np.zeros((16, 16, 3), np.uint8), black, black, medium=SMALL)
    assert "Nothing in this frame is visible" in " ".join(words for words, _ in boxes_of(drawn))


# the calibration

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
    rates, yes, trials = pooled_answers(own)
    np.testing.assert_allclose(rates, np.multiply(RATES, 100 / 20.0))  # %/s of 20 cd/m^2
    assert yes.tolist() == [1, 5, 11, 12]
    assert trials.tolist() == [12, 12, 12, 12]


def test_each_participant_is_drawn_once_in_each_panel_and_as_fitted(fits: list[ThresholdFit]) -> None:
    figure = psychometric_figure(fits, medium=SMALL)
    panels = [axes for axes in figure.axes if axes.collections]
    assert len(panels) == 2
    levels = sorted(by_level(fits).items(), key=lambda item: item[0].luminance)
    for panel, (level, own) in zip(panels, levels, strict=True):
        curves = [line for line in panel.lines if line.get_color() == PARTICIPANT]
        assert len(curves) == 2
        for curve, fit in zip(curves, own, strict=True):
            rate = np.asarray(curve.get_xdata()) * level.luminance / 100
            np.testing.assert_allclose(curve.get_ydata(), yes_probability(rate, fit.fit.function))


def test_a_threshold_that_cannot_be_used_is_hollow_and_not_in_the_mean(fits: list[ThresholdFit]) -> None:
    unseen = next(fit.threshold for fit in fits if fit.threshold.flag is ThresholdFlag.ALL_NO)
    usable = next(
        f.threshold for f in fits if f.threshold.factor == 1.0 and f.threshold.participant_id == "01"
    )
    figure = psychometric_figure(fits, medium=SMALL)
    dots = [line for axes in figure.axes for line in axes.lines if line.get_marker() == "o"]
    hollow = [line.get_xdata()[0] for line in dots if line.get_markerfacecolor() == "white"]
    assert hollow == [pytest.approx(100 * unseen.threshold / unseen.luminance)]
    written = [words for words, _ in boxes_of(figure)]
    assert f"{usable.threshold:.3g} cd/m²/s" in written


@MEDIA
def test_the_psychometric_functions_are_legible_in_every_medium(
    fits: list[ThresholdFit], medium: Medium
) -> None:
    assert_legible(psychometric_figure(fits, simulated=True, medium=medium), medium)


def test_a_participants_catch_trials_are_counted_once(fits: list[ThresholdFit]) -> None:
    written = " ".join(words for words, _ in boxes_of(psychometric_figure(fits, medium=SMALL)))
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


def test_the_curve_is_the_limit_and_dashed_only_outside_the_measured_range() -> None:
    limit = load_rate_limit("surace2025")
    low, high = limit.luminance_range
    axes = rate_limit_figure(limit, medium=SMALL).axes[0]
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
    axes = rate_limit_figure(limit, made, medium=SMALL).axes[0]
    (right, top) = axes.get_xlim()[1], axes.get_ylim()[1]
    assert right > limit.luminance_range[1]
    assert top > max(9.0, *limit.band_upper)


def test_simulated_participants_are_called_so_and_others_are_not() -> None:
    limit = load_rate_limit("surace2025")
    made = thresholds({"01": [0.3, 0.6], "02": [0.5, 0.9]})
    for simulated in (True, False):
        named = dataclasses.replace(limit, simulated=simulated)
        words = " ".join(words for words, _ in boxes_of(rate_limit_figure(named, made, medium=SMALL)))
        assert ("2 simulated participants" in words) == simulated


@pytest.mark.parametrize(
    ("procedure", "words"),
    [(Procedure.YES_NO, "noticed in 75 %"), (Procedure.TWO_INTERVAL, "told right in 75 %")],
)
def test_the_title_says_what_happens_at_the_limit(procedure: Procedure, words: str) -> None:
    limit = dataclasses.replace(load_rate_limit("surace2025"), procedure=procedure)
    assert words in " ".join(text for text, _ in boxes_of(rate_limit_figure(limit, medium=SMALL)))


@MEDIA
def test_the_rate_limit_is_legible_in_every_medium(medium: Medium) -> None:
    limit = load_rate_limit("surace2025")
    made = thresholds({"01": [0.3, 0.6], "02": [0.5, 0.9]})
    made += thresholds({"03": [2.5]}, ThresholdFlag.ALL_NO)
    assert_legible(rate_limit_figure(limit, made, limit, medium), medium)


def test_a_limit_without_band_and_points_is_drawn() -> None:
    bare = dataclasses.replace(
        load_rate_limit("surace2025"), band_luminance=(), band_lower=(), band_upper=(),
        point_luminance=(), point_rate=(),
    )  # fmt: skip
    assert png_bytes(rate_limit_figure(bare, medium=SMALL)).startswith(b"\x89PNG")
