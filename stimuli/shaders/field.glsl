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

#include "noise.glsl"

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
