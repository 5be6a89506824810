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
uniform int height;              // of the eye's picture
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

#include "noise.glsl"

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
