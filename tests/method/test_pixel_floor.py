"""The loss of a picture that pixels dim: that of the picture drawn, whose channels have a floor of black."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import evenlight
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel, PixelToLuminance
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.contrast_loss import loss_of, visible_contrast
from evenlight.method.contrast.loss_curves import analyze_frames, brightness_factors
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS
from evenlight.method.contrast.pixel_floor import FlooredFrames, PixelFloor, floor_in_samples
from evenlight.stimuli.dithering import level_luminance

PANEL = Display("panel", 100.0, 0.2, 2.0, pixels_per_degree=30.0, reflected_luminance=0.1)
KNOTS = brightness_factors()
Pixels = NDArray[np.uint8]


def clip(mean: float, spread: float, n: int = 3) -> list[Pixels]:
    """Return frames of blocks of colour with grain on them, gamma-encoded."""
    rng = np.random.default_rng(7)
    frames = []
    for _ in range(n):
        blocks = np.kron(rng.normal(0, 1, (12, 16, 3)), np.ones((8, 8, 1)))
        noisy = mean + spread * (blocks + rng.normal(0, 0.5, blocks.shape))
        frames.append(np.clip(noisy, 1, 255).astype(np.uint8))
    return frames


def curves(frames: list[Pixels], actuator: Actuator, model: ContrastModel = DEFAULT_MODEL) -> LossCurves:
    shown = [Frame(0.04 * k, 0.04, pixels) for k, pixels in enumerate(frames)]
    if actuator is Actuator.BACKLIGHT:
        return analyze_frames(shown, "clip", PANEL, model, KNOTS)
    floored = FlooredFrames(PANEL, model, KNOTS)
    return floored.complete(analyze_frames(floored.watch(shown), "clip", PANEL, model, KNOTS))


def loss_of_the_picture_shown(pixels: Pixels, factor: float) -> float:
    """Return the loss of the codes that a player draws: each channel's level, dimmed, not below black."""

    def seen(b: float) -> float:
        light = level_luminance(256, b, PANEL)[pixels] @ np.array(LUMINANCE_WEIGHTS)
        return visible_contrast(light, PANEL)

    return loss_of(seen(factor), seen(1.0))


def test_the_loss_predicted_is_that_of_the_picture_shown_where_todays_is_far_off() -> None:
    frames, at = clip(12, 10, n=2), KNOTS[[8, 23, 38]]
    shown = np.array([[loss_of_the_picture_shown(pixels, float(b)) for b in at] for pixels in frames])
    by_backlight, by_pixels = (
        np.array([np.interp(at, KNOTS, row) for row in curves(frames, actuator).loss])
        for actuator in (Actuator.BACKLIGHT, Actuator.PIXELS)
    )
    assert np.abs(by_backlight - shown).max() > 0.01
    assert np.abs(by_pixels - shown).max() < 0.001


def test_a_larger_frame_is_computed_at_few_knots_and_is_hardly_off_between_them() -> None:
    """The floor adds some 0.1 at 0.3; halfway between two knots 5e-4 were accepted."""
    pixels = np.tile(clip(12, 10, n=1)[0], (3, 2, 1))
    found = np.interp([0.3, 0.47], KNOTS, curves([pixels], Actuator.PIXELS).loss[0])
    assert found == pytest.approx([loss_of_the_picture_shown(pixels, b) for b in (0.3, 0.47)], abs=2e-3)


def test_frames_whose_dimmed_light_stays_above_black_keep_their_curves_bit_for_bit() -> None:
    """At 0.2 a channel falls below 0.2 cd/m^2 from 1 cd/m^2 on: 0.0901² of 100, the code 23."""
    bright, dark = clip(120, 12), clip(12, 10)
    assert min(pixels.min() for pixels in bright) > 23
    mixed = [bright[0], dark[0], bright[1]]
    one, other = curves(mixed, Actuator.BACKLIGHT), curves(mixed, Actuator.PIXELS)
    same = (one.loss == other.loss).all(axis=1)
    assert same.tolist() == [True, False, True]
    assert np.array_equal(one.visible_contrast, other.visible_contrast)


@pytest.mark.parametrize(("code", "onset"), [(0, 1.0), (51, 0.2 / (0.2 + 99.8 * 0.04))])
def test_the_floor_begins_where_the_darkest_channel_value_meets_black(code: int, onset: float) -> None:
    """51 of 255 is 0.2, and its square 0.04; one channel of one pixel is enough."""
    pixels = np.full((16, 16, 3), 200, np.uint8)
    pixels[3, 4, 2] = code
    assert PixelFloor((16, 16), PANEL, DEFAULT_MODEL, KNOTS).onset(pixels) == pytest.approx(onset)


def test_a_panel_without_black_level_has_no_floor() -> None:
    oled = replace(PANEL, black_level=0.0)
    (pixels,) = clip(12, 10, n=1)
    assert not PixelFloor(pixels.shape[:2], oled, DEFAULT_MODEL, KNOTS).added(pixels).any()


def test_equal_frames_have_equal_curves_and_losses_fall_with_the_factor() -> None:
    first, second = clip(12, 10, n=2)
    found = curves([first, first, second, second], Actuator.PIXELS).loss
    assert np.array_equal(found[[0, 2]], found[[1, 3]])
    assert not np.array_equal(found[1], found[2])
    assert (np.diff(found, axis=1) <= 0).all()


def test_luminance_weighed_first_has_one_floor_for_the_pixel() -> None:
    """Gray pixels are the same in either order, so their curves are."""
    gray = [np.repeat(pixels[..., :1], 3, axis=2) for pixels in clip(12, 10, n=1)]
    luma = replace(DEFAULT_MODEL, pixel_to_luminance=PixelToLuminance.LUMA_FIRST)
    assert curves(gray, Actuator.PIXELS).loss == pytest.approx(
        curves(gray, Actuator.PIXELS, luma).loss, abs=2e-3
    )


def test_what_a_backlights_track_would_lose_more_on_pixels_is_told_for_samples() -> None:
    dark, bright = clip(12, 10, n=1)[0], clip(120, 12, n=1)[0]
    factors = np.array([0.5, 0.4, 0.3])
    told = floor_in_samples([(0, bright), (2, dark)], factors, PANEL, DEFAULT_MODEL)
    by_backlight = curves([dark], Actuator.BACKLIGHT).loss[0]
    expected = loss_of_the_picture_shown(dark, 0.3) - np.interp(0.3, KNOTS, by_backlight)
    assert told == pytest.approx(expected, abs=1e-3)
    assert floor_in_samples([(0, bright)], factors, PANEL, DEFAULT_MODEL) == 0.0
    assert floor_in_samples([], factors, PANEL, DEFAULT_MODEL) is None


def frames_of_day_and_night() -> Iterator[Pixels]:
    for mean, spread in ((120, 40), (25, 15), (12, 10), (60, 30)):
        yield from (pixels[:32, :48] for pixels in clip(mean, spread, n=2))


def test_a_track_for_pixels_keeps_its_promises_and_says_what_it_is_for() -> None:
    asked = {"display": PANEL, "fps": 5, "other_display_ok": True}
    track = evenlight.optimize(frames_of_day_and_night(), 0.5, actuator="pixels", **asked)  # type: ignore[arg-type] # mixed
    assert track.track.header.actuator is track.curves.actuator is Actuator.PIXELS
    assert track.outcome.achieved == pytest.approx(0.5, abs=1e-6)
    assert track.outcome.max_rate_ratio <= 1 + 1e-6
    assert track.objective <= track.objective_baseline
    usual = evenlight.optimize(frames_of_day_and_night(), 0.5, **asked)  # type: ignore[arg-type] # mixed
    assert usual.track.header.actuator is Actuator.BACKLIGHT
    assert (usual.track.header.loss_added_by_pixels or 0) > 0.01
    with pytest.raises(evenlight.InputError, match="made for backlight"):
        evenlight.optimize(usual.curves, 0.5, actuator="pixels", other_display_ok=True)
