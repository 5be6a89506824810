#version 330
// The sky is a picture by azimuth and by the square root of the altitude, finest along the horizon.
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
