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

#include "noise.glsl"

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
