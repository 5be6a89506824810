"""Decoded frames as they are, Y, Cb, Cr, where their light is that of FFmpeg's R, G, B to the last bit."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
from av.video.reformatter import ColorRange, VideoReformatter
from numpy.typing import NDArray

from evenlight.data_schema.contrast_model import PixelToLuminance
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import LumaChroma, Pixels
from evenlight.method.contrast.frame_light import FrameLight
from evenlight.stimuli.video.frame_conversion import (
    LUMA_WEIGHTS,
    ColourConverter,
    complete_tags,
    planes_of,
    require_gamma_encoded,
)
from evenlight.stimuli.video.square_pixels import SQUARE

if TYPE_CHECKING:
    from fractions import Fraction

    from av.video.frame import VideoFrame

_PLANAR = tuple(f"yuv{full}{kind}p" for full in ("", "j") for kind in ("420", "422", "444"))
_AMID = ((True, False), (True, True), (False, False), (False, True))  # MPEG-2 and later; JPEG; the others
_ROWS = 16  # of the noise: rows lie to chroma as those before
_LINEAR = Display("linear", peak_luminance=1.0, black_level=0.0, gamma=1.0, pixels_per_degree=60.0)


class PixelReader:
    """Gives the pixels of decoded frames, as planes where that is as good, else as R, G, B.

    Decision (docs/decisions/one-pass-curves.md): planes are taken where a picture of noise with the same
    tags gives exactly the same luminance both ways. This also tells where samples of chroma lie, which PyAV
    does not.

    Parameters
    ----------
    pixel_aspect : Fraction
        Width of the frames' pixels over their height; what comes out has square ones.
    """

    def __init__(self, pixel_aspect: Fraction = SQUARE) -> None:
        self._convert = ColourConverter(pixel_aspect)
        self._one_at_a_time = threading.Lock()  # the converter keeps its tables
        self._amid: dict[object, tuple[bool, bool] | None] = {}  # where chroma lies, by the tags of frames

    def pixels(self, frame: VideoFrame) -> Pixels:
        """Return the pixels of a frame, upright; raises what `ColourConverter.rgb` raises.

        Nothing else may write to the frame any more.
        """
        if frame.format.name not in _PLANAR or self._convert.display_matrix(frame) is not None:
            return self._rgb(frame)
        require_gamma_encoded(frame)
        complete_tags(frame)
        kind = (
            frame.format.name, frame.width, frame.height,
            frame.colorspace, frame.color_range, frame.interlaced_frame,
        )  # fmt: skip
        if kind not in self._amid:
            self._amid[kind] = self._amid_for(frame)
        amid = self._amid[kind]
        return self._rgb(frame) if amid is None else self._planes(frame, amid)

    def _rgb(self, frame: VideoFrame) -> NDArray[Any]:
        """Convert a frame; any thread may ask for it."""
        with self._one_at_a_time:
            return self._convert.rgb(frame)

    def _planes(self, frame: VideoFrame, amid: tuple[bool, bool]) -> LumaChroma:
        with self._one_at_a_time:
            luma, blue, red = planes_of(self._convert.with_square_pixels(frame))
        planes = luma[self._convert.shown_part(frame)], blue, red
        full = frame.color_range == ColorRange.JPEG
        return LumaChroma(planes, LUMA_WEIGHTS[frame.colorspace], full, amid, lambda: self._rgb(frame))

    def _amid_for(self, frame: VideoFrame) -> tuple[bool, bool] | None:
        """Return where FFmpeg takes chroma of such frames to lie; None if planes do not give its light."""
        rows = _ROWS + frame.height % 2
        noise = VideoReformatter().reformat(frame, height=rows + 2 * (rows == frame.height))  # with its tags
        noise.make_writable()
        rng = np.random.default_rng(0)
        for plane in planes_of(noise):
            # Farther from gray, FFmpeg's whole numbers overflow in pixels brighter than white.
            plane[:] = rng.integers(48, 208, plane.shape, dtype=np.uint8)
        light = FrameLight(_LINEAR, PixelToLuminance.LINEAR_FIRST)
        expected = light.luminance(self._rgb(noise))
        for amid in _AMID:
            if np.array_equal(light.luminance(self._planes(noise, amid)), expected):
                return amid
        return None
