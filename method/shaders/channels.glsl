// What a frame's pixel gives: linear R, G, B, and in the fourth place linear luminance, all in [0, 1]. Which
// SOURCE_ there is, and whether LUMA_FIRST, is defined before this text. The arithmetic is `precise`: pixels
// of one value have to get one luminance, to the last bit, wherever a compiler puts this code.

uniform float gamma;
uniform bool from_below;
uniform float top;  // the highest level
const vec3 WEIGHTS = vec3(LUMINANCE_WEIGHTS);

#if defined(SOURCE_LEVELS)
uniform usampler2D frame;
#else
layout(std430, binding = 2) readonly buffer Frame { uint words[]; };  // rows of R, G, B without gaps
#endif

#if defined(SOURCE_PACKED_8) || defined(SOURCE_PACKED_16) || defined(SOURCE_LEVELS)
#define WHOLE
layout(std430, binding = 1) readonly buffer Linear { float linear_of_level[]; };

uvec3 levels_at(ivec2 pixel, ivec2 size) {
#if defined(SOURCE_LEVELS)
    return min(texelFetch(frame, pixel, 0).rgb, uvec3(top));
#elif defined(SOURCE_PACKED_8)
    uint first = 3u * uint(pixel.y * size.x + pixel.x), shift = 8u * (first & 3u);
    uint bytes = words[first >> 2u] >> shift;
    if (shift > 8u) bytes |= words[(first >> 2u) + 1u] << (32u - shift);
    return uvec3(bytes & 255u, (bytes >> 8u) & 255u, (bytes >> 16u) & 255u);
#else
    uint first = 3u * uint(pixel.y * size.x + pixel.x), half_way = first & 1u;
    uint low = words[first >> 1u], high = words[(first >> 1u) + 1u];
    return half_way == 0u ? uvec3(low & 65535u, low >> 16u, high & 65535u)
                          : uvec3(low >> 16u, high & 65535u, high >> 16u);
#endif
}
#else
vec3 values_at(ivec2 pixel, ivec2 size) {
    uint first = 3u * uint(pixel.y * size.x + pixel.x);
    vec3 values = vec3(uintBitsToFloat(words[first]), uintBitsToFloat(words[first + 1u]),
                       uintBitsToFloat(words[first + 2u]));
    // What is not a number would spread over the pyramid, and is not clamped by every driver.
    return clamp(mix(values, vec3(0.0), isnan(values)), 0.0, 1.0);
}
#endif

vec4 channels_at(ivec2 pixel, ivec2 size) {
    if (from_below) pixel.y = size.y - 1 - pixel.y;
    precise vec3 linear;
    precise float luminance;
#if defined(WHOLE)
    uvec3 levels = levels_at(pixel, size);
    linear = vec3(linear_of_level[levels.r], linear_of_level[levels.g], linear_of_level[levels.b]);
    luminance = WEIGHTS.r * linear.r + WEIGHTS.g * linear.g + WEIGHTS.b * linear.b;
#ifdef LUMA_FIRST
    precise vec3 encoded = vec3(levels) / top;
#endif
#else
    precise vec3 encoded = values_at(pixel, size);
    linear = pow(encoded, vec3(gamma));
    luminance = WEIGHTS.r * linear.r + WEIGHTS.g * linear.g + WEIGHTS.b * linear.b;
#endif
#ifdef LUMA_FIRST
    precise float luma = WEIGHTS.r * encoded.r + WEIGHTS.g * encoded.g + WEIGHTS.b * encoded.b;
    luminance = pow(luma, gamma);
#endif
    return vec4(linear, luminance);
}
