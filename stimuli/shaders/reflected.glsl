// What smooth surfaces and metals reflect: the light around, as it was seen from the middle of the room. A
// column of pictures for each room, sharp at the bottom and more and more blurred above, each an octahedron
// laid flat with a rim of one texel. They are taken for pictures of the walls of a box.
uniform sampler2D around;
uniform float first_row[7];    // of each picture, and where the last one ends [texels]
uniform float mean_cosine[6];  // of the lobe of each
flat in vec4 room;             // where it is seen from [m], and which column it is
flat in vec3 low;              // of the box [m]
flat in vec3 high;
flat in float metal;

vec3 seen_around(vec3 d, int grade) {
    float size = first_row[grade + 1] - first_row[grade] - 2.0;
    d /= abs(d.x) + abs(d.y) + abs(d.z);
    vec2 turned = (1.0 - abs(d.yx)) * vec2(d.x < 0.0 ? -1.0 : 1.0, d.y < 0.0 ? -1.0 : 1.0);
    vec2 at = 0.5 + 0.5 * (d.z < 0.0 ? turned : d.xy);
    vec2 column = vec2(room.w * (first_row[1] - first_row[0]), first_row[grade]);
    return textureLod(around, (column + 1.0 + at * size) / vec2(textureSize(around, 0)), 0.0).rgb;
}

// Light from a direction, spread like a GGX lobe around the mirrored one of normal incidence (Karis 2013).
float lobe(vec3 mirrored, vec3 towards, float rough, int grade) {
    float cosine = dot(mirrored, towards), a = max(rough * rough, 0.02);
    float narrowed = 1.0 - 0.5 * (1.0 + cosine) * (1.0 - a * a);
    return max(cosine, 0.0) * a * a / (narrowed * narrowed) / (4.0 * mean_cosine[grade]);
}

// Adds the light that is reflected to that which comes from below the surface, which is less by as much.
vec3 with_reflection(vec3 seen, vec3 base, float gloss, vec3 n, vec3 arriving, vec3 sunlight) {
    vec3 ray = normalize(where_ - eye), mirrored = reflect(ray, n);
    float rough = 1.0 - gloss;
    int grade = int(rough * 5.0 + 0.5);
    vec3 far = max((low - where_) / mirrored, (high - where_) / mirrored);
    vec3 met = where_ + mirrored * max(min(min(far.x, far.y), far.z), 1.0) - room.xyz;
    vec3 reflected = arriving;  // evenly from all sides, while those pictures are drawn
    if (textureSize(around, 0).x > 1) {
        reflected = seen_around(met, grade);
        if (sunlight != vec3(0.0)) reflected += sunlight * lobe(mirrored, sun_direction, rough, grade);
    }
    // Schlick (1994), less at grazing angles where it is rough (Lagarde 2011).
    vec3 straight = mix(vec3(0.04), base, metal);
    float grazing = 1.0 - min(abs(dot(n, ray)), 1.0), squared = grazing * grazing;
    vec3 share = straight + max(vec3(gloss) - straight, 0.0) * (squared * squared * grazing);
    return seen * (1.0 - metal) * (1.0 - share) + share * min(reflected, vec3(brightest));
}
