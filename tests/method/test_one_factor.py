"""The loss at one factor: the definition, for every choice of the contrast model."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.contrast_model import (
    DEFAULT_MODEL,
    LossForm,
    MaskingNeighbourhood,
    PixelToLuminance,
    SensitivityModel,
    Visibility,
)
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast import one_factor
from evenlight.method.contrast.contrast_loss import contrast_loss
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.contrast.one_factor import STRIP, OneFactorLoss, counted_rows
from evenlight.method.preset_files import load_display

DISPLAY = load_display("varjo-xr3")


def picture(height: int, width: int, seed: int = 1) -> np.ndarray:
    """Detail at every scale, in colour, with an area of one luminance."""
    rng = np.random.default_rng(seed)
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None, :])
    spectrum = np.fft.rfft2(rng.standard_normal((height, width))) / np.maximum(frequency, 1 / width)
    detail = np.fft.irfft2(spectrum, (height, width))
    gray = np.clip(0.45 + 0.2 * detail / detail.std(), 0, 1)
    pixels = np.stack([gray, gray**1.2, 0.8 * gray], axis=2)
    pixels[: height // 3, : width // 3] = 0.3
    return np.asarray((255 * pixels).round(), dtype=np.uint8)


def by_definition(pixels: np.ndarray, factor: float, display=DISPLAY, model=DEFAULT_MODEL) -> float:
    emitted = emitted_luminance(pixels, display, model.pixel_to_luminance)
    return contrast_loss(emitted, factor, display, model)


@pytest.mark.parametrize("size", [(8, 8), (9, 31), (61, 47), (90, 160)])
@pytest.mark.parametrize("factor", [0.2, 0.47, 1.0])
def test_it_is_the_definition(size: tuple[int, int], factor: float) -> None:
    pixels = picture(*size)
    seen = OneFactorLoss(size, DISPLAY).of(pixels, factor)
    assert seen.loss == pytest.approx(by_definition(pixels, factor), abs=2e-4)
    assert seen.mean_luminance == pytest.approx(emitted_luminance(pixels, DISPLAY).mean(), rel=1e-5)


@pytest.mark.parametrize(
    "choice",
    [
        {"sensitivity": SensitivityModel.AUTHORS},
        {"masking": MaskingNeighbourhood.WITHOUT_CENTRE},
        {"visibility": Visibility.POSITIVE_ONLY},
        {"pixel_to_luminance": PixelToLuminance.LUMA_FIRST},
        {"band_count": 2},
        {"visibility": Visibility.SOFT},
        {"loss": LossForm.ABSOLUTE},
        {"loss": LossForm.SUPRATHRESHOLD},
        {"loss": LossForm.SUPRATHRESHOLD, "visibility": Visibility.POSITIVE_ONLY},
        {"visibility": Visibility.SOFT, "masking": MaskingNeighbourhood.WITHOUT_CENTRE},
    ],
    ids=lambda choice: "-".join(str(getattr(value, "value", value)) for value in choice.values()),
)
@pytest.mark.parametrize("reflected", [0.0, 2.0])
def test_it_is_the_definition_for_every_choice(choice: dict, reflected: float) -> None:
    model, display = replace(DEFAULT_MODEL, **choice), replace(DISPLAY, reflected_luminance=reflected)
    pixels = picture(60, 80)
    seen = OneFactorLoss((60, 80), display, model).of(pixels, 0.35)
    assert seen.loss == pytest.approx(by_definition(pixels, 0.35, display, model), abs=4e-4)


def test_other_pixel_types_give_the_same() -> None:
    pixels, loss = picture(48, 64), OneFactorLoss((48, 64), DISPLAY)
    expected = loss.of(pixels, 0.4).loss
    assert loss.of(pixels.astype(np.uint16) * 257, 0.4).loss == pytest.approx(expected, abs=1e-12)
    assert loss.of(pixels / 255, 0.4).loss == pytest.approx(expected, abs=2e-3)


def test_what_has_no_contrast_loses_none() -> None:
    gray = np.full((40, 50, 3), 90, np.uint8)
    assert OneFactorLoss((40, 50), DISPLAY).of(gray, 0.2).loss == 0
    black = np.zeros((40, 50, 3), np.uint8)
    assert OneFactorLoss((40, 50), DISPLAY).of(black, 0.2).loss == 0


@given(st.integers(1, 400), st.integers(1, 6), st.integers(0, 100))
def test_over_as_many_turns_as_there_are_each_row_is_counted_once(
    height: int, one_in: int, turn: int
) -> None:
    """Where too few rows are there to leave any out, all are counted at every turn."""
    times = np.zeros(height, int)
    for k in range(turn, turn + one_in):
        strips = counted_rows(height, one_in, k)
        assert strips
        for begin, end in strips:
            times[begin:end] += 1
    assert (times == (one_in if height < one_in * STRIP else 1)).all()


def test_the_mean_of_four_turns_is_what_all_rows_give(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(one_factor, "MANY_PIXELS", 0)
    pixels, shape = picture(96, 80), (96, 80)  # no level has rows left over
    emitted = emitted_luminance(pixels, DISPLAY).astype(np.float32)
    model = replace(DEFAULT_MODEL, band_count=2)
    strips, whole = (OneFactorLoss(shape, DISPLAY, model, one_strip_in=n) for n in (4, 1))
    turns = np.array([strips.visible_contrast(emitted, 0.3, turn) for turn in range(4)])
    assert np.ptp(turns[:, 0]) > 0
    np.testing.assert_allclose(turns.mean(axis=0), whole.visible_contrast(emitted, 0.3), rtol=1e-12)


@pytest.mark.parametrize("period", [8, 16, 32, 64, 128])
@pytest.mark.parametrize("thick", [0.25, 0.5])
def test_strips_err_no_more_than_strips_drawn_by_lot(
    monkeypatch: pytest.MonkeyPatch, period: int, thick: float
) -> None:
    """Grain in bands, which strips at equal distances see always or never.

    Of one strip drawn by lot from each four, the mean errs with an SD of σ / sqrt(parts), σ that of the four
    strips about their mean; 2.5 SD are what one draw in a hundred passes.
    """
    height, rng = 576, np.random.default_rng(period)
    on = abs(np.arange(height) % period - period / 2) < thick * period / 2
    gray = 0.4 + 0.15 * on[:, None] * rng.standard_normal((height, 64))
    emitted = emitted_luminance(np.repeat(gray[..., None], 3, axis=2).clip(0, 1), DISPLAY).astype(np.float32)
    monkeypatch.setattr(one_factor, "MANY_PIXELS", 0)
    loss = OneFactorLoss((height, 64), DISPLAY, replace(DEFAULT_MODEL, band_count=1), one_strip_in=4)
    turns = [loss.visible_contrast(emitted, 0.3, turn)[1] for turn in range(4)]
    shares = []
    for begin in range(0, height, STRIP):
        alone = [(begin, begin + STRIP)]
        monkeypatch.setattr(one_factor, "counted_rows", lambda *_, alone=alone: alone)
        shares.append(loss.visible_contrast(emitted, 0.3)[1])
    parts = np.reshape(shares, (-1, 4))
    assert parts.mean() > 0.05
    by_lot = np.sqrt(parts.var(axis=1).mean() / len(parts))
    assert np.abs(np.array(turns) - parts.mean()).max() <= 2.5 * by_lot


def test_small_pictures_are_counted_whole() -> None:
    pixels = picture(360, 480)
    whole, strips = (OneFactorLoss((360, 480), DISPLAY, one_strip_in=n).of(pixels, 0.3) for n in (1, 4))
    assert strips == whole


def test_what_was_not_asked_for_at_first_is_refused() -> None:
    loss = OneFactorLoss((40, 50), DISPLAY, lowest_factor=0.3)
    with pytest.raises(InputError, match=r"shape \(40, 50\), got \(50, 40\)"):
        loss.of(picture(50, 40), 0.5)
    with pytest.raises(InputError, match=r"0\.3 to 1, got 0\.2"):
        loss.of(picture(40, 50), 0.2)
