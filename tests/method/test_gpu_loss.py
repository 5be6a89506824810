"""The loss of the current frame at one factor, in compute shaders: from textures, at once and later."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from compute_shaders import own_context
from hard_pictures import frame_of, pictures
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.data_schema.contrast_model import ContrastModel, SensitivityModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast.contrast_loss import contrast_loss
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.gpu.frame_loss import GpuLoss
from evenlight.method.gpu.pyramid import FrameTexture

pytestmark = pytest.mark.slow

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)
BRIGHT_ROOM = dataclasses.replace(HEADSET, peak_luminance=600.0, reflected_luminance=2.0)
SHAPE = (72, 120)
FRAME = frame_of(pictures(SHAPE)["photograph"])


def in_context(test: Callable[..., None]) -> None:
    """Run what needs the context in its thread."""
    own = own_context()
    own.run(test, own.context)


def texture(context, values, dtype):
    """A texture of an array, (height, width, channels)."""
    height, width, channels = values.shape
    return context.texture((width, height), channels, np.ascontiguousarray(values), alignment=1, dtype=dtype)


def levels(context, frame):
    """An 8-bit frame as a texture of levels."""
    return FrameTexture(texture(context, frame, "u1"))


def as_defined(frame, factor, display=HEADSET):
    """The loss by definition."""
    return contrast_loss(emitted_luminance(frame, display), factor, display)


@pytest.mark.parametrize("display", [HEADSET, BRIGHT_ROOM], ids=["headset", "bright room"])
def test_loss_of_every_picture_equals_the_definition_to_a_thousandth(display):
    def test(context):
        loss = GpuLoss(context, SHAPE, display)
        for number, (name, picture) in enumerate(pictures(SHAPE).items()):
            factor, frame = (0.2, 0.45, 0.9)[number % 3], frame_of(picture)
            seen = loss.of(levels(context, frame), factor)
            assert seen.loss == pytest.approx(as_defined(frame, factor, display), abs=1e-3), name

    in_context(test)


@pytest.mark.parametrize("kind", ["u1", "u2 of ten bits", "four channels", "array", "array of floats"])
def test_all_textures_of_a_frame_give_its_loss(kind):
    def test(context):
        ten = (
            np.random.default_rng(1).integers(0, 1024, (*SHAPE, 3), dtype=np.uint16)
            if "ten" in kind
            else None
        )
        unit = FRAME / 255 if ten is None else ten / 1023
        if kind == "array":
            frame = FRAME
        elif kind == "array of floats":
            frame = unit.astype(np.float32)
        elif kind == "u1":
            frame = levels(context, FRAME)
        elif kind == "four channels":
            four = np.concatenate([FRAME, np.full((*SHAPE, 1), 255, np.uint8)], axis=2)
            frame = levels(context, four)
        else:
            frame = FrameTexture(texture(context, ten, "u2"), levels=1024)
        seen = GpuLoss(context, SHAPE, HEADSET).of(frame, 0.4)
        assert seen.loss == pytest.approx(as_defined(unit, 0.4), abs=1e-3)
        assert seen.mean_luminance == pytest.approx(emitted_luminance(unit, HEADSET).mean(), rel=1e-5)

    in_context(test)


def test_a_drawn_frame_is_turned_over():
    """Rows of textures that were drawn to count from below; every other row is another pyramid."""

    def test(context):
        loss = GpuLoss(context, SHAPE, HEADSET)
        upright = loss.of(levels(context, FRAME), 0.3)
        turned = dataclasses.replace(levels(context, FRAME[::-1]), from_below=True)
        assert loss.of(turned, 0.3) == upright
        assert loss.of(dataclasses.replace(turned, from_below=False), 0.3) != upright

    in_context(test)


def test_what_is_not_a_number_is_dark_and_what_is_too_bright_is_the_peak():
    """What a renderer may leave behind; it must not spread over the pyramid."""

    def test(context):
        odd = (FRAME / 255).astype(np.float32)
        usual = odd.copy()
        for pixel, strange, meant in (
            (3, np.nan, 0),
            (40, np.inf, 1),
            (77, -np.inf, 0),
            (90, 7.0, 1),
            (99, -1, 0),
        ):
            odd[pixel % 72, pixel], usual[pixel % 72, pixel] = strange, meant
        loss = GpuLoss(context, SHAPE, HEADSET)
        seen, expected = (loss.of(values, 0.4) for values in (odd, usual))
        assert np.isfinite(seen.loss)
        assert seen == expected

    in_context(test)


@settings(deadline=None, max_examples=15)
@given(st.floats(0.2, 1.0), st.integers(0, 2**32 - 1))
def test_loss_lies_between_none_and_all_and_is_none_undimmed(factor, seed):
    def test(context):
        loss = GpuLoss(context, (9, 13), HEADSET)
        frame = np.random.default_rng(seed).integers(0, 256, (9, 13, 3), dtype=np.uint8)
        seen = loss.of(frame, factor)
        assert 0 <= seen.loss <= 1
        assert loss.of(frame, 1.0).loss == 0

    in_context(test)


def test_answers_come_in_the_order_of_the_questions():
    """One frame late, as a live loop asks: each answer is to its own frame and factor."""

    def test(context):
        loss = GpuLoss(context, SHAPE, HEADSET)
        frames = [frame_of(picture) for picture in list(pictures(SHAPE).values())[:4]]
        factors = [0.3, 0.5, 0.7, 0.4]
        at_once = [loss.of(levels(context, f), b) for f, b in zip(frames, factors, strict=True)]
        late = []
        loss.start(levels(context, frames[0]), factors[0])
        for frame, factor in zip(frames[1:], factors[1:], strict=True):
            loss.start(levels(context, frame), factor)
            late.append(loss.result())
        late.append(loss.result())
        assert late == at_once

    in_context(test)


def test_too_much_at_once_and_nothing_at_all_are_refused():
    def test(context):
        loss = GpuLoss(context, (8, 8), HEADSET, lowest_factor=0.3)
        frame = np.zeros((8, 8, 3), np.uint8)
        with pytest.raises(ValueError, match="no frame is under way"):
            loss.result()
        with pytest.raises(InputError, match=r"the factor must lie in 0\.3 to 1, got 0\.29"):
            loss.start(frame, 0.29)
        with pytest.raises(InputError, match=r"expected a frame of the shape \(8, 8\), got \(8, 9\)"):
            loss.start(np.zeros((8, 9, 3), np.uint8), 0.5)
        loss.start(frame, 0.5)
        with pytest.raises(ValueError, match="1 of the frames before are under way"):
            loss.of(frame, 0.5)
        loss.start(frame, 0.5)
        with pytest.raises(ValueError, match="2 frames are under way"):
            loss.start(frame, 0.5)

    in_context(test)


def test_textures_that_cannot_be_read_are_refused():
    def test(context):
        small = FrameTexture(context.texture((8, 9), 3, dtype="u1"))
        with pytest.raises(InputError, match="the texture has 8 x 9 pixels; need 8 x 8"):
            GpuLoss(context, (8, 8), HEADSET).of(small, 0.5)
        with pytest.raises(ValueError, match="need a texture of three or more channels"):
            FrameTexture(context.texture((8, 8), 1, dtype="u1"))
        with pytest.raises(ValueError, match="got 3 of f2"):
            FrameTexture(context.texture((8, 8), 3, dtype="f2"))
        authors = ContrastModel(sensitivity=SensitivityModel.AUTHORS)
        with pytest.raises(InputError, match="got 'authors'"):
            GpuLoss(context, (8, 8), HEADSET, authors)

    in_context(test)
