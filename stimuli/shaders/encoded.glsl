#version 330
// The codes of a 10-bit display with gamma 2.2. Up to the knee light is shown as it is; above, it approaches
// the peak smoothly, with the same slope at the knee.
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
