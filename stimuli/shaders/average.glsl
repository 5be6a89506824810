#version 330
uniform SAMPLER drawn;
uniform ivec2 origin;  // where the samples of the picture's lower left pixel begin
const ivec2 PLACES[COUNT] = ivec2[COUNT](OFFSETS);
out vec4 colour;
void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 first = origin + ivec2(ALONG * pixel.x + ASIDE * pixel.y, ALONG * pixel.y - ASIDE * pixel.x);
    vec3 sum = vec3(0.0);
    for (int k = 0; k < COUNT; k++)
        for (int s = 0; s < SAMPLES; s++) sum += texelFetch(drawn, first + PLACES[k], s).rgb;
    colour = vec4(sum / float(COUNT * SAMPLES), 1.0);
}
