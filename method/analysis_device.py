"""Which device analyses frames, and what is said where the graphics processor does not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.method.choices import Device
from evenlight.method.frame_analysis import FrameAnalysis, FrameLoss
from evenlight.method.gpu_context import is_software


class FrameAnalyzer(Protocol):
    """Gives the contrast loss of frames of one size."""

    def of(self, pixel_values: NDArray[Any]) -> FrameLoss:
        """Return the loss curve and the means of a frame, (height, width, 3) gamma-encoded."""


@dataclass(frozen=True, slots=True)
class ChosenAnalysis:
    """An analysis, and where it runs.

    Attributes
    ----------
    analysis : FrameAnalyzer
        The analysis.
    device : Device
        CPU or GPU.
    reason : str
        Why, in words for the user; the renderer's name if it is the graphics processor.
    """

    analysis: FrameAnalyzer
    device: Device
    reason: str

    @property
    def name(self) -> str:
        """What computes: "cpu", or "gpu" and the renderer's name."""
        return f"gpu: {self.reason}" if self.device is Device.GPU else "cpu"


def make_frame_analysis(
    shape: tuple[int, int],
    display: Display,
    model: ContrastModel,
    factors: Array,
    device: Device = Device.CPU,
) -> ChosenAnalysis:
    """Return the analysis of frames of one size on a device.

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
    device : Device
        Where.

    Raises
    ------
    InputError
        If the graphics processor is asked for, and there is none that can.
    """
    if device is Device.CPU:
        return ChosenAnalysis(FrameAnalysis(shape, display, model, factors), Device.CPU, "as asked")
    from evenlight.method.gpu_frame_analysis import GpuFrameAnalysis

    try:
        on_gpu = GpuFrameAnalysis(shape, display, model, factors)
    except InputError as error:
        if device is Device.GPU:
            raise
        return ChosenAnalysis(FrameAnalysis(shape, display, model, factors), Device.CPU, str(error))
    if device is Device.AUTO and is_software(on_gpu.renderer):
        reason = f"OpenGL runs on the processor here ({on_gpu.renderer}), which is faster without"
        return ChosenAnalysis(FrameAnalysis(shape, display, model, factors), Device.CPU, reason)
    return ChosenAnalysis(on_gpu, Device.GPU, on_gpu.renderer)
