#version 330
uniform mat3 placing;
out vec2 corner;
void main() {
    corner = 2.0 * vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) - 1.0;
    gl_Position = vec4((placing * vec3(corner, 1.0)).xy, 1.0, 1.0);
    gl_ClipDistance[0] = 1.02 + corner.x;
    gl_ClipDistance[1] = 1.02 - corner.x;
    gl_ClipDistance[2] = 1.02 + corner.y;
    gl_ClipDistance[3] = 1.02 - corner.y;
}
