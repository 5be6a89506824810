"""Draws a field of some luminance, with or without text on it, into a window's back buffer.

Pages and ramps go the same way from luminance to code: numpy says, for each of the 256 steps of text
coverage, which two codes make its luminance and in what mix (`stimuli.dithering`), and the shader takes one
of the two for each pixel. It works in whole numbers only, so it draws exactly the codes of numpy's reference.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.stimuli.dithering import neighbouring_codes, thresholds_of

if TYPE_CHECKING:
    import moderngl

COVERAGE_STEPS = 256  # of uint8
GL_DITHER, GL_FRAMEBUFFER_SRGB = 0x0BD0, 0x8DB9  # the driver's own, which would change the codes

# One triangle that covers the whole window.
VERTEX_SHADER = """
#version 330
void main() {
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(2.0 * corner - 1.0, 0.0, 1.0);
}
"""

# The noise is `stimuli.dithering.hashed`: pcg4d of Jarzynski & Olano (2020), in arithmetic modulo 2^32.
NOISE = """
uvec4 mixed(uvec4 v) {
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

uint hashed(uvec4 v) {
    v = mixed(v * 1664525u + 1013904223u);
    return mixed(v ^ (v >> 16u)).w;
}
"""

FRAGMENT_SHADER = (
    """
#version 330
uniform usampler2D coverage;    // of text: 0 none, 255 all
uniform usampler2D mixtures;    // for each coverage: lower code, share of the upper one in 2^-24
uniform usampler2D thresholds;  // in 2^-24, repeated over the window; without noise
uniform bool noisy;
uniform int height;             // of the window [pixels]
uniform uint frame;
uniform uint seed;
uniform float highest_code;
out vec4 colour;
"""
    + NOISE
    + """
void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    pixel.y = height - 1 - pixel.y;  // rows count from the top
    uint covered = texelFetch(coverage, min(pixel, textureSize(coverage, 0) - 1), 0).r;
    uvec2 mixture = texelFetch(mixtures, ivec2(int(covered), 0), 0).rg;
    uint threshold = noisy ? hashed(uvec4(uvec2(pixel), frame, seed)) >> 8u
                           : texelFetch(thresholds, pixel % textureSize(thresholds, 0), 0).r;
    uint code = mixture.x + (threshold < mixture.y ? 1u : 0u);
    colour = vec4(vec3(float(code) / highest_code), 1.0);
}
"""
)


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A uniform field, with text on it or without.

    Attributes
    ----------
    luminance : float
        L of the ground, reflected light included [cd/m^2].
    ink : float
        L of the text [cd/m^2].
    coverage : array of uint8, (height, width), or None
        How much of each pixel the text covers, row 0 on top; as large as the window.
    """

    luminance: float
    ink: float = 0.0
    coverage: NDArray[np.uint8] | None = None

    def luminances(self) -> NDArray[np.float64]:
        """Return L for each step of coverage, mixed in light [cd/m^2]; of the ground alone without text.

        >>> Field(100.0, 49.0, np.zeros((1, 1), np.uint8)).luminances()[[0, 5, 255]].tolist()
        [100.0, 99.0, 49.0]
        """
        steps = COVERAGE_STEPS if self.coverage is not None else 1
        share = np.arange(steps) / (COVERAGE_STEPS - 1)
        return np.asarray(self.luminance + share * (self.ink - self.luminance))


class FieldRenderer:
    """Draws fields with the codes of one display.

    Parameters
    ----------
    context : moderngl.Context
        The window's.
    display : Display
        What is drawn on.
    bits : int
        Bits of its codes.
    dither : Dither
        How luminances between two codes are drawn.
    """

    def __init__(self, context: moderngl.Context, display: Display, bits: int, dither: Dither) -> None:
        self._context, self._display, self._bits = context, display, bits
        self._program = context.program(vertex_shader=VERTEX_SHADER, fragment_shader=FRAGMENT_SHADER)
        self._triangle = context.vertex_array(self._program, [])
        self._mixtures = context.texture((COVERAGE_STEPS, 1), 2, dtype="u4")
        self._blank = context.texture((1, 1), 1, bytes(1), alignment=1, dtype="u1")
        self._text = self._blank
        self._text_source: NDArray[np.uint8] | None = None
        matrix = thresholds_of(Dither.ORDERED if dither is Dither.NOISY_BIT else dither, (8, 8))
        self._thresholds = context.texture((8, 8), 1, matrix.tobytes(), dtype="u4")
        self._set(noisy=dither is Dither.NOISY_BIT, highest_code=float((1 << bits) - 1))
        self._set(coverage=0, mixtures=1, thresholds=2)

    def draw(self, framebuffer: moderngl.Framebuffer, field: Field, frame: int = 0, seed: int = 0) -> None:
        """Draw a field over the whole framebuffer.

        Parameters
        ----------
        framebuffer : moderngl.Framebuffer
            Where to.
        field : Field
            What.
        frame, seed : int
            Number of the frame, and seed of the dithering noise; both in [0, 2^32).
        """
        import moderngl

        mixtures = np.zeros((COVERAGE_STEPS, 2), dtype=np.uint32)
        lower, share = neighbouring_codes(field.luminances(), self._display, self._bits)
        mixtures[: len(lower), 0], mixtures[: len(lower), 1] = lower, share
        self._mixtures.write(mixtures.tobytes())
        self._take_text(field.coverage)
        self._set(height=framebuffer.height, frame=frame, seed=seed)
        framebuffer.use()
        self._context.disable(moderngl.DEPTH_TEST | moderngl.BLEND | moderngl.CULL_FACE)
        for state in (GL_DITHER, GL_FRAMEBUFFER_SRGB):
            self._context.disable_direct(state)
        for unit, texture in enumerate((self._text, self._mixtures, self._thresholds)):
            texture.use(unit)
        self._triangle.render(vertices=3)

    def _take_text(self, coverage: NDArray[np.uint8] | None) -> None:
        """Make a text's texture the one that is drawn; the last one is kept, for it is drawn many times."""
        if coverage is None:
            self._text, self._text_source = self._blank, None
        elif coverage is not self._text_source:
            if self._text is not self._blank:
                self._text.release()
            height, width = coverage.shape
            self._text = self._context.texture(
                (width, height), 1, coverage.tobytes(), alignment=1, dtype="u1"
            )
            self._text_source = coverage

    def _set(self, **uniforms: float) -> None:
        """Set uniforms of the shader."""
        for name, value in uniforms.items():
            self._program[name].value = value  # type: ignore[union-attr] # they are uniforms, all of them
