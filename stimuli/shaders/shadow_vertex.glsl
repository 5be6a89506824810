#version 330
uniform mat4 view;
in vec3 position;
in vec2 uv;
in float material;
out vec3 at;
void main() {
    at = vec3(uv, material);
    gl_Position = view * vec4(position, 1.0);
}
