"""The mean luminance of the picture that was drawn last, before it is shown: the rate limit asks for it.

The means of its linear channels come with it, from which a power model reckons what an OLED panel takes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.method.luminance import LUMINANCE_WEIGHTS
from evenlight.stimuli.image_codes import GRID_LEVELS
from evenlight.stimuli.scenes import graphics_state
from evenlight.stimuli.scenes.graphics_scene import set_uniforms
from evenlight.stimuli.scenes.renderer import SceneRenderer
from evenlight.stimuli.scenes.shaders import WHOLE_VERTEX

if TYPE_CHECKING:
    import moderngl


BLOCK = 16  # columns and rows of pixels that are added up at one place

SUM_FRAGMENT = f"""
#version 330
uniform usampler2D codes;
uniform float gamma;
out vec4 total;
void main() {{
    ivec2 first = ivec2(gl_FragCoord.xy) * {BLOCK};
    ivec2 end = min(first + {BLOCK}, textureSize(codes, 0));
    total = vec4(0.0);
    for (int y = first.y; y < end.y; y++)
        for (int x = first.x; x < end.x; x++) {{
            vec3 encoded = vec3(texelFetch(codes, ivec2(x, y), 0).rgb) / {GRID_LEVELS - 1}.0;
            total.rgb += pow(encoded, vec3(gamma));
        }}
}}
"""


class PictureLuminance:
    """Adds up a renderer's codes where they are; what is read back is four numbers for 256 pixels.

    To read it is to wait until the picture is drawn, which the display must do as well.

    Parameters
    ----------
    context : moderngl.Context
        Of the window, and of the renderer.
    pictures : SceneRenderer
        Draws the pictures.
    display : Display
        What shows them.
    """

    def __init__(self, context: moderngl.Context, pictures: SceneRenderer, display: Display) -> None:
        self._context, self._pictures, self._display = context, pictures, display
        width, height = pictures.size
        blocks = -(-width // BLOCK), -(-height // BLOCK)
        with graphics_state.own(context):
            self._sums = context.framebuffer(context.texture(blocks, 4, dtype="f4"))
            program = context.program(vertex_shader=WHOLE_VERTEX, fragment_shader=SUM_FRAGMENT)
            self._adder = context.vertex_array(program, [])
            set_uniforms(self._adder, codes=0, gamma=display.gamma)
        self._means: Array = np.zeros(3)

    def mean(self) -> float:
        """Return Ī at factor 1 of the picture drawn last [cd/m^2]."""
        width, height = self._pictures.size
        with graphics_state.own(self._context):
            self._sums.use()
            self._pictures.codes.use(0)
            self._adder.render(vertices=3)
            sums = np.frombuffer(self._sums.read(components=4, dtype="f4"), np.float32).reshape(-1, 4)
        self._means = sums[:, :3].sum(axis=0, dtype=np.float64) / (width * height)
        share = float(self._means @ LUMINANCE_WEIGHTS)
        return self._display.black_level + (self._display.peak_luminance - self._display.black_level) * share

    def channel_means(self) -> Array:
        """Return the means of the linear R, G, B channels of the picture that `mean` saw last, (3,)."""
        return self._means
