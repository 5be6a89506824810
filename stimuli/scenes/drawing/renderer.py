"""Draws a scene in linear light, and encodes the picture for a display."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.camera import Camera
from evenlight.stimuli.scenes.drawing import graphics_state, shaders
from evenlight.stimuli.scenes.drawing.graphics_scene import GraphicsScene, set_uniforms
from evenlight.stimuli.scenes.drawing.shaders import KNEE, PEAK
from evenlight.stimuli.scenes.scene import Quality, Scene
from evenlight.stimuli.sequence_format import ENCODING_GAMMA, codes_on_grid

if TYPE_CHECKING:
    import moderngl

EDGE_CONTRAST = 0.12  # share of the brighter root of luminance: an edge to be smoothed
DEPTH_TEST = 2  # of moderngl, which is imported by those who make a context


class SceneRenderer:
    """Draws one scene into pictures of one size.

    Nothing is kept of the graphics state that it finds, and what it changes for drawing is switched off
    again afterwards, so that it shares a window's context with others.

    Parameters
    ----------
    context : moderngl.Context
        Of a window, or `offscreen_context()`.
    scene : Scene
        What is drawn.
    size : (int, int)
        Width and height of the pictures [pixels].
    quality : Quality or None
        Of its light: how long the first renderer of a scene takes; later ones find it in the cache.
    """

    def __init__(
        self,
        context: moderngl.Context,
        scene: Scene,
        size: tuple[int, int],
        quality: Quality | None = Quality.FINE,
    ) -> None:
        self._context, self.size = context, size
        self._graphics = GraphicsScene(context, scene, quality)
        self._raw = context.texture(size, 4, dtype="f2")
        self._raw.repeat_x = self._raw.repeat_y = False
        self._drawn = context.framebuffer(self._raw, context.depth_renderbuffer(size))
        self.texture = context.texture(size, 4, dtype="f2")
        self._smoothed = context.framebuffer(self.texture)
        self.codes = context.texture(size, 4, dtype="u2")
        self._encoded = context.framebuffer(self.codes)
        for texture in (self.texture, self.codes):
            texture.filter = graphics_state.NEAREST, graphics_state.NEAREST
        self._edges = self._pass(shaders.EDGES_FRAGMENT, drawn=0, contrast=EDGE_CONTRAST)
        self._encoder = self._pass(
            shaders.ENCODE_FRAGMENT, light=0, peak=PEAK, knee=KNEE, gamma=ENCODING_GAMMA
        )

    def render(self, camera: Camera) -> None:
        """Draw the scene's linear RGB luminance [cd/m^2] into `texture`."""
        with graphics_state.own(self._context):
            self._drawn.use()
            self._drawn.clear()
            self._graphics.draw(camera, self.size)
            self._context.disable(DEPTH_TEST)
            self._smoothed.use()
            self._raw.use(0)
            self._edges.render(vertices=3)

    def luminance(self) -> NDArray[np.float32]:
        """Return what `texture` holds, (height, width, 3), row 0 on top [cd/m^2]."""
        width, height = self.size
        data = np.frombuffer(self._smoothed.read(components=4, dtype="f2"), dtype=np.float16)
        return data.reshape(height, width, 4)[::-1, :, :3].astype(np.float32)

    def encode(self) -> None:
        """Draw the codes for what `texture` holds, 0 to 1023 for a display of gamma 2.2, into `codes`."""
        with graphics_state.own(self._context):
            self._encoded.use()
            self.texture.use(0)
            self._encoder.render(vertices=3)

    def pixel_values(self) -> NDArray[np.uint16]:
        """Return what `codes` holds, over the 16-bit range, (height, width, 3), row 0 on top."""
        width, height = self.size
        data = np.frombuffer(self.codes.read(), dtype=np.uint16).reshape(height, width, 4)
        return codes_on_grid(data[::-1, :, :3])

    def _pass(self, fragment: str, **uniforms: float) -> moderngl.VertexArray:
        """Return a triangle over the whole picture with a program."""
        program = self._context.program(vertex_shader=shaders.WHOLE_VERTEX, fragment_shader=fragment)
        whole = self._context.vertex_array(program, [])
        set_uniforms(whole, **uniforms)
        return whole
