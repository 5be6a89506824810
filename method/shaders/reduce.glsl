// One Gaussian level from the finer one. Each group makes 16 x 16 pixels from 35 x 35; where FROM_FRAME is
// defined, the finer level is the frame itself: its luminance is written too, and its channels are summed.

layout(local_size_x = 16, local_size_y = 16) in;
layout(std430, binding = 0) buffer Pyramid { float pyramid[]; };
uniform ivec2 fine_size;
uniform ivec2 coarse_size;
uniform int fine_at;    // where the finer level begins
uniform int coarse_at;  // where the coarser one begins

const int MADE = 16, SIDE = 35;
shared float tile[SIDE * SIDE];
shared float lines[MADE * SIDE];  // the tile, every other line, smoothed downwards

#ifdef FROM_FRAME
layout(std430, binding = 3) buffer Results { uint results[]; };
uniform float black;  // [cd/m^2]
uniform float span;   // from there to the peak
const float FIXED_POINT = 2097152.0;  // 2^21: a group's sum of 32 x 32 values up to 1 fits into 32 bits
shared vec4 partial[MADE * MADE];

// Adds to a sum of 64 bits: exact, so that the result depends on no order.
void add(uint sum, float value) {
    uint added = uint(value * FIXED_POINT + 0.5);
    uint before = atomicAdd(results[2u * sum], added);
    if (before + added < before) atomicAdd(results[2u * sum + 1u], 1u);
}
#endif

float smoothed(float a, float b, float c, float d, float e) {
    // In differences from the centre: an area of one luminance stays as it is, to the last bit.
    precise float inner = (b - c) + (d - c);
    precise float outer = (a - c) + (e - c);
    precise float value = c + INNER_WEIGHT * inner + OUTER_WEIGHT * outer;
    return value;
}

void main() {
    int me = int(gl_LocalInvocationIndex);
    ivec2 corner = 2 * MADE * ivec2(gl_WorkGroupID.xy) - 2;
#ifdef FROM_FRAME
    vec4 sum = vec4(0.0);
#endif
    for (int k = me; k < SIDE * SIDE; k += MADE * MADE) {
        ivec2 cell = ivec2(k % SIDE, k / SIDE), wanted = corner + cell;
        ivec2 pixel = mirrored(wanted, fine_size);
        int at = fine_at + pixel.y * fine_size.x + pixel.x;
#ifdef FROM_FRAME
        vec4 channels = channels_at(pixel, fine_size);
        precise float luminance = black + span * channels.a;
        tile[k] = luminance;
        if (all(greaterThanEqual(cell, ivec2(2))) && all(lessThan(cell, ivec2(2 * MADE + 2)))
            && all(lessThan(wanted, fine_size))) {
            pyramid[at] = luminance;
            sum += channels;
        }
#else
        tile[k] = pyramid[at];
#endif
    }
    barrier();
    for (int k = me; k < MADE * SIDE; k += MADE * MADE) {
        int x = k % SIDE, y = 2 * (k / SIDE);
        lines[k] = smoothed(tile[y * SIDE + x], tile[(y + 1) * SIDE + x], tile[(y + 2) * SIDE + x],
                            tile[(y + 3) * SIDE + x], tile[(y + 4) * SIDE + x]);
    }
#ifdef FROM_FRAME
    partial[me] = sum;
#endif
    barrier();
    ivec2 made = MADE * ivec2(gl_WorkGroupID.xy) + ivec2(gl_LocalInvocationID.xy);
    if (all(lessThan(made, coarse_size))) {
        int first = int(gl_LocalInvocationID.y) * SIDE + 2 * int(gl_LocalInvocationID.x);
        pyramid[coarse_at + made.y * coarse_size.x + made.x] = smoothed(
            lines[first], lines[first + 1], lines[first + 2], lines[first + 3], lines[first + 4]);
    }
#ifdef FROM_FRAME
    for (int half_way = MADE * MADE / 2; half_way > 0; half_way /= 2) {
        if (me < half_way) partial[me] += partial[me + half_way];
        barrier();
    }
    if (me < 4) add(uint(me), partial[0][me]);
#endif
}
