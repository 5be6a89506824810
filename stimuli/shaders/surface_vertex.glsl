#version 330
uniform mat4 view;
uniform mat3 placing;  // of the picture where it is drawn
in vec3 position;
in vec4 normal;  // and the number of the room
in vec2 uv;
in vec2 detail_at;
in vec2 light_at;
in vec3 tint;
in float material;
out vec3 where_;
out vec3 facing;
out vec3 at;
// Never beyond the edge, where the light of other patches is stored. The third number is 1: a software
// renderer divides what it found at the centroid by the w of the pixel's middle; this takes it back.
centroid out vec3 at_light;
out vec4 share;  // of the albedo texture; gloss
out vec4 fine;   // place and layer of the detail; its strength
// A row each: scale of the albedo and gloss; layer and strength of the detail, layer of the albedo, metal;
// what its lobe is.
uniform sampler2D materials;
#if defined(SHINY) || defined(RELIEF)
uniform sampler2D rooms;  // a row each: where it is seen from, corners of its box [m]
flat out vec4 room;
flat out vec3 low;
flat out vec3 high;
flat out float metal;
flat out vec4 lobe;
#endif
void main() {
    where_ = position;
    facing = normal.xyz;
    vec4 second = texelFetch(materials, ivec2(1, int(material)), 0);
    at = vec3(uv, second.z);
    float one = dot(normal.xyz, normal.xyz);  // not a constant, which a compiler would not interpolate
    at_light = vec3(light_at, 1.0) * one;
    share = texelFetch(materials, ivec2(0, int(material)), 0) * vec4(tint, 1.0);
    fine = vec4(detail_at, second.xy);
#if defined(SHINY) || defined(RELIEF)
    int number = int(normal.w);
    room = vec4(texelFetch(rooms, ivec2(0, number), 0).xyz, normal.w);
    low = texelFetch(rooms, ivec2(1, number), 0).xyz;
    high = texelFetch(rooms, ivec2(2, number), 0).xyz;
    metal = second.w;
    lobe = texelFetch(materials, ivec2(2, int(material)), 0);
#endif
    vec4 seen = view * vec4(position, 1.0);
    vec3 placed = placing * seen.xyw;
    gl_Position = vec4(placed.xy, seen.z, seen.w);
    // Nothing is drawn far outside the picture, which may be turned.
    gl_ClipDistance[0] = 1.02 * seen.w + seen.x;
    gl_ClipDistance[1] = 1.02 * seen.w - seen.x;
    gl_ClipDistance[2] = 1.02 * seen.w + seen.y;
    gl_ClipDistance[3] = 1.02 * seen.w - seen.y;
}
