"""The analysis of one frame on the graphics processor: `method.frame_analysis`, with its pass in shaders."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.method.band_shares import REFERENCES
from evenlight.method.contrast_loss import loss_of
from evenlight.method.frame_analysis import FrameLoss
from evenlight.method.gpu_bands import Request
from evenlight.method.gpu_context import OwnContext
from evenlight.method.gpu_frame import FrameTexture, Packed, packed
from evenlight.method.gpu_one_pass import Counted, GpuOnePass

if TYPE_CHECKING:
    import moderngl


class GpuCurve:
    """The loss curve of frames of one size, in a context that is current.

    Parameters
    ----------
    context : moderngl.Context
        With compute shaders.
    shape : (height, width)
        Of the frames.
    display : Display
        The display that shows them.
    model : ContrastModel
        Choices of the contrast model.
    factors : array, (K,)
        Knots b, rising to 1.

    Raises
    ------
    InputError
        If there are no compute shaders, or only the processor computes this model.
    """

    def __init__(
        self,
        context: moderngl.Context,
        shape: tuple[int, int],
        display: Display,
        model: ContrastModel,
        factors: Array,
    ) -> None:
        self._display, self._log_factors = display, np.log2(factors)
        steps = np.diff(self._log_factors)
        equal = bool(np.allclose(steps, steps.mean(), rtol=1e-6, atol=0))
        request = Request(float(factors[0]), len(factors), REFERENCES, equal)
        self.one_pass = GpuOnePass(context, shape, display, model, request)
        way = 1 - self._log_factors / self._log_factors[0]  # of log b from the lowest factor to 1
        self._nearest = np.minimum((way * REFERENCES).astype(np.int64), REFERENCES - 1)
        shares = np.concatenate([[0.5], (np.arange(REFERENCES) + 0.5) / REFERENCES])
        self._log_references = self._log_factors[0] * (1 - shares)

    def of(self, frame: FrameTexture | Packed) -> FrameLoss:
        """Return the loss curve and the means of a frame; waits for it."""
        self.one_pass.require_idle()
        self.start(frame)
        return self.result()

    def start(self, frame: FrameTexture | Packed) -> None:
        """Begin with a frame, and return at once; two may be under way."""
        self.one_pass.start(frame, self._log_factors, self._log_references)

    def result(self) -> FrameLoss:
        """Return what the oldest frame under way gave; waits if it is not ready."""
        counted = self.one_pass.result()
        visible = self._visible(counted)
        reference = float(visible[-1])
        loss = np.array([loss_of(float(C_v), reference) for C_v in visible])
        return FrameLoss(loss, reference, emitted_mean(counted, self._display), counted.means[:3])

    def _visible(self, counted: Counted) -> Array:
        """Return C_v at each knot; in bands of few pixels, neighbours are compared at the nearest factor."""
        shares, knots = np.zeros(len(self._log_factors)), np.arange(len(self._log_factors))
        for band in counted.bands:
            reference = self._nearest if len(band.visible) > 1 else 0
            # Where two counts meet, a pixel may seem to vanish again as b grows.
            shares += np.maximum.accumulate(band.visible[reference, knots]) / band.pixels
        return shares / self.one_pass.n_bands


class GpuFrameAnalysis:
    """What `FrameAnalysis` gives of a frame, from the graphics processor; calls may come from any thread.

    Parameters
    ----------
    shape : (height, width)
        Of the frames.
    display : Display
        The display that shows them.
    model : ContrastModel
        Choices of the contrast model.
    factors : array, (K,)
        Knots b, rising to 1.
    own : OwnContext, optional
        Where; several analyses may share one.

    Raises
    ------
    InputError
        If there are no compute shaders, or only the processor computes this model.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        display: Display,
        model: ContrastModel,
        factors: Array,
        own: OwnContext | None = None,
    ) -> None:
        self._own = own or OwnContext()
        self._curve = self._own.run(GpuCurve, self._own.context, shape, display, model, factors)

    @property
    def renderer(self) -> str:
        """What it runs on, in the driver's words."""
        return self._own.renderer

    def of(self, pixel_values: NDArray[Any]) -> FrameLoss:
        """Return the loss curve and the means of a frame, (height, width, 3) gamma-encoded."""
        return self._own.run(self._curve.of, packed(pixel_values))


def emitted_mean(counted: Counted, display: Display) -> float:
    """Return Ī, the mean luminance that a display emits at b = 1 [cd/m^2]."""
    span = display.peak_luminance - display.black_level
    return float(display.black_level + span * counted.means[3])
