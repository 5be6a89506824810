#version 330
// The sun's light is added sharply here; the baked light holds all else, the sun's light from walls included.
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
uniform vec2 sharper;             // levels by which a finer copy of an image is taken; how oblique, at most
in vec3 where_;
in vec3 facing;
in vec3 at;
centroid in vec3 at_light;
in vec4 share;
in vec4 fine;
out vec4 colour;
#if defined(SHINY) || defined(RELIEF)
#include "reflected.glsl"
#endif
#ifdef RELIEF
#include "relief.glsl"
#endif

void main() {
#ifdef SHARPER
    vec2 size = vec2(textureSize(albedo, 0).xy);
    vec2 dx = dFdx(at.xy) * size, dy = dFdy(at.xy) * size;
    float wide = max(max(dot(dx, dx), dot(dy, dy)), 1e-12);  // squared: texels along a sample
    float area = dx.x * dy.y - dx.y * dy.x;
    float level = 0.5 * log2(max(area * area / wide, wide / sharper.y)) + sharper.x;
    vec4 paint = textureLod(albedo, at, level);
#else
    vec4 paint = texture(albedo, at);
#endif
    vec3 n = normalize(facing);
#ifdef RELIEF
    vec3 bent = with_relief(n);
    float turned = dot(bent, sun_direction) / dot(n, sun_direction);
#endif
#ifdef CUTOUT
    if (is_hole(paint.a, at, float(textureSize(albedo, 0).x), facing)) discard;
#endif
    paint.rgb *= 1.0 + fine.w * (2.0 * texture(detail, fine.xyz).r - 1.0);
    vec3 arriving = texture(light, at_light.xy / at_light.z).rgb;
#ifdef RELIEF
    if (textureSize(around, 0).x > 1) {  // as much more or less as arrives from around
        arriving *= min(seen_around(bent, roughest) / max(seen_around(n, roughest), 0.001), 3.0);
    }
#endif
    float towards = dot(n, sun_direction);
#ifdef CUTOUT
    if (towards < 0.0) {  // thin leaves let light through, and blue least
        n = -n;
        towards *= -0.5;
        paint.rgb *= vec3(1.0, 1.0, 0.7);
    }
#endif
    vec3 sunlight = vec3(0.0);
    if (towards > 0.0) {
        vec3 p = where_ + n * (1.5 * shadow_texel * sqrt(1.0 - towards * towards) + 0.004);
        vec4 q = to_shadow * vec4(p, 1.0);
#ifdef RELIEF
        towards = max(towards * turned, 0.0);
#endif
        float unhidden = texture(shadow, q.xyz);
        arriving += sun * (towards * unhidden);
        sunlight = sun * unhidden;
    }
    vec3 seen = paint.rgb * share.rgb * arriving;
#ifdef RELIEF
    n = bent;
#endif
#ifdef SHINY
    seen = with_reflection(seen, paint.rgb * share.rgb, share.a, n, arriving, sunlight);
#endif
#ifdef BLENDED
    colour = vec4(min(seen, brightest), paint.a);
#else
    colour = vec4(min(seen, brightest), 1.0);
#endif
}
