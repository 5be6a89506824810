#version 330
uniform sampler2DArray albedo;
in vec3 at;
void main() {
#ifdef CUTOUT
    if (is_hole(texture(albedo, at).a, at, float(textureSize(albedo, 0).x), vec3(0.0))) discard;
#endif
}
