"""What drawing scenes shares: a context without a window, the graphics state, the shaders, the tone curve.

Drawing does not depend on what was set before, and leaves everything switched off.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.errors import InputError

if TYPE_CHECKING:
    import moderngl

NEAREST, LINEAR, LINEAR_MIPMAP_NEAREST, LINEAR_MIPMAP_LINEAR = 0x2600, 0x2601, 0x2701, 0x2703
# Switches that moderngl has no names for, and that others may have left on.
SCISSOR_TEST, STENCIL_TEST, DITHER, FRAMEBUFFER_SRGB = 0x0C11, 0x0B90, 0x0BD0, 0x8DB9
SAMPLE_ALPHA_TO_COVERAGE = 0x809E
CLIP_DISTANCES = (0x3000, 0x3001, 0x3002, 0x3003)
SURFACE_VERTEX = """
#version 330
uniform mat4 view;
uniform mat3 placing;  // of the picture where it is drawn
in vec3 position;
in vec3 normal;
in vec2 uv;
in vec2 detail_at;
in vec2 light_at;
in vec3 tint;
in float material;
out vec3 where_;
out vec3 facing;
out vec3 at;
// Never beyond the edge, where the light of other patches is stored. The third number is 1: a software
// renderer divides what it found at the centroid by the w of the pixel's middle; this takes it back.
centroid out vec3 at_light;
out vec4 share;  // of the albedo texture; gloss
out vec4 fine;   // place and layer of the detail; its strength
uniform sampler2D materials;  // a row each: scale of the albedo and gloss; layer and strength of the detail
void main() {
    where_ = position;
    facing = normal;
    at = vec3(uv, material);
    float one = dot(normal, normal);  // not a constant, which a compiler would not interpolate
    at_light = vec3(light_at, 1.0) * one;
    share = texelFetch(materials, ivec2(0, int(material)), 0) * vec4(tint, 1.0);
    fine = vec4(detail_at, texelFetch(materials, ivec2(1, int(material)), 0).xy);
    vec4 seen = view * vec4(position, 1.0);
    vec3 placed = placing * seen.xyw;
    gl_Position = vec4(placed.xy, seen.z, seen.w);
    // Nothing is drawn far outside the picture, which may be turned.
    gl_ClipDistance[0] = 1.02 * seen.w + seen.x;
    gl_ClipDistance[1] = 1.02 * seen.w - seen.x;
    gl_ClipDistance[2] = 1.02 * seen.w + seen.y;
    gl_ClipDistance[3] = 1.02 * seen.w - seen.y;
}
"""
# Small copies of a texture with holes are cut where as much of it is left as of the large one. Far away,
# where leaves are as small as samples, each sample of a pixel is cut at another coverage: as many are left as
# the pixel is covered, and of surfaces one behind the other, different ones. Where the graphics card takes
# the samples, the shader runs once for a pixel and says which are left: near, as many as the cut leaves of
# its width. (Alpha to coverage would leave the same ones of all surfaces, and far trees would be too thin.)
CUT = """
uniform sampler2D cutoffs;
uniform ivec4 numbering;
bool is_hole(float coverage, vec3 at, float size, vec3 facing) {
    vec2 dx = dFdx(at.xy), dy = dFdy(at.xy);
    float level = max(0.5 * log2(max(dot(dx, dx), dot(dy, dy))) + log2(size), 0.0);
    vec2 table = vec2(textureSize(cutoffs, 0));
    float cutoff = texture(cutoffs, vec2(level + 0.5, at.z + 0.5) / table).r;
    float chance = fract(dot(facing, vec3(12.9, 78.2, 37.7)));
#ifdef SAMPLES
    float far = clamp((level - 2.0) / 3.0, 0.0, 1.0), width = min(fwidth(coverage), 1.0);
    int left = 0;
    for (int k = 0; k < SAMPLES; k++) {
        float threshold = (float((k + int(chance * float(SAMPLES))) % SAMPLES) + 0.5) / float(SAMPLES);
        float cut = mix(cutoff + width * (threshold - 0.5), threshold, far);
        left |= coverage >= clamp(cut, 0.02, 0.98) ? 1 << k : 0;
    }
    gl_SampleMask[0] = left;
    return left == 0;
#else
    int count = numbering.y * numbering.z;
    ivec2 place = ivec2(gl_FragCoord.xy);
    int number = (place.x + numbering.x * place.y) % numbering.y + numbering.y * (place.y % numbering.z);
    number = numbering.w * number + int(chance * float(count));
    float threshold = (float(number % count) + 0.5) / float(count);
    float far = count > 1 ? clamp((level - 2.0) / 3.0, 0.0, 1.0) : 0.0;
    return coverage < mix(cutoff, threshold, far);
#endif
}
"""
# The sun's light is added sharply here; the baked light holds all else, the sun's light from walls included.
SURFACE_FRAGMENT = """
#version 330
uniform float brightest;          // [cd/m^2]
uniform sampler2DArray albedo;
uniform sampler2DArray detail;    // 0.5 is even
uniform sampler2D light;          // what a white surface would emit [cd/m^2]
uniform sampler2DShadow shadow;
uniform mat4 to_shadow;
uniform vec3 eye;
uniform vec3 sun_direction;
uniform vec3 sun;                 // luminance of white paper that faces it [cd/m^2]
uniform float shadow_texel;       // [m]
in vec3 where_;
in vec3 facing;
in vec3 at;
centroid in vec3 at_light;
in vec4 share;
in vec4 fine;
out vec4 colour;

void main() {
    vec4 paint = texture(albedo, at);
    vec3 n = normalize(facing);
#ifdef CUTOUT
    if (is_hole(paint.a, at, float(textureSize(albedo, 0).x), facing)) discard;
#endif
    paint.rgb *= 1.0 + fine.w * (2.0 * texture(detail, fine.xyz).r - 1.0);
    vec3 arriving = texture(light, at_light.xy / at_light.z).rgb;
    float towards = dot(n, sun_direction);
#ifdef CUTOUT
    if (towards < 0.0) {  // thin leaves let light through, and blue least
        n = -n;
        towards *= -0.5;
        paint.rgb *= vec3(1.0, 1.0, 0.7);
    }
#endif
    if (towards > 0.0) {
        vec3 p = where_ + n * (1.5 * shadow_texel * sqrt(1.0 - towards * towards) + 0.004);
        vec4 q = to_shadow * vec4(p, 1.0);
        arriving += sun * (towards * texture(shadow, q.xyz));
    }
    vec3 seen = paint.rgb * share.rgb * arriving;
    if (share.a > 0.0) {
        // A gloss reflects some of the light around it, more at grazing angles (Schlick 1994).
        float grazing = 1.0 - abs(dot(n, normalize(eye - where_)));
        float squared = grazing * grazing;
        seen += arriving * share.a * (0.04 + 0.6 * squared * squared * grazing);
    }
    colour = vec4(min(seen, brightest), 1.0);
}
"""
SHADOW_VERTEX = """
#version 330
uniform mat4 view;
in vec3 position;
in vec2 uv;
in float material;
out vec3 at;
void main() {
    at = vec3(uv, material);
    gl_Position = view * vec4(position, 1.0);
}
"""
SHADOW_FRAGMENT = """
#version 330
uniform sampler2DArray albedo;
in vec3 at;
void main() {
#ifdef CUTOUT
    if (is_hole(texture(albedo, at).a, at, float(textureSize(albedo, 0).x), vec3(0.0))) discard;
#endif
}
"""
WHOLE_VERTEX = """
#version 330
out vec2 corner;
void main() {
    vec2 place = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    corner = 2.0 * place - 1.0;
    gl_Position = vec4(corner, 1.0, 1.0);
}
"""
SKY_VERTEX = """
#version 330
uniform mat3 placing;
out vec2 corner;
void main() {
    corner = 2.0 * vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) - 1.0;
    gl_Position = vec4((placing * vec3(corner, 1.0)).xy, 1.0, 1.0);
    gl_ClipDistance[0] = 1.02 + corner.x;
    gl_ClipDistance[1] = 1.02 - corner.x;
    gl_ClipDistance[2] = 1.02 + corner.y;
    gl_ClipDistance[3] = 1.02 - corner.y;
}
"""
# The sky is a picture by azimuth and by the square root of the altitude, finest along the horizon.
SKY_FRAGMENT = """
#version 330
uniform float brightest;
uniform sampler2D sky;
uniform vec3 right;
uniform vec3 up;
uniform vec3 ahead;
in vec2 corner;
out vec4 colour;
void main() {
    vec3 d = normalize(ahead + corner.x * right + corner.y * up);
    float height = asin(clamp(d.z, -1.0, 1.0)) / 1.57079632679;
    float row = 0.5 + 0.5 * sign(height) * sqrt(abs(height));
    float turn = atan(d.x, d.y) / 6.28318530718;
    colour = vec4(min(textureLod(sky, vec2(turn, row), 0.0).rgb, brightest), 1.0);
}
"""
# As `shown_share`: the codes of a 10-bit display with gamma 2.2, bright light compressed to its peak.
ENCODE_FRAGMENT = """
#version 330
uniform sampler2D light;
uniform float peak;
uniform float knee;
uniform float gamma;
out uvec4 code;
void main() {
    vec3 share = max(texelFetch(light, ivec2(gl_FragCoord.xy), 0).rgb, 0.0) / peak;
    vec3 over = max(share - knee, 0.0) / (1.0 - knee);
    share = min(share, knee) + (1.0 - knee) * (1.0 - exp(-over));
    code = uvec4(uvec3(pow(share, vec3(1.0 / gamma)) * 1023.0 + 0.5), 1023u);
}
"""
PEAK = 100.0  # [cd/m^2] of the display that scenes are made for, about that of a headset
KNEE = 0.75  # share of the peak above which light is compressed


@contextmanager
def own(context: moderngl.Context) -> Iterator[None]:
    """Draw with everything switched off; afterwards switch off what was used, and bind what was bound."""
    before = context.fbo
    _all_off(context)
    try:
        yield
    finally:
        _all_off(context)
        if before is not None:
            before.use()


def _all_off(context: moderngl.Context) -> None:
    """Switch off all that changes what is drawn."""
    import moderngl

    context.enable_only(moderngl.NOTHING)
    context.wireframe = False
    context.polygon_offset = 0.0, 0.0
    context.depth_func = "<="
    context.front_face, context.cull_face = "ccw", "back"
    switches = SCISSOR_TEST, STENCIL_TEST, DITHER, FRAMEBUFFER_SRGB, SAMPLE_ALPHA_TO_COVERAGE
    for switch in (*switches, *CLIP_DISTANCES):
        context.disable_direct(switch)


def offscreen_context() -> moderngl.Context:
    """Return a graphics context without a window: EGL where there is one, else the system's own.

    Raises
    ------
    InputError
        If the machine has no OpenGL 3.3.
    """
    import moderngl

    reasons: list[str] = []
    choices: tuple[dict[str, Any], ...] = ({"backend": "egl"}, {})
    for options in choices:
        try:
            return moderngl.create_context(standalone=True, require=330, **options)
        except Exception as error:  # moderngl raises a bare Exception
            reasons.append(str(error).splitlines()[0] if str(error) else type(error).__name__)
    raise InputError(
        f"scenes need OpenGL 3.3, and there is none without a window ({reasons[0]}): install a graphics "
        "driver, or Mesa's software one (on Debian, libegl1 and libgl1-mesa-dri)"
    )


def with_holes(source: str, samples: int = 1) -> str:
    """Return a shader for materials with holes, into samples that the graphics card takes of each pixel."""
    several = f"#extension GL_ARB_sample_shading : require\n#define SAMPLES {samples}\n" * (samples > 1)
    return source.replace("#version 330\n", f"#version 330\n{several}#define CUTOUT\n{CUT}")


def shown_share(luminance: ArrayLike) -> NDArray[np.float64]:
    """Return which share of the display's peak is shown for a scene's light, each channel for itself.

    Up to `KNEE` it is the luminance over the peak; above, it approaches 1 smoothly, with the same slope at
    the knee.

    Parameters
    ----------
    luminance : array_like, any shape
        Linear RGB luminance [cd/m^2].

    >>> shown_share([0.0, 50.0, 75.0, 1e6]).tolist()
    [0.0, 0.5, 0.75, 1.0]
    """
    share = np.maximum(np.asarray(luminance, dtype=np.float64), 0) / PEAK
    over = np.maximum(share - KNEE, 0) / (1 - KNEE)
    return np.asarray(np.minimum(share, KNEE) + (1 - KNEE) * (1 - np.exp(-over)))
