"""Claims about the map of lost contrast: what is red was visible and is lost."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from evenlight.analysis.figure_style import PAGE, FigureFormat
from evenlight.analysis.tracks.contrast_map_figure import (
    GONE,
    KEPT,
    WIDEST_MAP,
    ContrastMap,
    contrast_map_figure,
    contrast_maps,
    map_picture,
)
from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.display import Display
from evenlight.method.contrast.contrast_loss import contrast_loss
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.preset_files import load_display


def contrast_map(
    frame: np.ndarray, factor: float, display: Display, loss: float | None = None
) -> ContrastMap:
    return contrast_maps(frame, [(factor, loss)], display, DEFAULT_MODEL)[0]


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


def test_a_wide_frame_is_mapped_as_its_averages_seen_from_as_far() -> None:
    """Each pixel of a small frame twice across and down: the averages are the small frame again."""
    display, small = load_display("varjo-xr3"), np.tile(checked_frame(), (1, 11, 1))
    wide = small.repeat(2, axis=0).repeat(2, axis=1)
    assert small.shape[1] < WIDEST_MAP < wide.shape[1]
    coarse = dataclasses.replace(display, pixels_per_degree=display.pixels_per_degree / 2)
    expected, made = contrast_map(small, 0.3, coarse), contrast_map(wide, 0.3, display, loss=0.123)
    assert made.frequency == expected.frequency
    assert np.mean(made.reference != expected.reference) < 1e-3  # where rounding decides
    assert np.mean(made.dimmed != expected.dimmed) < 1e-3
    assert made.loss == 0.123  # that of the frame itself, which the averages do not know
    assert made.averaged
    assert not expected.averaged


def test_lost_contrast_is_red_and_counted_among_what_was_visible() -> None:
    reference = np.array([[True, True, True, False, False]])
    dimmed = np.array(
        [[True, False, True, False, True]]
    )  # the last appears by dimming: neither lost nor kept
    made = ContrastMap(0.5, 10.0, reference, dimmed, 0.2)
    assert made.lost_share == pytest.approx(1 / 3)
    grey, white, red = to_rgb(KEPT), (1.0, 1.0, 1.0), to_rgb(GONE)
    np.testing.assert_allclose(map_picture(made)[0], [grey, red, grey, white, white], atol=1e-6)


def test_a_lost_line_of_a_pixel_is_still_seen_where_the_map_is_drawn_smaller() -> None:
    """One column of four is lost, three stay: averaged, three quarters of the cell are red all the same."""
    reference, dimmed = np.ones((4, 4), bool), np.ones((4, 4), bool)
    dimmed[:, 1] = False
    (cell,) = map_picture(ContrastMap(0.5, 10.0, reference, dimmed, 0.2), 1)[0]
    np.testing.assert_allclose(cell, 0.25 * np.array(to_rgb(KEPT)) + 0.75 * np.array(to_rgb(GONE)), atol=1e-6)


def test_a_contrast_map_is_legible(require_legible: Callable[[Figure, FigureFormat], None]) -> None:
    frame, display = checked_frame(), load_display("varjo-xr3")
    maps = [contrast_map(frame, b, display) for b in (0.6, 0.3)]
    require_legible(contrast_map_figure(frame, *maps, "a_video.mp4 at 12.3 s"), PAGE)


def test_a_contrast_map_tells_band_and_loss_and_a_black_frame_that_nothing_is_visible(
    texts_on: Callable[[Figure], list[str]],
) -> None:
    frame, display = checked_frame(), load_display("varjo-xr3")
    made = contrast_map(frame, 0.3, display)
    words = " ".join(texts_on(contrast_map_figure(frame, made, made, "x")))
    assert f"{made.frequency:.3g} cpd" in words
    assert f"{100 * made.lost_share:.1f} %" in words
    assert "the finest with visible contrast" in words
    averaged = contrast_map_figure(frame, dataclasses.replace(made, averaged=True), made, "x")
    assert "the finest that is drawn" in " ".join(texts_on(averaged))
    black = contrast_map(np.zeros((16, 16, 3), np.uint8), 0.5, display)
    drawn = contrast_map_figure(np.zeros((16, 16, 3), np.uint8), black, black, "x")
    assert "Nothing in this frame is visible" in " ".join(texts_on(drawn))
