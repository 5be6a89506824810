"""Draws fields and images, with or without text on them, into the pictures of a headset's two eyes.

Luminances become codes as in `stimuli.dithering`, but the shader computes in floats what numpy says there:
what an eye sees at a pixel is a mixture of points of a picture, so there are no levels to make a table of. A
level is made linear, dimmed, mixed with text in light, and drawn with the code below or above it, the share
of the upper one being linear in light. Between two frames only uniforms change.

The noise of the dithering is that of the whole framebuffer's pixels, in which the views lie side by side, and
so another one for each eye: the same for both would be seen as a surface of grain that moves with the head.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.hardware.presentation.headset_views import EyePose
from evenlight.stimuli.dithering import neighbouring_codes
from evenlight.stimuli.eyes.surfaces import FlatScreen, Sphere, Surface, panel_matrix
from evenlight.stimuli.field_renderer import CodeRenderer, Field
from evenlight.stimuli.image_renderer import DimmedImage, EyeImages, ImageUploads
from evenlight.stimuli.scenes.engine.scene import Floats

if TYPE_CHECKING:
    import moderngl

    from evenlight.hardware.protocols import Window

PIXEL_BY_PIXEL, PLANE, SPHERE = range(1, 4)  # how the places in an image are found; 0 where there is none


class EyeRenderer(CodeRenderer):
    """Draws text over a ground, or over images, in the views of both eyes with the codes of one display.

    Parameters
    ----------
    window : Window
        The headset's.
    display : Display
        What is drawn on.
    dither : Dither
        How luminances between two codes are drawn.
    """

    SHADER = "eyes"
    TEXT = "f1"

    def __init__(self, window: Window, display: Display, dither: Dither) -> None:
        super().__init__(window.context(), display, window.bits(), dither)
        self._window = window
        self._no_image = self._context.texture((1, 1), 4, bytes(4), dtype="u1")
        self._set(gamma=display.gamma, coverage=0, image=1, thresholds=2)

    def _draw(self, framebuffer: moderngl.Framebuffer, field: Field) -> None:
        views = self._window.eyes()
        if views is None:
            raise ValueError("eyes are drawn in a headset's window, got another one")
        self._take_text(field.coverage)
        ground = self._relative(field.luminance)
        ink = ground if field.coverage is None else self._relative(field.ink)
        self._set(ground=ground, ink=ink, written=field.coverage is not None)
        self._begin(framebuffer)
        for index, eye in enumerate(views.eyes):
            left, _, width, height = framebuffer.viewport = eye.part
            panel = panel_matrix(eye, (width, height), views.head, self._text.size)
            self._set(left_edge=left, height=height, panel=panel)
            self._render(self._text, self._taken(index, eye), self._thresholds)
        framebuffer.viewport = (0, 0, framebuffer.width, framebuffer.height)

    def _taken(self, index: int, eye: EyePose) -> moderngl.Texture:
        """Set what is seen of an image in a view of some number, and return the texture."""
        return self._no_image

    def _relative(self, luminance: float) -> float:
        """Return a luminance [cd/m^2] as a share of the range of the display: 0 its black, 1 its white.

        Raises
        ------
        ValueError
            If the display does not reach it.
        """
        display = self._display
        neighbouring_codes(luminance, display, self._bits)
        emitted = luminance - display.reflected_luminance - display.black_level
        return emitted / (display.peak_luminance - display.black_level)

    def _take_text(self, coverage: NDArray[np.uint8] | None) -> None:
        import moderngl

        if coverage is self._text_source:
            return
        super()._take_text(coverage)
        if coverage is not None:
            self._text.repeat_x = self._text.repeat_y = False
            self._text.build_mipmaps()  # the panel may have more pixels than the eye's picture
            self._text.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)


class EyeFieldRenderer(EyeRenderer):
    """Draws fields over the whole view of both eyes; text is on a panel that moves with the head."""

    def draw(self, framebuffer: moderngl.Framebuffer, field: Field, frame: int = 0, seed: int = 0) -> None:
        """Draw a field for both eyes, as `FieldRenderer.draw` does for a screen."""
        self._set(frame=frame, seed=seed)
        self._draw(framebuffer, field)


class EyeImageRenderer(EyeRenderer, ImageUploads):
    """Draws images for both eyes: a pair pixel by pixel in their middles, a single one on a surface.

    Parameters
    ----------
    window, display, dither : Window, Display, Dither
        As of `EyeRenderer`.
    surface : FlatScreen or Sphere, optional
        What a single image lies on.
    """

    def __init__(
        self, window: Window, display: Display, dither: Dither, surface: Surface | None = None
    ) -> None:
        ImageUploads.__init__(self, window.context())
        EyeRenderer.__init__(self, window, display, dither)
        self._surface: Surface = surface or FlatScreen()
        if isinstance(surface, Sphere):
            self._set(span=math.radians(surface.span))

    def draw(
        self, framebuffer: moderngl.Framebuffer, picture: DimmedImage, frame: int = 0, seed: int = 0
    ) -> None:
        """Draw a picture for both eyes, as `ImageRenderer.draw` does for a screen."""
        black, white = self._display.black_level, self._display.peak_luminance
        lift = (1 - picture.factor) * black / (white - black)
        self._set(frame=frame, seed=seed, factor=picture.factor, lift=lift)
        self._picture = picture
        self._draw(framebuffer, Field(picture.ground, picture.ink, picture.coverage))

    def _taken(self, index: int, eye: EyePose) -> moderngl.Texture:
        picture, surface, size = self._picture, self._surface, eye.part[2:]
        image = picture.of_view(index)
        part, first = image.texture.size, (0, 0)
        if isinstance(picture.image, EyeImages):
            mapping, matrix = PIXEL_BY_PIXEL, centred(part, size)
        else:
            if surface.side_by_side:
                part = part[0] // 2, part[1]
                first = index % 2 * part[0], 0  # the focus views follow, left and right again
            mapping = SPHERE if isinstance(surface, Sphere) else PLANE
            matrix = surface.matrix(eye, size, part)
        self._set(mapping=mapping, surface=matrix, first=first, part=part)
        self._set(highest_level=float(image.levels - 1), from_below=image.from_below)
        return image.texture


def centred(part: tuple[int, int], size: tuple[int, int]) -> Floats:
    """Return the matrix from pixels of an eye's picture to those of an image in its middle.

    >>> (centred((61, 38), (97, 63)) @ (18.5, 12.5, 1.0)).tolist()
    [0.5, 0.5, 1.0]
    """
    left, top = (size[0] - part[0]) // 2, (size[1] - part[1]) // 2
    return np.array([[1.0, 0.0, -left], [0.0, 1.0, -top], [0.0, 0.0, 1.0]])
