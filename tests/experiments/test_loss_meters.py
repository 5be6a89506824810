"""What meters say of a picture in the window's context: its luminance, and its loss when that is known."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from compute_shaders import own_context

from evenlight.data_schema.display import Display
from evenlight.experiments.playback.loss_meters import GpuMeter, ProcessorMeter, open_meter
from evenlight.experiments.playback.picture_luminance import PictureLuminance
from evenlight.method.choices import Device
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.contrast.one_factor import OneFactorLoss
from evenlight.method.gpu.context import Fence, _Calls
from evenlight.method.gpu.frame_loss import GpuLoss
from evenlight.stimuli.dithering import GRID_LEVELS
from evenlight.stimuli.sequence_format import codes_on_grid

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)


def in_context(test: Callable[..., None]) -> None:
    """Run what needs the context in its thread."""
    own = own_context()
    own.run(test, own.context)


def drawn(context: Any, codes: np.ndarray) -> Any:
    """A renderer whose picture is known: codes of the grid, (height, width, 3), row 0 on top."""
    height, width = codes.shape[:2]
    texels = np.concatenate([codes, np.full((height, width, 1), GRID_LEVELS - 1)], axis=2)[::-1]
    texture = context.texture((width, height), 4, texels.astype(np.uint16).tobytes(), dtype="u2")
    values = codes_on_grid(codes)
    return SimpleNamespace(size=(width, height), codes=texture, seen=None, pixel_values=lambda: values)


def some_codes(height: int, width: int) -> np.ndarray:
    codes = np.random.default_rng(3).integers(0, GRID_LEVELS, (height, width, 3)).astype(np.uint16)
    codes[: height // 3] //= 8  # so that no part tells the mean of all
    return codes


@pytest.mark.parametrize("size", [(1, 1), (16, 32), (37, 83), (90, 160)])
@pytest.mark.parametrize("level", [None, 0, GRID_LEVELS - 1])
def test_the_luminance_of_a_picture_is_the_mean_of_all_its_pixels(size: tuple[int, int], level: int) -> None:
    """Or of those that a headset's lens shows."""
    seen = np.random.default_rng(5).random(size) < 0.7
    seen[0, 0] = True

    def test(context: Any) -> None:
        codes = some_codes(*size) if level is None else np.full((*size, 3), level, np.uint16)
        pictures = drawn(context, codes)
        expected = emitted_luminance(codes / (GRID_LEVELS - 1), HEADSET).mean()
        light = PictureLuminance(context, pictures, HEADSET)
        assert light.mean() == pytest.approx(expected, rel=1e-5)
        channels = ((codes / (GRID_LEVELS - 1)) ** HEADSET.gamma).mean(axis=(0, 1))
        assert light.channel_means() == pytest.approx(channels, rel=1e-5)
        pictures.seen = seen
        light = PictureLuminance(context, pictures, HEADSET)
        expected = emitted_luminance(codes / (GRID_LEVELS - 1), HEADSET)[seen].mean()
        assert light.mean() == pytest.approx(expected, rel=1e-5)
        assert light.seen_share == pytest.approx(seen.mean())
        pictures.seen = None
        light.mean()
        assert light.seen_share == 1.0

    in_context(test)


@pytest.mark.parametrize("patient", [False, True])
def test_both_meters_say_the_loss_at_the_factor_asked_for(patient: bool) -> None:
    def test(context: Any) -> None:
        codes = some_codes(72, 120)
        codes[:, 60:] //= 8
        pictures = drawn(context, codes)
        light = PictureLuminance(context, pictures, HEADSET)
        expected = OneFactorLoss((72, 120), HEADSET).of(pictures.pixel_values(), 0.4).loss
        seen = np.zeros((72, 120), dtype=bool)
        seen[:, :60] = True
        half = OneFactorLoss((72, 120), HEADSET)
        half.count_only(seen)
        meters = (
            ProcessorMeter(pictures, HEADSET, 0.2, light, patient=patient),
            GpuMeter(context, pictures, GpuLoss(context, (72, 120), HEADSET), light, patient=patient),
        )
        for meter in meters:
            assert meter.result() is None
            assert meter.begin(0.4)
            assert not meter.begin(0.4)
            found = meter.result()
            assert found is not None or not patient
            while found is None:
                context.finish()
                found = meter.result()
            assert found == pytest.approx(expected, abs=1e-3)
            assert meter.mean_luminance() == light.mean()
            assert (meter.channel_means() == light.channel_means()).all()
            pictures.seen = seen
            meter.begin(0.4)
            while (of_half := meter.result()) is None:
                context.finish()
            assert of_half == pytest.approx(half.of(pictures.pixel_values(), 0.4).loss, abs=1e-3)
            assert abs(of_half - expected) > 0.005  # five times as much as the two kinds may differ
            pictures.seen = None  # a runtime may take its hidden area back
            meter.begin(0.4)
            while (of_all := meter.result()) is None:
                context.finish()
            assert of_all == pytest.approx(expected, abs=1e-3)
            meter.close()

    in_context(test)


@pytest.mark.parametrize("software", [False, True])
def test_what_is_asked_for_measures_and_by_itself_no_program_does(monkeypatch: Any, software: bool) -> None:
    monkeypatch.setattr("evenlight.method.gpu.context.is_software", lambda _: software)

    def test(context: Any) -> None:
        kinds = {}
        for device in Device:
            pictures = drawn(context, some_codes(8, 8))
            meter = open_meter(context, pictures, HEADSET, lowest_factor=0.2, device=device, patient=True)
            kinds[device] = type(meter)
            meter.close()
        by_itself = ProcessorMeter if software else GpuMeter
        assert kinds == {Device.CPU: ProcessorMeter, Device.GPU: GpuMeter, Device.AUTO: by_itself}

    in_context(test)


class SlowLoss:
    """A graphics processor that is not done before it is asked a few times, and must not be waited for."""

    def __init__(self, times: int) -> None:
        self._left = times

    def start(self, frame: object, factor: float) -> None:
        """Begin."""

    def ready(self) -> bool:
        self._left -= 1
        return self._left < 0

    def result(self) -> object:
        assert self._left < 0, "it was waited for"
        return SimpleNamespace(loss=0.1)


def test_a_meter_does_not_wait_for_the_graphics_processor() -> None:
    def test(context: Any) -> None:
        pictures = drawn(context, some_codes(8, 8))
        slow: Any = SlowLoss(3)
        meter = GpuMeter(context, pictures, slow, PictureLuminance(context, pictures, HEADSET), patient=False)
        assert meter.begin(0.5)
        assert [meter.result() for _ in range(3)] == [None] * 3
        assert not meter.begin(0.5)
        seen = meter.result()
        assert seen == 0.1

    in_context(test)


def test_a_fence_is_passed_once_all_is_done() -> None:
    def test(context: Any) -> None:
        fence = Fence()
        context.finish()
        assert fence.passed()
        fence.release()

    in_context(test)


def test_a_fence_asks_without_waiting_until_what_is_before_it_is_done(monkeypatch: Any) -> None:
    """OpenGL says 0x911B, time is over, until it says 0x911C, it is done; 0 is the time to wait."""
    answers, waited, deleted = [0x911B, 0x911B, 0x911C], [], []

    def wait(sync: int, flags: int, nanoseconds: int) -> int:
        waited.append((sync, flags, nanoseconds))
        return answers.pop(0)

    calls = _Calls(lambda *_: 7, wait, deleted.append)
    monkeypatch.setattr("evenlight.method.gpu.context._calls", lambda: calls)
    fence = Fence()
    assert [fence.passed() for _ in range(3)] == [False, False, True]
    assert waited == [(7, 1, 0)] * 3
    fence.release()
    assert deleted == [7]


@pytest.mark.parametrize("calls", [None, _Calls(lambda *_: None, None, None)])
def test_without_fences_a_refresh_of_patience_does(monkeypatch: Any, calls: Any) -> None:
    monkeypatch.setattr("evenlight.method.gpu.context._calls", lambda: calls)
    fence = Fence()
    assert [fence.passed() for _ in range(3)] == [False, True, True]
    fence.release()


def test_over_four_turns_a_meter_counts_every_row(monkeypatch: Any) -> None:
    """Each measurement is handed the next turn."""

    def test(context: Any) -> None:
        pictures = drawn(context, some_codes(8, 8))
        light = PictureLuminance(context, pictures, HEADSET)
        meter = ProcessorMeter(pictures, HEADSET, 0.2, light, patient=True)
        turns: list[int] = []
        monkeypatch.setattr(
            meter, "_loss", SimpleNamespace(of=lambda _, __, turn: SimpleNamespace(loss=turns.append(turn)))
        )
        for _ in range(5):
            meter.begin(0.5)
            meter.result()
        assert turns == list(range(5))
        meter.close()

    in_context(test)
