"""Draws a field of some luminance, with or without text on it, into a window's back buffer.

Pages and ramps go the same way from luminance to code: numpy says, for each of the 256 steps of text
coverage, which two codes make its luminance and in what mix (`stimuli.dithering`), and the shader takes one
of the two for each pixel. It works in whole numbers only, so it draws exactly the codes of numpy's reference.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.stimuli.dithering import neighbouring_codes, thresholds_of
from evenlight.stimuli.shaders import over_all, set_uniforms, shader

if TYPE_CHECKING:
    import moderngl

COVERAGE_STEPS = 256  # of uint8
GL_DITHER, GL_FRAMEBUFFER_SRGB = 0x0BD0, 0x8DB9  # the driver's own, which would change the codes


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


class CodeRenderer:
    """What draws with the codes of one display, with or without text over it.

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

    SHADER: ClassVar[str]  # its name
    TEXT: ClassVar[str] = "u1"  # kind of the text's texture

    def __init__(self, context: moderngl.Context, display: Display, bits: int, dither: Dither) -> None:
        self._context, self._display, self._bits = context, display, bits
        self._triangle = over_all(context, shader(self.SHADER))
        self._text = self._blank = context.texture((1, 1), 1, bytes(1), alignment=1, dtype=self.TEXT)
        self._text_source: NDArray[np.uint8] | None = None
        matrix = thresholds_of(Dither.ORDERED if dither is Dither.NOISY_BIT else dither, (8, 8))
        self._thresholds = context.texture((8, 8), 1, matrix.tobytes(), dtype="u4")
        self._set(noisy=dither is Dither.NOISY_BIT, highest_code=float((1 << bits) - 1))

    def _take_text(self, coverage: NDArray[np.uint8] | None) -> None:
        if coverage is self._text_source:  # it is drawn many times
            return
        if self._text is not self._blank:
            self._text.release()
        self._text, self._text_source = self._blank, coverage
        if coverage is not None:
            size = coverage.shape[::-1]
            self._text = self._context.texture(size, 1, coverage.tobytes(), alignment=1, dtype=self.TEXT)

    def _begin(self, framebuffer: moderngl.Framebuffer) -> None:
        import moderngl

        framebuffer.use()
        self._context.disable(moderngl.DEPTH_TEST | moderngl.BLEND | moderngl.CULL_FACE)
        for state in (GL_DITHER, GL_FRAMEBUFFER_SRGB):
            self._context.disable_direct(state)

    def _render(self, *textures: moderngl.Texture) -> None:
        for unit, texture in enumerate(textures):
            texture.use(unit)
        self._triangle.render(vertices=3)

    def _set(self, **uniforms: object) -> None:
        set_uniforms(self._triangle, **uniforms)


class FieldRenderer(CodeRenderer):
    """Draws fields with the codes of one display; parameters as of `CodeRenderer`."""

    SHADER = "field"

    def __init__(self, context: moderngl.Context, display: Display, bits: int, dither: Dither) -> None:
        super().__init__(context, display, bits, dither)
        self._mixtures = context.texture((COVERAGE_STEPS, 1), 2, dtype="u4")
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
        mixtures = np.zeros((COVERAGE_STEPS, 2), dtype=np.uint32)
        lower, share = neighbouring_codes(field.luminances(), self._display, self._bits)
        mixtures[: len(lower), 0], mixtures[: len(lower), 1] = lower, share
        self._mixtures.write(mixtures.tobytes())
        self._take_text(field.coverage)
        self._set(height=framebuffer.height, frame=frame, seed=seed)
        self._begin(framebuffer)
        self._render(self._text, self._mixtures, self._thresholds)
