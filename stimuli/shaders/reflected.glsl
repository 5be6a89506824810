// What smooth surfaces and metals reflect: the light around, as it was seen from the middle of the room. A
// layer for each room, in it a picture for each grade, sharp at the bottom and more and more blurred above,
// each an octahedron laid flat with a rim of one texel. They are taken for pictures of the walls of a box.
uniform sampler2DArray around;
uniform vec2 texel;            // one of all texels of a layer, each way
uniform vec2 roughest;         // picture: its middle row, and half its width [texels]
flat in vec4 room;             // where it is seen from [m], and which layer it is
flat in vec3 low;              // of the box [m]
flat in vec3 high;
flat in float metal;
flat in vec4 lobe;             // picture; two factors of what spreads the sun's light

vec3 seen_around(vec3 d, vec2 picture) {
    d *= 1.0 / (abs(d.x) + abs(d.y) + abs(d.z));  // multiplied: a software renderer divides thrice
    vec2 turned = (1.0 - abs(d.yx)) * vec2(d.x < 0.0 ? -1.0 : 1.0, d.y < 0.0 ? -1.0 : 1.0);
    vec2 at = vec2(picture.y + 1.0, picture.x) + (d.z < 0.0 ? turned : d.xy) * picture.y;
    return textureLod(around, vec3(at * texel, room.w), 0.0).rgb;
}

// Adds the light that is reflected to that which comes from below the surface, which is less by as much.
vec3 with_reflection(vec3 seen, vec3 base, float gloss, vec3 n, vec3 arriving, vec3 sunlight) {
    vec3 ray = normalize(where_ - eye), mirrored = reflect(ray, n), steep = 1.0 / mirrored;
    vec3 far = max((low - where_) * steep, (high - where_) * steep);
    vec3 met = where_ + mirrored * max(min(min(far.x, far.y), far.z), 1.0) - room.xyz;
    vec3 reflected = arriving;  // evenly from all sides, while those pictures are drawn
    if (textureSize(around, 0).x > 1) {
        // The sun is spread like a GGX lobe around the mirrored one of normal incidence (Karis 2013).
        float cosine = dot(mirrored, sun_direction), narrowed = 1.0 - 0.5 * (1.0 + cosine) * lobe.z;
        reflected = seen_around(met, lobe.xy) + sunlight * (max(cosine, 0.0) * lobe.w / (narrowed * narrowed));
    }
    // Schlick (1994), less at grazing angles where it is rough (Lagarde 2011).
    vec3 straight = mix(vec3(0.04), base, metal);
    float grazing = 1.0 - min(abs(dot(n, ray)), 1.0), squared = grazing * grazing;
    vec3 share = straight + max(vec3(gloss) - straight, 0.0) * (squared * squared * grazing);
    return seen * (1.0 - metal) * (1.0 - share) + share * min(reflected, vec3(brightest));
}
