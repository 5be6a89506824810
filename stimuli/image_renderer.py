"""Draws an image, dimmed, into a window's back buffer: pixel by pixel, in the middle of a uniform ground.

Of an image larger than the window its middle is drawn.

numpy says, for each level that a pixel may have, which two codes make its dimmed luminance and in what mix
(`stimuli.dithering`), and the shader takes one of the two for each channel of each pixel. It works in whole
numbers only, so it draws exactly the codes of numpy's reference.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.stimuli.dithering import (
    DEEP_LEVELS,
    level_mixtures,
    levels_of,
    neighbouring_codes,
    thresholds_of,
)
from evenlight.stimuli.field_renderer import GL_DITHER, GL_FRAMEBUFFER_SRGB, NOISE, VERTEX_SHADER

if TYPE_CHECKING:
    import moderngl

TABLE_WIDTH = 256  # of the mixtures, which would be too long for one row

FRAGMENT_SHADER = (
    """
#version 330
uniform usampler2D image;       // levels of R, G, B
uniform usampler2D mixtures;    // for each level: lower code, share of the upper one in 2^-24
uniform usampler2D thresholds;  // in 2^-24, repeated over the window; without noise
uniform usampler2D coverage;    // of text over it all: 0 none, 255 all
uniform bool noisy;
uniform bool from_below;        // whether the image's first row is the lowest
uniform int height;             // of the window [pixels]
uniform ivec2 corner;           // of the image: from the left, from the top
uniform uvec2 ground;           // mixture around the image
uniform uvec2 ink;              // mixture of the text
uniform uint frame;
uniform uint seed;
uniform float highest_code;
out vec4 colour;
"""
    + NOISE
    + """
uint code(uvec2 mixture, uint threshold) {
    return mixture.x + (threshold < mixture.y ? 1u : 0u);
}

uint level_code(uint level, uint threshold) {
    return code(texelFetch(mixtures, ivec2(int(level & 255u), int(level >> 8u)), 0).rg, threshold);
}

uvec3 image_codes(ivec2 pixel, uint threshold) {
    ivec2 place = pixel - corner;
    ivec2 size = textureSize(image, 0);
    if (any(lessThan(place, ivec2(0))) || any(greaterThanEqual(place, size)))
        return uvec3(code(ground, threshold));
    if (from_below) place.y = size.y - 1 - place.y;
    uvec3 levels = texelFetch(image, place, 0).rgb;
    return uvec3(level_code(levels.r, threshold), level_code(levels.g, threshold),
                 level_code(levels.b, threshold));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    pixel.y = height - 1 - pixel.y;  // rows count from the top
    uint threshold = noisy ? hashed(uvec4(uvec2(pixel), frame, seed)) >> 8u
                           : texelFetch(thresholds, pixel % textureSize(thresholds, 0), 0).r;
    uvec3 codes = image_codes(pixel, threshold);
    uint covered = texelFetch(coverage, min(pixel, textureSize(coverage, 0) - 1), 0).r;
    if (covered > 0u) {
        // A pixel half covered is text in half of the frames: its mean is right in light.
        uint other = noisy ? hashed(uvec4(uvec2(pixel), frame, seed + 1u)) >> 8u : 8388608u;
        if (other < (covered * 16777216u + 127u) / 255u) codes = uvec3(code(ink, threshold));
    }
    colour = vec4(vec3(codes) / highest_code, 1.0);
}
"""
)


@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """An image in the graphics memory.

    Attributes
    ----------
    texture : moderngl.Texture
        Whole numbers, three or more channels.
    levels : int
        How many levels they are from 0 on: 256, 1024 or 65536.
    from_below : bool
        Whether its first row is the lowest one, as in textures that were drawn to.
    """

    texture: moderngl.Texture
    levels: int
    from_below: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class EyeImages:
    """An image for each eye of a headset."""

    left: Image
    right: Image


@dataclass(frozen=True, slots=True, eq=False)
class DimmedImage:
    """An image as it is shown.

    Attributes
    ----------
    image : Image or EyeImages
        The image; of a pair a screen shows the left one.
    factor : float
        Brightness factor b that its pixels are dimmed by, in (0, 1].
    ground : float
        L around the image, reflected light included [cd/m^2].
    ink : float
        L of text over it [cd/m^2].
    coverage : array of uint8, (height, width), or None
        How much of each pixel the text covers, row 0 on top; as large as the window.
    """

    image: Image | EyeImages
    factor: float
    ground: float
    ink: float = 0.0
    coverage: NDArray[np.uint8] | None = None

    def of_eyes(self) -> tuple[Image, Image]:
        """Return the image of the left eye and of the right one."""
        if isinstance(self.image, EyeImages):
            return self.image.left, self.image.right
        return self.image, self.image


class ImageUploads:
    """Puts images into the graphics memory of a context."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._uploaded: moderngl.Texture | None = None

    def image(self, pixel_values: NDArray[Any]) -> Image:
        """Return the image of pixel values L', (height, width, 3), of any kind of `Frame`; see `upload`."""
        return self.upload(*levels_of(pixel_values))

    def upload(self, levels: NDArray[Any], count: int) -> Image:
        """Return the image of an array of levels; it holds until the next one is uploaded.

        Parameters
        ----------
        levels : array of uint8 or uint16, (height, width, 3)
            Row 0 on top.
        count : int
            How many levels there are.
        """
        height, width, channels = levels.shape
        kind = "u1" if levels.dtype == np.uint8 else "u2"
        texture = self._uploaded
        if texture is None or (texture.size, texture.dtype) != ((width, height), kind):
            if texture is not None:
                texture.release()
            texture = self._context.texture((width, height), channels, alignment=1, dtype=kind)
            self._uploaded = texture
        texture.write(np.ascontiguousarray(levels), alignment=1)
        return Image(texture, count)


class ImageRenderer(ImageUploads):
    """Draws images with the codes of one display.

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
        super().__init__(context)
        self._display, self._bits = display, bits
        self._program = context.program(vertex_shader=VERTEX_SHADER, fragment_shader=FRAGMENT_SHADER)
        self._triangle = context.vertex_array(self._program, [])
        self._mixtures = context.texture((TABLE_WIDTH, DEEP_LEVELS // TABLE_WIDTH), 2, dtype="u4")
        self._mixed: tuple[int, float] | None = None  # what the mixtures are for
        self._blank = context.texture((1, 1), 1, bytes(1), alignment=1, dtype="u1")
        self._text = self._blank
        self._text_source: NDArray[np.uint8] | None = None
        matrix = thresholds_of(Dither.ORDERED if dither is Dither.NOISY_BIT else dither, (8, 8))
        self._thresholds = context.texture((8, 8), 1, matrix.tobytes(), dtype="u4")
        self._set(noisy=dither is Dither.NOISY_BIT, highest_code=float((1 << bits) - 1))
        self._set(image=0, mixtures=1, thresholds=2, coverage=3)

    def draw(
        self, framebuffer: moderngl.Framebuffer, picture: DimmedImage, frame: int = 0, seed: int = 0
    ) -> None:
        """Draw a picture over the whole framebuffer.

        Parameters
        ----------
        framebuffer : moderngl.Framebuffer
            Where to.
        picture : DimmedImage
            What.
        frame, seed : int
            Number of the frame, and seed of the dithering noise; both in [0, 2^32).
        """
        import moderngl

        image = picture.of_eyes()[0]
        corner = self._corner(framebuffer, image)
        self._take_mixtures(image.levels, picture.factor)
        self._take_text(picture.coverage)
        ink = picture.ground if picture.coverage is None else picture.ink
        self._set(ground=self._mixture(picture.ground), ink=self._mixture(ink))
        self._set(height=framebuffer.height, corner=corner, from_below=image.from_below)
        self._set(frame=frame, seed=seed)
        framebuffer.use()
        self._context.disable(moderngl.DEPTH_TEST | moderngl.BLEND | moderngl.CULL_FACE)
        for state in (GL_DITHER, GL_FRAMEBUFFER_SRGB):
            self._context.disable_direct(state)
        textures = (image.texture, self._mixtures, self._thresholds, self._text)
        for unit, texture in enumerate(textures):
            texture.use(unit)
        self._triangle.render(vertices=3)

    def _corner(self, framebuffer: moderngl.Framebuffer, image: Image) -> tuple[int, int]:
        """Return where the upper left corner of an image goes, from the left and from the top [pixels]."""
        (width, height), (whole, high) = image.texture.size, framebuffer.size
        return (whole - width) // 2, (high - height) // 2

    def _take_mixtures(self, levels: int, factor: float) -> None:
        """Write the table of mixtures, unless it is there already."""
        if self._mixed != (levels, factor):
            mixtures = level_mixtures(levels, factor, self._display, self._bits)
            viewport = (0, 0, TABLE_WIDTH, levels // TABLE_WIDTH)
            self._mixtures.write(np.ascontiguousarray(mixtures), viewport=viewport)
            self._mixed = levels, factor

    def _mixture(self, luminance: float) -> tuple[int, int]:
        """Return the lower code of a luminance, and the share of the upper one in 2^-24."""
        lower, share = neighbouring_codes(luminance, self._display, self._bits)
        return int(lower), int(share)

    def _take_text(self, coverage: NDArray[np.uint8] | None) -> None:
        """Make a text's texture the one that is drawn; the last one is kept, for it is drawn many times."""
        if coverage is self._text_source:
            return
        if self._text is not self._blank:
            self._text.release()
        self._text, self._text_source = self._blank, coverage
        if coverage is not None:
            size = coverage.shape[::-1]
            self._text = self._context.texture(size, 1, coverage.tobytes(), alignment=1, dtype="u1")

    def _set(self, **uniforms: object) -> None:
        """Set uniforms of the shader."""
        for name, value in uniforms.items():
            self._program[name].value = value  # type: ignore[union-attr] # they are uniforms, all of them
