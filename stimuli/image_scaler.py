"""Scales an image in the graphics memory: in linear light, between neighbouring pixels, about its middle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.dithering import DEEP_LEVELS, GRID_LEVELS
from evenlight.stimuli.image_renderer import Image
from evenlight.stimuli.scenes.engine import graphics
from evenlight.stimuli.shaders import over_all, set_uniforms, shader

if TYPE_CHECKING:
    import moderngl


class ImageScaler:
    """Scales images, and cuts out their middle.

    Parameters
    ----------
    context : moderngl.Context
        The window's.
    gamma : float
        Exponent from pixel values to light.
    room : (int, int)
        Width and height of what the results are shown in [pixels].
    """

    def __init__(self, context: moderngl.Context, gamma: float, room: tuple[int, int]) -> None:
        self._context, self.room = context, room
        self._triangle = over_all(context, shader("scaled_image"))
        set_uniforms(self._triangle, image=0, gamma=gamma)
        self._target: moderngl.Framebuffer | None = None
        self._scaled: Image | None = None

    def scaled(self, image: Image, scale: float, size: tuple[int, int]) -> Image:
        """Return the middle of a scaled image; it holds until the next one is scaled.

        Parameters
        ----------
        image : Image
            The image, its first row on top.
        scale : float
            Pixels of the result per pixel of the image, each way.
        size : (int, int)
            Width and height of the result [pixels].
        """
        levels = GRID_LEVELS if image.levels <= GRID_LEVELS else DEEP_LEVELS
        if self._target is None or self._target.size != size:
            if self._target is not None:
                self._target.color_attachments[0].release()
                self._target.release()
            self._target = self._context.framebuffer(self._context.texture(size, 4, dtype="u2"))
        set_uniforms(self._triangle, size=size, scale=scale, highest=(image.levels - 1, levels - 1))
        with graphics.own(self._context):
            self._target.use()
            image.texture.use(0)
            self._triangle.render(vertices=3)
        texture: Any = self._target.color_attachments[0]
        self._scaled = Image(texture, levels)
        return self._scaled

    def levels(self) -> tuple[NDArray[np.uint16], int]:
        """Return the levels of the image scaled last, (height, width, 3), row 0 on top, and their number."""
        assert self._scaled is not None
        width, height = self._scaled.texture.size
        levels = np.frombuffer(self._scaled.texture.read(), np.uint16).reshape(height, width, 4)
        return levels[..., :3], self._scaled.levels
