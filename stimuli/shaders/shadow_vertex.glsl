#version 330
uniform mat4 view;
in vec3 position;
in vec2 uv;
in float material;
uniform sampler2D materials;
out vec3 at;
void main() {
    at = vec3(uv, texelFetch(materials, ivec2(1, int(material)), 0).z);
    gl_Position = view * vec4(position, 1.0);
}
