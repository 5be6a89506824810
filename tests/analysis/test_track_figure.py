"""Claims about the figure of a track: it shows the data it is given, whole and legibly, whatever they are."""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from example_tracks import HEADER, example_track
from made_summary import made_summary
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.lines import Line2D

from evenlight.analysis.figure_style import BASELINE, LIMIT, OURS, PAGE, FigureFormat, png_bytes, write_figure
from evenlight.analysis.tracks.frame_samples import dimmed_picture
from evenlight.analysis.tracks.track_figure import DrawnTrack, rate_shares, track_figure


def data(n: int = 30, video: str = "made", pictures: int = 3, **columns: Any) -> DrawnTrack:
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
    names = {"display_name": "varjo-xr3", "power_model": "surace2025", "rate_limit": "surace2025"}
    header = dataclasses.replace(HEADER, video=video, **names)
    picture = np.full((9, 16, 3), 128, np.uint8)
    chosen = sorted({int(k) for k in np.linspace(0, n - 1, pictures)}) if pictures else []
    thumbnails = tuple((k, picture) for k in chosen)
    constant = 0.3 + 0.05 * np.sin(steps / 2)
    summary = made_summary(objective=0.01, objective_baseline=0.02)
    return DrawnTrack(example_track(**given, header=header), summary, constant, thumbnails)


def told(given: DrawnTrack, **changed: Any) -> DrawnTrack:
    """The same with another summary."""
    return dataclasses.replace(given, summary=dataclasses.replace(given.summary, **changed))


def lines_of(figure: Figure, place: int, colour: str) -> list[Line2D]:
    """The lines of one colour in one panel."""
    return [line for line in figure.axes[place].lines if line.get_color() == colour]


def test_the_lines_of_a_track_are_its_data() -> None:
    given = data()
    figure = track_figure(given)
    expected = [
        (0, OURS, given.track.factors),
        (1, OURS, 100 * given.track.contrast_loss),
        (1, BASELINE, 100 * given.baseline_loss),
    ]
    for place, colour, values in expected:
        (line,) = lines_of(figure, place, colour)
        assert line.get_drawstyle() == "steps-post"
        np.testing.assert_array_equal(line.get_xdata()[:-1], given.track.times)
        np.testing.assert_array_equal(line.get_ydata()[:-1], values)
    (baseline,) = lines_of(figure, 0, BASELINE)
    assert set(baseline.get_ydata()) == {given.summary.baseline_factor}


@pytest.mark.parametrize(
    ("low", "high", "bounded", "full"),
    [(0.48, 0.52, False, False), (0.21, 0.4, True, False), (0.7, 1.0, False, True), (0.2, 1.0, True, True)],
)
def test_the_factors_fill_their_panel_and_only_what_is_in_view_is_drawn(
    low: float, high: float, bounded: bool, full: bool
) -> None:
    given = told(data(factors=np.linspace(low, high, 30)), baseline_factor=(low + high) / 2)
    panel = track_figure(given).axes[0]
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


def test_constant_dimming_has_the_same_power_only_where_it_has() -> None:
    for power, words in ((1.0, "constant, same power: 0.5"), (1.1, "constant, same mean: 0.5")):
        legend = track_figure(told(data(), baseline_power=power)).axes[0].get_legend()
        assert legend is not None
        assert words in [text.get_text() for text in legend.get_texts()]


def test_a_clip_that_does_not_count_is_told() -> None:
    assert data().outcome.startswith("Two frames differ by 1.00 points")
    assert dataclasses.replace(data(), counts=False).outcome.startswith(
        "Does not count (weight 0). Two frames"
    )


@pytest.mark.parametrize("spread", [1.0, 1e3], ids=["rates", "shares"])
def test_sections_with_allowances_are_marked_and_measured_by_the_fitted_limit(spread: float) -> None:
    fitted = np.geomspace(1.0, spread, 30)
    allowed, rate = fitted.copy(), 0.5 * fitted
    allowed[[10, 11, 12, 20]] *= [10, 10, 10, 0]
    rate[[11, 20, 29]] = 8.7 * fitted[11], 0.0, 0.0
    given = dataclasses.replace(data(rate=rate, rate_limit=allowed), fitted_limit=fitted)
    figure = track_figure(given)
    panel = figure.axes[2]
    spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in panel.patches]
    np.testing.assert_allclose(spans, np.array([(10, 13), (20, 21)]) / 25)
    (line,) = lines_of(figure, 2, OURS)
    assert line.get_ydata()[11] == pytest.approx(870)
    assert panel.get_ylim()[1] > line.get_ydata().max()
    words = " ".join(" ".join(text.get_text() for text in figure.texts).split())
    assert "in marked sections up to 8.7 times it" in words
    plain = track_figure(data(rate=rate, rate_limit=allowed)).axes[2]
    assert not plain.patches


def test_rates_are_drawn_with_their_sign_up_to_the_last_step() -> None:
    given = data()
    (line,) = lines_of(track_figure(given), 2, OURS)
    np.testing.assert_array_equal(line.get_xdata(), given.track.times)
    np.testing.assert_allclose(line.get_ydata()[:-1], 100 * (given.track.rate / given.track.rate_limit)[:-1])


def test_the_limit_is_100_percent_in_both_directions_and_the_legend_has_it_in_its_own_unit() -> None:
    figure = track_figure(data())
    assert figure.axes[2].get_ylabel() == "rate [% of ΔL]"
    for sign, line in zip((1, -1), lines_of(figure, 2, LIMIT), strict=True):
        assert set(line.get_ydata()) == {100.0 * sign}
    legend = figure.axes[2].get_legend()
    assert legend is not None
    limits = data().track.rate_limit
    words = f"faster than ΔL ({limits.min():.2g} to {limits.max():.2g} cd/m²/s)"
    assert words in [text.get_text() for text in legend.get_texts()]


@pytest.mark.parametrize("spread", [1.0, 1e4], ids=["narrow", "wide"])
def test_every_limit_and_every_rate_has_room_in_the_figure(spread: float) -> None:
    panel = track_figure(data(rate_limit=np.geomspace(1.0, spread, 30))).axes[2]
    bottom, top = panel.get_ylim()
    for line in panel.lines:
        assert bottom < np.min(line.get_ydata())
        assert top > np.max(line.get_ydata())


def test_rates_are_shares_of_the_limit() -> None:
    given = data(4, rate=np.array([0.01, -3.0, 0.0, 0.0]), rate_limit=np.array([0.02, 4.0, 0.0, 0.0]))
    np.testing.assert_allclose(rate_shares(given)[0], [50.0, -75.0, 0.0])  # of 0.02, 4 and nothing


def test_a_change_where_none_is_allowed_has_no_share_of_its_limit() -> None:
    given = data(3, rate=np.array([0.01, -0.1, 0.0]), rate_limit=np.array([0.02, 0.0, 4.0]))
    np.testing.assert_array_equal(rate_shares(given)[0], [50.0, -np.inf])


def test_a_picture_for_each_thumbnail_at_full_brightness_and_dimmed() -> None:
    given = data(pictures=3)
    pictures = [np.asarray(image.get_array()) for image in track_figure(given).axes[-1].images]
    assert len(pictures) == 6
    pairs = zip(pictures[::2], pictures[1::2], strict=True)
    for (index, original), (full, dimmed) in zip(given.samples, pairs, strict=True):
        np.testing.assert_array_equal(full, original)
        np.testing.assert_array_equal(dimmed, dimmed_picture(original, given.track.factors[index]))


DEGENERATE: dict[str, Callable[[], DrawnTrack]] = {
    "one frame": lambda: data(1, pictures=1),
    "two frames": lambda: data(2, pictures=2),
    "no thumbnails": lambda: data(pictures=0),
    "many thumbnails": lambda: data(100, pictures=40),
    "very long": lambda: data(10_000, pictures=6),
    "constant": lambda: data(factors=np.full(30, 0.5), contrast_loss=np.full(30, 0.1), rate=np.zeros(30)),
    "all black": lambda: data(
        contrast_loss=np.zeros(30),
        mean_luminance=np.zeros(30),
        rate=np.zeros(30),
        rate_limit=np.zeros(30),
        power=np.zeros(30),
    ),
    "some black": lambda: data(rate_limit=np.where(np.arange(30) < 9, 0.0, 2.0)),
    "uneven": lambda: data(times=np.cumsum(np.geomspace(1e-3, 10.0, 30))),
    "late": lambda: data(times=1e6 + np.arange(30) / 25),
    "strange name": lambda: data(video="$a_1$ ünï 東京 \\ {x}^2\n" + "long " * 40 + "\udcff.mp4"),
}


@pytest.mark.parametrize("name", DEGENERATE)
def test_odd_tracks_are_drawn_without_warning(name: str) -> None:
    assert png_bytes(track_figure(DEGENERATE[name]())).startswith(b"\x89PNG")


def test_a_track_is_legible(require_legible: Callable[[Figure, FigureFormat], None]) -> None:
    given = data(video="a_rather_long_name_of_a_video.mp4", pictures=8)
    limit = np.where(np.arange(30) == 9, 0.1, 1.0) * given.track.rate_limit
    wordy = told(given, achieved=0.37, clips=2, baseline_power=1.1)
    wordy = dataclasses.replace(wordy, counts=False, fitted_limit=limit)
    require_legible(track_figure(wordy), PAGE)


def test_a_figure_has_the_same_bytes_whenever_it_is_drawn(tmp_path: Path) -> None:
    before = dict(mpl.rcParams)
    first, second = (png_bytes(track_figure(data())) for _ in range(2))
    assert first == second
    assert dict(mpl.rcParams) == before  # drawing leaves no setting behind
    write_figure(tmp_path / "track.png", track_figure(data()))
    assert (tmp_path / "track.png").read_bytes() == first


def test_a_figure_has_the_size_of_a_page() -> None:
    pixels = imread(io.BytesIO(png_bytes(track_figure(data()))))
    height, width = (side * PAGE.dots_per_inch for side in (PAGE.height, PAGE.width))
    np.testing.assert_allclose(pixels.shape[:2], (height, width), atol=1)
