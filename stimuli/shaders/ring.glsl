#version 330
// The scene's codes of 10 bits become pixel values over the 16-bit range, as `sequence_format.on_grid` has
// them, row 0 on top. The ring's own are finer: at 0.5 cd/m^2, a step of 10 bits is 2.4 % of the light.
uniform usampler2D codes;
uniform bool there;
uniform vec3 right;      // the ring's axes as the camera has them
uniform vec3 up;
uniform vec3 towards;
uniform vec2 gap;        // cosine and sine of its direction
uniform float size;      // of the gap, on the plane that touches the unit sphere at the ring
uniform vec2 focal;      // [pixels] across and up
uniform vec2 ahead;      // [pixels] where the camera points, from the lower left corner
uniform vec3 eye;        // right, up and towards from where the ring was painted; 1 is the ring's distance
uniform float outer;     // radius [gaps]
uniform float black;     // [cd/m^2]
uniform float white;
uniform float gamma;
uniform vec3 light;      // of the ring [cd/m^2]
uniform uvec3 levels;    // its pixel values
out uvec4 pixel_values;

vec2 on_plane(vec2 pixel) {
    vec3 ray = vec3((pixel - ahead) / focal, 1.0);
    float depth = dot(ray, towards) / (1.0 - eye.z);
    vec2 place = vec2(dot(ray, right), dot(ray, up)) + depth * eye.xy;
    return depth > 0.0 ? place / (depth * size) : vec2(1e6);
}

bool covers(vec2 p) {
    float along = dot(p, gap);
    float beside = p.y * gap.x - p.x * gap.y;
    float radius = length(p);
    return radius <= outer && radius >= outer - 1.0 && !(along > 0.0 && abs(beside) < 0.5);
}

float coverage(vec2 corner) {
    // A pixel is hardly larger than 1 / focal on the ring's plane, so those beyond its edge are left at once.
    float margin = 2.0 * (1.0 - eye.z) / (min(focal.x, focal.y) * size);
    if (length(on_plane(corner + 0.5)) > outer + margin) return 0.0;
    int inside = 0;
    for (int i = 0; i < SUBSAMPLES * SUBSAMPLES; ++i) {
        vec2 within = (vec2(i % SUBSAMPLES, i / SUBSAMPLES) + 0.5) / float(SUBSAMPLES);
        inside += covers(on_plane(corner + within)) ? 1 : 0;
    }
    return float(inside) / float(SUBSAMPLES * SUBSAMPLES);
}

void main() {
    // The codes are read from below, as OpenGL draws; what is written counts its rows from the top.
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    pixel.y = textureSize(codes, 0).y - 1 - pixel.y;
    uvec3 values = (texelFetch(codes, pixel, 0).rgb * 65535u + 511u) / 1023u;
    float share = there ? coverage(vec2(pixel)) : 0.0;
    if (share == 1.0) {
        values = levels;
    } else if (share > 0.0) {
        vec3 scene = pow(vec3(values) / 65535.0, vec3(gamma)) * (white - black) + black;
        vec3 mixed = max((mix(scene, light, share) - black) / (white - black), 0.0);
        values = uvec3(pow(mixed, vec3(1.0 / gamma)) * 65535.0 + 0.5);
    }
    pixel_values = uvec4(values, 65535u);
}
