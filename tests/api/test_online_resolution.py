"""The online controller on fewer pixels: what it measures, how much it errs, that the limit is kept."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import evenlight
from benchmarks.online_content import layered_pictures, picture
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, PixelToLuminance, SensitivityModel
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame, LumaChroma, Pixels, rgb_of
from evenlight.method.choices import Resolution
from evenlight.method.contrast import one_factor
from evenlight.method.contrast.frame_light import FrameLight
from evenlight.method.contrast.luminance import channel_means, emitted_luminance
from evenlight.method.contrast.one_factor import OneFactorLoss
from evenlight.method.rate_limit import allowed_rate, modulation_rate, scalar_rate_limit

DISPLAY = replace(evenlight.load_display("varjo-xr3"), pixels_per_degree=60.0)
FEWER = [one.value for one in Resolution if one is not Resolution.FULL]


def noise(height: int, width: int, kind: str = "uint8") -> Pixels:
    """Pixels of any value, so that light averaged as codes would be too low."""
    values = np.random.default_rng(height + width).random((height, width, 3))
    if kind != "planes":
        largest = np.iinfo(kind).max if kind.startswith("u") else 1
        return (values * largest).astype(kind)
    luma, blue, red = np.moveaxis((255 * values).astype(np.uint8), 2, 0)
    few = blue[: (height + 1) // 2, : (width + 1) // 2], red[: (height + 1) // 2, : (width + 1) // 2]
    rgb = (values[..., ::-1] * 255).astype(np.uint8)
    return LumaChroma((luma, *few), (0.2126, 0.0722), False, (True, True), lambda: rgb)


@pytest.mark.parametrize("halvings", [1, 2])
@pytest.mark.parametrize("kind", ["uint8", "float32"])
def test_repeated_pixels_are_those_of_a_display_with_fewer(halvings: int, kind: str) -> None:
    """To the rounding of means; in uint8 they are made in one pass with the light, else after it."""
    small, times = picture(60, 80, np.random.default_rng(1)), 2**halvings
    pixels = small if kind == "uint8" else (small / 255).astype(kind)
    large = pixels.repeat(times, axis=0).repeat(times, axis=1)
    coarse = replace(DISPLAY, pixels_per_degree=DISPLAY.pixels_per_degree / times)
    for b in (0.3, 0.8):
        expected = OneFactorLoss((60, 80), coarse).of(pixels, b)
        seen = OneFactorLoss(large.shape[:2], DISPLAY, halvings=halvings).of(large, b)
        assert seen.loss == pytest.approx(expected.loss, abs=1e-6)
        assert seen.loss > 1e-3


@pytest.mark.parametrize("kind", ["uint8", "uint16", "float32", "float64", "planes"])
@pytest.mark.parametrize("shape", [(24, 32), (23, 33), (25, 30)])
def test_light_is_averaged_and_its_means_are_of_all_pixels(kind: str, shape: tuple[int, int]) -> None:
    pixels = noise(*shape, kind)
    for order in PixelToLuminance:
        light = FrameLight(DISPLAY, order)
        whole, mean, means = light.luminance_and_mean(pixels)
        if kind != "planes":
            np.testing.assert_allclose(
                mean, emitted_luminance(rgb_of(pixels), DISPLAY, order).mean(), rtol=1e-6
            )
            np.testing.assert_allclose(means, channel_means(rgb_of(pixels), DISPLAY.gamma), rtol=1e-6)
        blocks = whole.astype(np.float64)
        for halvings in (1, 2):
            blocks = np.pad(blocks, [(0, side % 2) for side in blocks.shape], mode="edge")
            blocks = (blocks[::2, ::2] + blocks[::2, 1::2] + blocks[1::2, ::2] + blocks[1::2, 1::2]) / 4
            fewer, own_mean, own_means = light.luminance_and_mean(pixels, halvings)
            np.testing.assert_allclose(fewer, blocks, rtol=1e-6)
            np.testing.assert_allclose([own_mean, *own_means], [mean, *means], rtol=1e-6)


def test_a_picture_needs_a_band_that_is_left() -> None:
    for shape, halvings in (((8, 8), 2), ((8, 200), 2), ((4, 9), 1)):
        OneFactorLoss(shape, DISPLAY, halvings=halvings - 1).of(noise(*shape), 0.5)
        with pytest.raises(InputError, match=f"no band .* at 1/{2**halvings} of the pixels"):
            OneFactorLoss(shape, DISPLAY, halvings=halvings)
    online = evenlight.OnlineController(0.05, resolution="quarter")
    with pytest.raises(InputError, match=r"resolution.* leaves no band"):
        online.step(noise(8, 8))
    assert online.factor is None


def cuts() -> Iterator[NDArray[np.uint8]]:
    """Cuts between black, pixels of any value, white in every other pixel, and dark."""
    checks = (np.indices((50, 64)).sum(axis=0) % 2 * 255).astype(np.uint8)[..., None].repeat(3, axis=2)
    for k in range(80):
        yield [checks, np.zeros_like(checks), np.asarray(noise(50, 64)), checks // 5, checks // 2][k // 4 % 5]


@pytest.mark.parametrize("resolution", FEWER)
@pytest.mark.parametrize("asked", [{"target_loss": 0.2}, {"budget": 0.4, "horizon": 3.0}])
def test_no_step_is_faster_than_the_rate_limit(
    resolution: str, asked: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(one_factor, "MANY_PIXELS", 0)
    display = evenlight.load_display("varjo-xr3")
    online = evenlight.OnlineController(
        **asked, fps=10.0, start_factor=0.9, resolution=resolution, proportional=5.0
    )
    factors = np.array([online.step(frame) for frame in cuts()])
    luminance = np.array([emitted_luminance(frame, display).mean() for frame in cuts()])
    limit = scalar_rate_limit(evenlight.load_rate_limit("surace2025"), display.reflected_luminance)
    rate = modulation_rate(factors, luminance, np.full(len(factors), 0.1))
    bound = allowed_rate(factors, luminance, lambda L: np.array([limit(x) for x in L.tolist()]))
    assert 0.99 < np.abs(rate[:-1] / bound[:-1]).max() <= 1 + 1e-6


def test_losses_err_by_no_more_than_the_largest_that_are_stated() -> None:
    """Of pictures of 1280 × 720; the page has films, text and gratings, too."""
    shape, rng = (720, 1280), np.random.default_rng(5)
    pictures = [picture(*shape, rng), *list(layered_pictures(*shape, rng).values())[2::3]]
    whole = OneFactorLoss(shape, DISPLAY)

    def errors(*way: int) -> list[float]:
        fewer = OneFactorLoss(shape, DISPLAY, DEFAULT_MODEL, 0.2, *way)
        return [abs(fewer.of(p, b, 3).loss - whole.of(p, b).loss) for p in pictures for b in (0.3, 0.8)]

    strips, half, quarter = errors(8, 0), errors(8, 1), errors(8, 2)
    assert 0 < max(strips) < 0.0035
    assert max(strips) < max(half) < 0.096
    assert max(half) < max(quarter) < 0.35


@pytest.mark.parametrize("resolution", ["full", *FEWER])
def test_a_still_picture_keeps_to_its_budget_at_any_resolution(resolution: str) -> None:
    online = evenlight.OnlineController(budget=0.5, fps=30.0, horizon=5.0, resolution=resolution)
    pixels = picture(480, 640, np.random.default_rng(1))
    factors = [online.step(pixels) for _ in range(60)]
    assert factors == pytest.approx([0.5] * 60, abs=0.005)


def test_a_model_that_looks_at_all_pixels_takes_no_resolution() -> None:
    asked = {
        "display": replace(DISPLAY, reflected_luminance=1.0),
        "contrast_model": replace(DEFAULT_MODEL, sensitivity=SensitivityModel.AUTHORS),
        "other_display_ok": True,
    }
    with pytest.raises(InputError, match="resolution needs a model"):
        evenlight.OnlineController(0.05, resolution="half", **asked)
    assert evenlight.OnlineController(0.05, resolution="full", **asked).factor is None


def test_in_eight_steps_each_strip_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(one_factor, "MANY_PIXELS", 0)
    pixels, still = (
        picture(256, 64, np.random.default_rng(2)),
        {"proportional": 0, "integral": 0, "derivative": 0},
    )
    seen = {}
    for resolution in ("full", "strips"):
        online = evenlight.OnlineController(0.05, start_factor=0.3, resolution=resolution, **still)
        losses = [(online.step(pixels), online.loss)[1] for _ in range(9)][1:]
        seen[resolution] = np.array(losses, dtype=float)
    assert np.ptp(seen["full"]) == 0 < np.ptp(seen["strips"])
    assert seen["strips"].mean() == pytest.approx(seen["full"].mean(), abs=0.1 * np.ptp(seen["strips"]))


@pytest.mark.parametrize("resolution", ["full", *FEWER])
def test_planes_are_converted_once_without_rgb(resolution: str, monkeypatch: pytest.MonkeyPatch) -> None:
    done, convert = [], FrameLight._converted
    monkeypatch.setattr(FrameLight, "_converted", lambda *a, **b: done.append(1) or convert(*a, **b))
    planes = noise(48, 64, "planes")
    assert isinstance(planes, LumaChroma)
    frame = Frame(0.0, 0.1, replace(planes, to_rgb=lambda: pytest.fail("R, G, B are made")))
    online = evenlight.OnlineController(budget=0.5, resolution=resolution)
    online.step(frame)
    done.clear()
    assert 0.2 <= online.step(frame) <= 1
    assert len(done) == 1
