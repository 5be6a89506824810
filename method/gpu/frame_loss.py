"""The contrast loss of frames on the graphics processor.

`GpuFrameAnalysis` gives the curve over all factors, as `contrast.frame_analysis` does; `GpuLoss` the loss at
one factor, as `contrast.one_factor` does, for a live controller.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Pixels, rgb_of
from evenlight.method.contrast.band_shares import REFERENCES
from evenlight.method.contrast.bends import NO_BENDS
from evenlight.method.contrast.contrast_loss import loss_of, losses_of
from evenlight.method.contrast.frame_analysis import FrameLoss
from evenlight.method.contrast.one_factor import MeasuredLoss
from evenlight.method.gpu.context import Fence, OwnContext
from evenlight.method.gpu.one_pass import CountingRequest, GpuOnePass
from evenlight.method.gpu.pyramid import FrameTexture, packed

if TYPE_CHECKING:
    import moderngl

_KNOTS = 2  # the factor that is asked for, and 1


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
        self._display, self._log_factors, self._form = display, np.log2(factors), model.loss
        steps = np.diff(self._log_factors)
        equal = bool(np.allclose(steps, steps.mean(), rtol=1e-6, atol=0))
        request = CountingRequest(float(factors[0]), len(factors), REFERENCES, equal)
        self.one_pass = GpuOnePass(context, shape, display, model, request)
        way = 1 - self._log_factors / self._log_factors[0]  # of log b from the lowest factor to 1
        self._nearest = np.minimum((way * REFERENCES).astype(np.int64), REFERENCES - 1)
        shares = np.concatenate([[0.5], (np.arange(REFERENCES) + 0.5) / REFERENCES])
        self._log_references = self._log_factors[0] * (1 - shares)

    def of(self, frame: FrameTexture | NDArray[Any]) -> FrameLoss:
        """Return the loss curve and the means of a frame; waits for it."""
        self.one_pass.require_idle()
        self.start(frame)
        return self.result()

    def start(self, frame: FrameTexture | NDArray[Any]) -> None:
        """Begin with a frame, and return at once; two may be under way."""
        self.one_pass.start(frame, self._log_factors, self._log_references)

    def result(self) -> FrameLoss:
        """Return what the oldest frame under way gave; waits if it is not ready."""
        bands, means = self.one_pass.result()
        visible, knots = np.zeros(len(self._log_factors)), np.arange(len(self._log_factors))
        for band in bands:
            reference = self._nearest if len(band) > 1 else 0
            # Where two counts meet, a pixel may seem to vanish again as b grows.
            visible += np.maximum.accumulate(band[reference, knots])
        visible /= self.one_pass.n_bands
        reference_contrast = float(visible[-1])
        loss = losses_of(visible, reference_contrast, self._form)
        return FrameLoss(loss, reference_contrast, emitted_mean(means, self._display), means[:3], NO_BENDS)


class GpuFrameAnalysis:
    """What `FrameAnalysis` gives of a frame, from the graphics processor; calls may come from any thread.

    Parameters
    ----------
    shape, display, model, factors
        As of `GpuCurve`.
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

    def of(self, pixels: Pixels) -> FrameLoss:
        """Return the loss curve and the means of a frame, (height, width, 3) gamma-encoded."""
        return self._own.run(self._curve.of, packed(rgb_of(pixels)))


def emitted_mean(means: Array, display: Display) -> float:
    """Return Ī, the mean luminance that a display emits at b = 1 [cd/m^2], of the means of a pass."""
    span = display.peak_luminance - display.black_level
    return float(display.black_level + span * means[3])


class GpuLoss:
    """The contrast loss of frames of one size at one factor each; nothing but a few numbers is read back.

    It stands in for `contrast.one_factor.OneFactorLoss`, and takes textures too. Two ways to use it. At once:
    `of(frame, factor)` waits for the answer. Without waiting, one frame late: `start(frame, factor)` at each
    frame, and `result()` from the second on, which gives the answer to the start before the last; `ready()`
    says whether it is there, for `result()` waits if it is not.

    All calls must come from the thread of the context. Programs, textures and buffers that were bound may be
    others afterwards: a window that draws with OpenGL of its own restores them, as it does after drawing.

    Parameters
    ----------
    context : moderngl.Context
        Of a window, or `gpu.context.compute_context()`; OpenGL 4.3 or later.
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
        request = CountingRequest(lowest_factor, knots=_KNOTS, references=_KNOTS, equal_ratios=False)
        self._display, self._lowest, self._form = display, lowest_factor, model.loss
        self.one_pass = GpuOnePass(context, shape, display, model, request)
        self._fences: list[Fence] = []

    def of(self, frame: FrameTexture | NDArray[Any], factor: float) -> MeasuredLoss:
        """Return the loss of a frame at factor b, as of `start`; waits for it."""
        self.one_pass.require_idle()
        self.start(frame, factor)
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
        self.one_pass.start(ready, np.array([asked, 0.0]), np.array([asked / 2, asked, 0.0]))
        self._fences.append(Fence())

    def count_only(self, seen: NDArray[np.bool_]) -> None:
        """Let only some pixels count from the next start on, as `OneFactorLoss.count_only`."""
        self.one_pass.count_only(seen)

    def ready(self) -> bool:
        """Return whether the answer for the oldest frame under way is there; never waits."""
        return bool(self._fences) and self._fences[0].passed()

    def result(self) -> MeasuredLoss:
        """Return what the oldest frame under way gave; waits if it is not ready."""
        bands, means = self.one_pass.result()
        self._fences.pop(0).release()
        dimmed = full = 0.0
        for band in bands:
            dimmed += band[0, 0]
            full += band[-1, 1]
        loss, mean = loss_of(min(dimmed, full), full, self._form), emitted_mean(means, self._display)
        return MeasuredLoss(loss, mean, means[:3])
