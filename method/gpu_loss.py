"""The contrast loss of the current frame at one factor, on the graphics processor, for a live controller."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast_loss import loss_of
from evenlight.method.gpu_bands import Request
from evenlight.method.gpu_fence import Fence
from evenlight.method.gpu_frame import FrameTexture, packed
from evenlight.method.gpu_frame_analysis import emitted_mean
from evenlight.method.gpu_one_pass import GpuOnePass
from evenlight.method.one_factor import LossSeen

if TYPE_CHECKING:
    import moderngl

_KNOTS = 2  # the factor that is asked for, and 1


class GpuLoss:
    """The contrast loss of frames of one size at one factor each; nothing but a few numbers is read back.

    It stands in for `method.one_factor.OneFactorLoss`, and takes textures too. Two ways to use it. At once:
    `of_texture(frame, factor)` waits for the answer. Without waiting, one frame late: `start(frame, factor)`
    at each frame, and `result()` from the second on, which gives the answer to the start before the last;
    `ready()` says whether it is there, for `result()` waits if it is not.

    All calls must come from the thread of the context. Programs, textures and buffers that were bound may be
    others afterwards: a window that draws with OpenGL of its own restores them, as it does after drawing.

    Parameters
    ----------
    context : moderngl.Context
        Of a window, or `method.gpu_context.compute_context()`; OpenGL 4.3 or later.
    shape : (height, width)
        Of the frames [pixels], at least 8 × 8.
    display : Display
        The display that shows them.
    model : ContrastModel
        Choices of the contrast model.
    lowest_factor : float
        Smallest factor that will be asked for, above 0.

    Raises
    ------
    InputError
        If the context has no compute shaders, or the model has no single pass on the graphics processor.
    """

    def __init__(
        self,
        context: moderngl.Context,
        shape: tuple[int, int],
        display: Display,
        model: ContrastModel = DEFAULT_MODEL,
        lowest_factor: float = 0.2,
    ) -> None:
        request = Request(lowest_factor, knots=_KNOTS, references=_KNOTS, equal_ratios=False)
        self._display, self._lowest = display, lowest_factor
        self._pass = GpuOnePass(context, shape, display, model, request)
        self._fences: list[Fence] = []

    def of_texture(self, frame: FrameTexture, factor: float) -> LossSeen:
        """Return the loss of a frame that is a texture already, at factor b; waits for it."""
        self._pass.require_idle()
        self.start(frame, factor)
        return self.result()

    def of(self, pixel_values: NDArray[Any], factor: float) -> LossSeen:
        """Return the loss of a frame, (height, width, 3) gamma-encoded, uploaded first; waits for it."""
        self._pass.require_idle()
        self.start(pixel_values, factor)
        return self.result()

    def start(self, frame: FrameTexture | NDArray[Any], factor: float) -> None:
        """Begin with a frame, and return at once; two may be under way.

        Parameters
        ----------
        frame : FrameTexture, or array, (height, width, 3)
            The frame.
        factor : float
            Brightness factor b at which its loss is asked for, from the lowest factor to 1.
        """
        if not self._lowest * (1 - 1e-9) <= factor <= 1:
            raise InputError(f"the factor must lie in {self._lowest:g} to 1, got {factor:g}")
        ready = frame if isinstance(frame, FrameTexture) else packed(frame)
        asked = float(np.log2(factor))
        # Few pixels are compared with their neighbours at the very factors, many once, halfway.
        self._pass.start(ready, np.array([asked, 0.0]), np.array([asked / 2, asked, 0.0]))
        self._fences.append(Fence())

    def ready(self) -> bool:
        """Return whether the answer for the oldest frame under way is there; never waits."""
        return bool(self._fences) and self._fences[0].passed()

    def bytes_moved(self, bytes_per_pixel: int) -> int:
        """Return the bytes that a frame moves at least, as `GpuOnePass.bytes_moved`."""
        return self._pass.bytes_moved(bytes_per_pixel)

    def result(self) -> LossSeen:
        """Return what the oldest frame under way gave; waits if it is not ready."""
        counted = self._pass.result()
        self._fences.pop(0).release()
        dimmed = full = 0.0
        for band in counted.bands:
            dimmed += band.visible[0, 0] / band.pixels
            full += band.visible[-1, 1] / band.pixels
        return LossSeen(loss_of(min(dimmed, full), full), emitted_mean(counted, self._display))
