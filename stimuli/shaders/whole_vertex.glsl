#version 330
out vec2 corner;
void main() {
    vec2 place = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    corner = 2.0 * place - 1.0;
    gl_Position = vec4(corner, 1.0, 1.0);
}
