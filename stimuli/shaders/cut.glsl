// Small copies of a texture with holes are cut where as much of it is left as of the large one. Far away,
// where leaves are as small as samples, each sample of a pixel is cut at another coverage: as many are left as
// the pixel is covered, and of surfaces one behind the other, different ones. Where the graphics card takes
// the samples, the shader runs once for a pixel and says which are left: near, as many as the cut leaves of
// its width. (Alpha to coverage would leave the same ones of all surfaces, and far trees would be too thin.)
uniform sampler2D cutoffs;
uniform ivec4 numbering;
bool is_hole(float coverage, vec3 at, float size, vec3 facing) {
    vec2 dx = dFdx(at.xy), dy = dFdy(at.xy);
    float level = max(0.5 * log2(max(dot(dx, dx), dot(dy, dy))) + log2(size), 0.0);
    vec2 table = vec2(textureSize(cutoffs, 0));
    float cutoff = texture(cutoffs, vec2(level + 0.5, at.z + 0.5) / table).r;
    float chance = fract(dot(facing, vec3(12.9, 78.2, 37.7)));
#ifdef SAMPLES
    float far = clamp((level - 2.0) / 3.0, 0.0, 1.0), width = min(fwidth(coverage), 1.0);
    int left = 0;
    for (int k = 0; k < SAMPLES; k++) {
        float threshold = (float((k + int(chance * float(SAMPLES))) % SAMPLES) + 0.5) / float(SAMPLES);
        float cut = mix(cutoff + width * (threshold - 0.5), threshold, far);
        left |= coverage >= clamp(cut, 0.02, 0.98) ? 1 << k : 0;
    }
    gl_SampleMask[0] = left;
    return left == 0;
#else
    int count = numbering.y * numbering.z;
    ivec2 place = ivec2(gl_FragCoord.xy);
    int number = (place.x + numbering.x * place.y) % numbering.y + numbering.y * (place.y % numbering.z);
    number = numbering.w * number + int(chance * float(count));
    float threshold = (float(number % count) + 0.5) / float(count);
    float far = count > 1 ? clamp((level - 2.0) / 3.0, 0.0, 1.0) : 0.0;
    return coverage < mix(cutoff, threshold, far);
#endif
}
