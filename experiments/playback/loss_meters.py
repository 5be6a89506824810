"""What measures the contrast loss of the picture that a window shows, while it shows it."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.experiments.playback.picture_luminance import PictureLuminance
from evenlight.method.choices import Device
from evenlight.stimuli.scenes.engine import graphics
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer

if TYPE_CHECKING:
    import moderngl
    from numpy.typing import NDArray

    from evenlight.method.contrast.one_factor import OneFactorLoss
    from evenlight.method.gpu.frame_loss import GpuLoss

CODES = 1024  # levels of the renderer's codes
ONE_STRIP_IN = 4  # strips of rows that the processor counts, others each time (bench online: the error)


class LossMeter:
    """Measures the picture that was drawn last; its loss is waited for by nothing.

    Parameters
    ----------
    pictures, light, patient
        As of `open_meter`.

    Attributes
    ----------
    name : str
        What measures: "cpu", or "gpu" and the renderer's name.
    """

    def __init__(self, name: str, pictures: SceneRenderer, light: PictureLuminance, *, patient: bool) -> None:
        self.name, self._pictures, self._light, self._patient = name, pictures, light, patient
        self._counted: NDArray[np.bool_] | None = None

    def mean_luminance(self) -> float:
        """Return its Ī at factor 1 [cd/m^2], before it is shown."""
        return self._light.mean()

    def channel_means(self) -> Array:
        """Return the means of the linear R, G, B channels of the picture whose Ī was asked for last, (3,)."""
        return self._light.channel_means()

    def begin(self, factor: float) -> bool:
        """Begin to measure at a factor; return False, and do nothing, while another is under way."""
        raise NotImplementedError  # each kind has its own

    def result(self) -> float | None:
        """Return 𝓛_c of the one under way at its factor, in [0, 1], or None as long as it is not known."""
        raise NotImplementedError  # each kind has its own

    def close(self) -> None:
        """Let go of what it holds; textures and buffers go with the window."""

    def _count_seen(self, loss: OneFactorLoss | GpuLoss) -> None:
        """Let only pixels count that a headset's lens shows, where that is known, and when it changes."""
        seen = self._pictures.seen
        if seen is not self._counted:
            self._counted = seen
            loss.count_only(np.ones(self._pictures.size[::-1], dtype=bool) if seen is None else seen)


def open_meter(
    context: moderngl.Context,
    pictures: SceneRenderer,
    display: Display,
    *,
    lowest_factor: float,
    device: Device,
    patient: bool,
    light: PictureLuminance | None = None,
) -> LossMeter:
    """Return a meter of the pictures of a renderer.

    Parameters
    ----------
    context : moderngl.Context
        Of the window, and of the renderer.
    pictures : SceneRenderer
        Draws the pictures.
    display : Display
        What shows them.
    lowest_factor : float
        That will be asked for.
    device : Device
        What measures. By itself it takes a graphics processor with compute shaders that is no program.
    patient : bool
        Whether results are waited for: where time is simulated, the same must come out every time.
    light : PictureLuminance, optional
        Of these pictures, if not what waits for each.

    Raises
    ------
    InputError
        If the graphics processor is asked for, and has no compute shaders.
    """
    light = light or PictureLuminance(context, pictures, display)
    if _on_gpu(context, device):
        from evenlight.method.gpu.frame_loss import GpuLoss

        width, height = pictures.size
        with graphics.own(context):
            loss = GpuLoss(context, (height, width), display, lowest_factor=lowest_factor)
        return GpuMeter(context, pictures, loss, light, patient=patient)
    return ProcessorMeter(pictures, display, lowest_factor, light, patient=patient)


def _on_gpu(context: moderngl.Context, device: Device) -> bool:
    if device is Device.CPU:
        return False
    from evenlight.method.gpu.context import is_software, renderer_name, require_compute

    try:
        require_compute(context)
    except InputError:
        if device is Device.GPU:
            raise
        return False
    return device is Device.GPU or not is_software(renderer_name(context))


class ProcessorMeter(LossMeter):
    """Measures on the processor, in a thread beside the one that draws.

    Of the fine bands of large pictures every fourth strip of rows counts, each time others, so that over four
    times all do.

    Parameters
    ----------
    pictures, display, lowest_factor, light, patient
        As of `open_meter`.
    """

    def __init__(
        self,
        pictures: SceneRenderer,
        display: Display,
        lowest_factor: float,
        light: PictureLuminance,
        *,
        patient: bool,
    ) -> None:
        from evenlight.method.contrast.one_factor import OneFactorLoss

        super().__init__("cpu", pictures, light, patient=patient)
        width, height = pictures.size
        self._turn = 0
        self._loss = OneFactorLoss(
            (height, width), display, lowest_factor=lowest_factor, one_strip_in=ONE_STRIP_IN
        )
        self._thread = ThreadPoolExecutor(1, "contrast loss")
        self._under_way: Future[float] | None = None

    def begin(self, factor: float) -> bool:
        """Read the picture back, and hand it to the thread."""
        if self._under_way is not None:
            return False
        self._count_seen(self._loss)
        pixels, turn = self._pictures.pixel_values(), self._turn
        self._under_way = self._thread.submit(lambda: self._loss.of(pixels, factor, turn).loss)
        self._turn += 1
        return True

    def result(self) -> float | None:
        """Return what the thread found, if it is done."""
        waiting = self._under_way
        if waiting is None or not (self._patient or waiting.done()):
            return None
        self._under_way = None
        return waiting.result()

    def close(self) -> None:
        """End the thread."""
        self._thread.shutdown(cancel_futures=True)


class GpuMeter(LossMeter):
    """Measures by compute shaders in the window's context, from the texture that is shown.

    Parameters
    ----------
    context, pictures, light, patient
        As of `open_meter`.
    loss : GpuLoss
        For pictures of that size.
    """

    def __init__(
        self,
        context: moderngl.Context,
        pictures: SceneRenderer,
        loss: GpuLoss,
        light: PictureLuminance,
        *,
        patient: bool,
    ) -> None:
        from evenlight.method.gpu.context import renderer_name

        super().__init__(f"gpu: {renderer_name(context)}", pictures, light, patient=patient)
        self._context, self._loss, self._under_way = context, loss, False

    def begin(self, factor: float) -> bool:
        """Begin with the texture of codes."""
        from evenlight.method.gpu.pyramid import FrameTexture

        if self._under_way:
            return False
        frame = FrameTexture(self._pictures.codes, CODES, from_below=True)
        with graphics.own(self._context):
            self._count_seen(self._loss)
            self._loss.start(frame, factor)
        self._under_way = True
        return True

    def result(self) -> float | None:
        """Return the answer, if the graphics processor has come to it."""
        if not self._under_way or not (self._patient or self._loss.ready()):
            return None
        self._under_way = False
        with graphics.own(self._context):
            return self._loss.result().loss
