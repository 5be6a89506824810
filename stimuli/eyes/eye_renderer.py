"""Draws fields and images, with or without text on them, into the pictures of a headset's two eyes.

Luminances become codes as in `stimuli.dithering`, but the shader computes in floats what numpy says there:
what an eye sees at a pixel is a mixture of points of a picture, so there are no levels to make a table of. A
level is made linear, dimmed, mixed with text in light, and drawn with the code below or above it, the share
of the upper one being linear in light. Between two frames only uniforms change.

The noise of the dithering is that of the whole framebuffer's pixels, in which the eyes lie side by side, and
so another one for each eye: the same for both would be seen as a surface of grain that moves with the head.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.hardware.presentation.headset_link import EyePose
from evenlight.stimuli.dithering import neighbouring_codes, thresholds_of
from evenlight.stimuli.eyes.surfaces import FlatScreen, Sphere, Surface, panel_matrix
from evenlight.stimuli.field_renderer import GL_DITHER, GL_FRAMEBUFFER_SRGB, NOISE, VERTEX_SHADER, Field
from evenlight.stimuli.image_renderer import DimmedImage, EyeImages, ImageUploads
from evenlight.stimuli.scenes.engine.scene import Floats

if TYPE_CHECKING:
    import moderngl

    from evenlight.hardware.protocols import Window

    # Sets what eye 0 or 1 sees of an image, in its picture of some size [pixels]; returns the texture.
    TakeImage = Callable[[int, EyePose, tuple[int, int]], moderngl.Texture]

PIXEL_BY_PIXEL, PLANE, SPHERE = range(1, 4)  # how the places in an image are found; 0 where there is none

FRAGMENT_SHADER = (
    """
#version 330
uniform sampler2D coverage;      // of text on the panel: 0 none, 1 all
uniform usampler2D image;        // levels of R, G, B
uniform usampler2D thresholds;   // in 2^-24, repeated; without noise
uniform bool noisy;
uniform bool written;            // whether there is text
uniform mat3 panel;              // pixel of the eye to pixel of the panel
uniform int mapping;             // 0 no image, 1 pixel by pixel, 2 plane, 3 sphere
uniform mat3 surface;            // pixel of the eye to pixel of the image, or to a direction
uniform float span;              // of the sphere [rad]
uniform ivec2 first;             // upper left pixel of the part of the image that this eye sees
uniform ivec2 part;              // width and height of that part
uniform float highest_level;
uniform bool from_below;         // whether the image's first row is the lowest
uniform int left_edge;           // of the eye's picture in the framebuffer
uniform int height;              // of the framebuffer
uniform float gamma;
uniform float factor;
uniform float lift;              // how far black, dimmed, lies below black, relative to the range
uniform float ground;            // light around the image, relative to the range: 0 black, 1 white
uniform float ink;               // of the text
uniform float highest_code;
uniform uint frame;
uniform uint seed;
out vec4 colour;
const float PI = 3.14159265358979;
"""
    + NOISE
    + """
vec3 powered(vec3 values) { return pow(clamp(values, 0.0, 1.0), vec3(gamma)); }

// The light of an image's pixel, linear, relative to white.
vec3 linear_at(ivec2 place) {
    bool around = mapping == 3 && span > 6.0;
    place.x = around ? (place.x + part.x) % part.x : clamp(place.x, 0, part.x - 1);
    place = first + ivec2(place.x, clamp(place.y, 0, part.y - 1));
    if (from_below) place.y = textureSize(image, 0).y - 1 - place.y;
    return powered(vec3(texelFetch(image, place, 0).rgb) / highest_level);
}

// The place in the image that a point of the eye's picture shows: of its first pixel the middle is at 0.5.
vec2 place_of(vec2 point, out bool inside) {
    vec3 seen = surface * vec3(point, 1.0);
    vec2 place;
    if (mapping == 3) {
        vec2 angles = vec2(atan(seen.x, -seen.z), -atan(seen.y, length(seen.xz)));
        place = (angles / vec2(span, PI) + 0.5) * vec2(part);
        inside = abs(angles.x) <= 0.5 * span;
    } else {
        place = seen.xy / (seen.z > 0.0 ? seen.z : 1.0);
        inside = seen.z > 0.0 && all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, vec2(part)));
    }
    return place;
}

vec3 dimmed(vec3 light) { return max(factor * light - lift, 0.0); }

vec3 light_at(vec2 point) {
    bool inside;
    vec2 place = place_of(point, inside);
    if (!inside) return vec3(ground);
    if (mapping == 1) return dimmed(linear_at(ivec2(place)));
    vec2 corner = floor(place - 0.5), share = place - 0.5 - corner;
    ivec2 low = ivec2(corner);
    vec3 upper = mix(linear_at(low), linear_at(low + ivec2(1, 0)), share.x);
    vec3 lower = mix(linear_at(low + ivec2(0, 1)), linear_at(low + ivec2(1, 1)), share.x);
    return dimmed(mix(upper, lower, share.y));
}

// The mean over a pixel, of as many points as it takes to leave out no pixel of the image; up to 4 by 4.
vec3 picture_at(vec2 middle) {
    bool inside;
    vec2 place = place_of(middle, inside);
    float step_size = max(length(dFdx(place)), length(dFdy(place)));
    int points = mapping == 1 ? 1 : int(clamp(ceil(step_size - 0.01), 1.0, 4.0));
    vec3 sum = vec3(0.0);
    for (int row = 0; row < points; row++)
        for (int column = 0; column < points; column++)
            sum += light_at(middle + (vec2(column, row) + 0.5) / float(points) - 0.5);
    return sum / float(points * points);
}

float covered_at(vec2 middle) {
    vec3 seen = panel * vec3(middle, 1.0);
    vec2 place = seen.xy / (seen.z > 0.0 ? seen.z : 1.0) / vec2(textureSize(coverage, 0));
    float covered = texture(coverage, place).r;
    bool inside = seen.z > 0.0 && all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, vec2(1.0)));
    return inside ? covered : 0.0;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    pixel.y = height - 1 - pixel.y;  // rows count from the top
    vec2 middle = vec2(pixel.x - left_edge, pixel.y) + 0.5;
    vec3 light = vec3(ground);
    if (mapping != 0) light = picture_at(middle);
    if (written) light = mix(light, vec3(ink), covered_at(middle));
    vec3 wanted = clamp(light, 0.0, 1.0);
    vec3 lower = clamp(floor(pow(wanted, vec3(1.0 / gamma)) * highest_code), 0.0, highest_code - 1.0);
    vec3 below = powered(lower / highest_code), above = powered((lower + 1.0) / highest_code);
    vec3 share = clamp((wanted - below) / (above - below), 0.0, 1.0);
    uint threshold = noisy ? hashed(uvec4(uvec2(pixel), frame, seed)) >> 8u
                           : texelFetch(thresholds, pixel % textureSize(thresholds, 0), 0).r;
    vec3 codes = lower + vec3(lessThan(vec3(float(threshold) / 16777216.0), share));
    colour = vec4(codes / highest_code, 1.0);
}
"""
)


class EyeRenderer:
    """Draws text over a ground, or over images, for both eyes with the codes of one display.

    Parameters
    ----------
    window : Window
        The headset's.
    display : Display
        What is drawn on.
    dither : Dither
        How luminances between two codes are drawn.
    """

    def __init__(self, window: Window, display: Display, dither: Dither) -> None:
        self._window, self._display, self._bits = window, display, window.bits()
        context = self._context = window.context()
        self._program = context.program(vertex_shader=VERTEX_SHADER, fragment_shader=FRAGMENT_SHADER)
        self._triangle = context.vertex_array(self._program, [])
        self._no_image = context.texture((1, 1), 4, bytes(4), dtype="u1")
        self._text = self._no_text = context.texture((1, 1), 1, bytes(1), alignment=1)
        self._text_source: NDArray[np.uint8] | None = None
        matrix = thresholds_of(Dither.ORDERED if dither is Dither.NOISY_BIT else dither, (8, 8))
        self._thresholds = context.texture((8, 8), 1, matrix.tobytes(), dtype="u4")
        self._set(noisy=dither is Dither.NOISY_BIT, highest_code=float((1 << self._bits) - 1))
        self._set(gamma=display.gamma, coverage=0, image=1, thresholds=2)

    def _draw(
        self, framebuffer: moderngl.Framebuffer, field: Field, take_image: TakeImage | None = None
    ) -> None:
        """Draw a field's text over its ground, or over images, into both halves of a framebuffer."""
        import moderngl

        views = self._window.eyes()
        if views is None:
            raise ValueError("eyes are drawn in a headset's window, got another one")
        self._take_text(field.coverage)
        ground = self._relative(field.luminance)
        ink = ground if field.coverage is None else self._relative(field.ink)
        self._set(ground=ground, ink=ink, written=field.coverage is not None, height=framebuffer.height)
        framebuffer.use()
        self._context.disable(moderngl.DEPTH_TEST | moderngl.BLEND | moderngl.CULL_FACE)
        for state in (GL_DITHER, GL_FRAMEBUFFER_SRGB):
            self._context.disable_direct(state)
        size = framebuffer.width // 2, framebuffer.height
        for index, eye in enumerate(views.eyes):
            panel = panel_matrix(eye, size, views.head, self._text.size)
            self._set(left_edge=index * size[0], panel=columns(panel))
            image = self._no_image if take_image is None else take_image(index, eye, size)
            for unit, texture in enumerate((self._text, image, self._thresholds)):
                texture.use(unit)
            framebuffer.viewport = (index * size[0], 0, *size)
            self._triangle.render(vertices=3)
        framebuffer.viewport = (0, 0, framebuffer.width, framebuffer.height)

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
        """Make a text's texture the one that is drawn; the last one is kept, for it is drawn many times."""
        import moderngl

        if coverage is self._text_source:
            return
        if self._text is not self._no_text:
            self._text.release()
        self._text, self._text_source = self._no_text, coverage
        if coverage is not None:
            self._text = self._context.texture(coverage.shape[::-1], 1, coverage.tobytes(), alignment=1)
            self._text.repeat_x = self._text.repeat_y = False
            self._text.build_mipmaps()  # the panel may have more pixels than the eye's picture
            self._text.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)

    def _set(self, **uniforms: object) -> None:
        """Set uniforms of the shader."""
        for name, value in uniforms.items():
            self._program[name].value = value  # type: ignore[union-attr] # they are uniforms, all of them


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
        field = Field(picture.ground, picture.ink, picture.coverage)
        self._draw(framebuffer, field, partial(self._take_image, picture))

    def _take_image(
        self, picture: DimmedImage, index: int, eye: EyePose, size: tuple[int, int]
    ) -> moderngl.Texture:
        """Set what an eye sees of a picture, and where; return its texture."""
        image, surface = picture.of_eyes()[index], self._surface
        part, first = image.texture.size, (0, 0)
        if isinstance(picture.image, EyeImages):
            mapping, matrix = PIXEL_BY_PIXEL, centred(part, size)
        else:
            if surface.side_by_side:
                part = part[0] // 2, part[1]
                first = index * part[0], 0
            mapping = SPHERE if isinstance(surface, Sphere) else PLANE
            matrix = surface.matrix(eye, size, part)
        self._set(mapping=mapping, surface=columns(matrix), first=first, part=part)
        self._set(highest_level=float(image.levels - 1), from_below=image.from_below)
        return image.texture


def centred(part: tuple[int, int], size: tuple[int, int]) -> Floats:
    """Return the matrix from pixels of an eye's picture to those of an image in its middle.

    >>> (centred((61, 38), (97, 63)) @ (18.5, 12.5, 1.0)).tolist()
    [0.5, 0.5, 1.0]
    """
    left, top = (size[0] - part[0]) // 2, (size[1] - part[1]) // 2
    return np.array([[1.0, 0.0, -left], [0.0, 1.0, -top], [0.0, 0.0, 1.0]])


def columns(matrix: Floats) -> tuple[float, ...]:
    """Return a matrix as shaders take it, column by column."""
    return tuple(matrix.T.ravel().tolist())
