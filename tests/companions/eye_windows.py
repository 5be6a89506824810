"""A window of a headset without one, and what is drawn into it: for tests of the eyes' renderers."""

from collections.abc import Callable

import moderngl
import numpy as np
from numpy.typing import NDArray
from turned_heads import WIDE

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.hardware.presentation.headset_views import EyeFov, EyePose, HeadsetFrame, Pose
from evenlight.stimuli.eyes.eye_renderer import EyeFieldRenderer, EyeImageRenderer
from evenlight.stimuli.eyes.surfaces import Surface
from evenlight.stimuli.field_renderer import Field
from evenlight.stimuli.image_renderer import DimmedImage, EyeImages, Image

SIDE = 101  # of an eye's picture, odd, so that a pixel looks straight ahead [pixels]
MIDDLE = SIDE // 2
PARTS = (0, 0, SIDE, SIDE), (SIDE, 0, SIDE, SIDE)
FRAME, SEED = 7, 2**32 - 2
# A code is a luminance.
LINEAR = Display("linear", 255.0, 0.0, 1.0, pixels_per_degree=20.0)


class Headset:
    """A headset's window whose eyes look where a test says."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self.frame: HeadsetFrame | None = None
        self.look()

    def look(
        self,
        orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0),
        apart: float = 0.0,
        fov: EyeFov = WIDE,
    ) -> None:
        """Turn the head, which stays where it is; the eyes are some metres apart before it turns."""
        eyes = [
            EyePose(Pose((side * apart / 2, 0.0, 0.0), orientation), fov, part)
            for side, part in zip((-1, 1), PARTS, strict=True)
        ]
        head = Pose((0.0, 0.0, 0.0), orientation)
        self.frame = HeadsetFrame(0.0, 1 / 90, tuple(eyes), head, True, True)

    def eyes(self) -> HeadsetFrame | None:
        return self.frame

    def context(self) -> moderngl.Context:
        return self._context

    def bits(self) -> int:
        return 8


def target(context: moderngl.Context) -> moderngl.Framebuffer:
    """Return the framebuffer of both eyes."""
    return context.framebuffer([context.renderbuffer((2 * SIDE, SIDE), 4)])


def codes_of(framebuffer: moderngl.Framebuffer) -> NDArray[np.int64]:
    """Return the codes drawn for both eyes, row 0 on top."""
    read = np.frombuffer(framebuffer.read(components=3, alignment=1), np.uint8)
    return read.reshape(SIDE, 2 * SIDE, 3)[::-1].astype(int)


def drawn_field(
    headset: Headset, field: Field, display: Display, dither: Dither, seed: int = SEED
) -> NDArray[np.int64]:
    framebuffer = target(headset.context())
    EyeFieldRenderer(headset, display, dither).draw(framebuffer, field, frame=FRAME, seed=seed)
    return codes_of(framebuffer)


def drawn_image(
    headset: Headset,
    picture: Callable[[EyeImageRenderer], DimmedImage],
    display: Display,
    dither: Dither,
    surface: Surface | None = None,
) -> NDArray[np.int64]:
    framebuffer = target(headset.context())
    renderer = EyeImageRenderer(headset, display, dither, surface)
    renderer.draw(framebuffer, picture(renderer), frame=FRAME, seed=SEED)
    return codes_of(framebuffer)


def eye_images(
    context: moderngl.Context, left: NDArray[np.int64], right: NDArray[np.int64], levels: int
) -> EyeImages:
    """Return two arrays of levels, row 0 on top, as a pair in the graphics memory."""

    def uploaded(rows: NDArray[np.int64]) -> Image:
        kind = "u1" if rows.dtype == np.uint8 else "u2"
        size = rows.shape[1], rows.shape[0]
        return Image(context.texture(size, 3, rows.tobytes(), alignment=1, dtype=kind), levels)

    return EyeImages([uploaded(left), uploaded(right)])
