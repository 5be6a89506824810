#version 330
// The weight of a pixel falls linearly with its distance, to 0 at the next one; of an image that gets smaller,
// at the next pixel of the result, so that nothing is left out.
uniform usampler2D image;
uniform vec2 size;          // of the result [pixels]
uniform float scale;        // pixels of the result per pixel of the image
uniform float gamma;
uniform vec2 highest;       // level of the image, and of the result
out uvec4 levels;
void main() {
    ivec2 last = textureSize(image, 0) - 1;
    vec2 place = (gl_FragCoord.xy - size / 2.0) / scale + vec2(last) / 2.0;
    float reach = max(1.0, 1.0 / scale);
    ivec2 first = ivec2(ceil(place - reach)), end = ivec2(floor(place + reach));
    vec4 sum = vec4(0.0);
    for (int y = first.y; y <= end.y; y++)
        for (int x = first.x; x <= end.x; x++) {
            vec2 near = max(1.0 - abs(vec2(x, y) - place) / reach, 0.0);
            vec3 encoded = vec3(texelFetch(image, clamp(ivec2(x, y), ivec2(0), last), 0).rgb) / highest.x;
            sum += near.x * near.y * vec4(pow(encoded, vec3(gamma)), 1.0);
        }
    levels = uvec4(uvec3(pow(sum.rgb / sum.a, vec3(1.0 / gamma)) * highest.y + 0.5), 1u);
}
