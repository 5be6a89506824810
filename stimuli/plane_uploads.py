"""Puts pictures of Y, Cb, Cr into the graphics memory as they are, where they become R, G, B.

That is half the bytes of R, G, B, which a driver takes after it has added a fourth channel; the codes are
those of FFmpeg (docs/decisions/one-pass-curves.md). Each plane goes through two buffers in turn: the graphics
card copies out of one while the next picture is put into the other, and the thread that draws waits for
neither. That is for planes, of one byte a pixel; what a driver has to convert it would convert there itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evenlight.data_schema.frame import LumaChroma
from evenlight.method.contrast.frame_light import matrix_of
from evenlight.stimuli.scenes.engine import graphics
from evenlight.stimuli.shaders import over_all, set_uniforms, shader

if TYPE_CHECKING:
    import moderngl


class PlaneUploads:
    """Uploads planes to a context, and converts them there."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context, self._triangle = context, over_all(context, shader("planes"))
        set_uniforms(self._triangle, luma=0, blue=1, red=2)
        self._textures: list[moderngl.Texture] = []  # of Y, Cb and Cr, and of R, G, B
        self._buffers: list[moderngl.Buffer] = []  # for Y, Cb and Cr of this picture, then of the next one
        self._target: moderngl.Framebuffer | None = None

    def rgb(self, picture: LumaChroma) -> moderngl.Texture:
        """Return a texture of R, G, B of uint8, its first row on top; it holds until the next one is made."""
        sizes = [plane.shape[::-1] for plane in picture.planes]
        if self._target is None or [texture.size for texture in self._textures[:3]] != sizes:
            if self._target is not None:
                self._target.release()
            for old in self._textures:
                old.release()
            for buffer in self._buffers:
                buffer.release()
            self._textures = [
                self._context.texture((width, height), channels, alignment=1, dtype="u1")
                for (width, height), channels in zip((*sizes, sizes[0]), (1, 1, 1, 4), strict=True)
            ]
            self._target = self._context.framebuffer([self._textures[3]])
            self._buffers = [
                self._context.buffer(reserve=plane.nbytes, dynamic=True) for plane in 2 * picture.planes
            ]
        self._buffers = self._buffers[3:] + self._buffers[:3]
        black, gain, *gains = matrix_of(picture)
        set_uniforms(self._triangle, amid=picture.amid, black=black, gain=gain, gains=gains)
        with graphics.own(self._context):
            for place, plane in enumerate(picture.planes):
                self._buffers[place].write(np.ascontiguousarray(plane))
                self._textures[place].write(self._buffers[place], alignment=1)
                self._textures[place].use(place)
            self._target.use()
            self._triangle.render(vertices=3)
        return self._textures[3]
