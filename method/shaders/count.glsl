// Counts the critical brightness factors of the pixels of all bands, in one dispatch: as `count_band` of
// contrast/one_pass.py, in the same order, with the same differences from the centre pixel. Each group counts
// 28 x 28 pixels of one band at one reference factor; masking (Eq. 3, defined in contrast/masking.py) reaches two
// pixels further. All logarithms are to base 2.

layout(local_size_x = 32, local_size_y = 8) in;

struct Band {
    int width, height;    // of its level of the pyramid
    int fine_at, coarse_at, coarser_at;  // where this level and the next two begin in the pyramid
    int first_group, tiles_across, tiles;  // groups of a band: tiles times references
    int first_reference;  // among the factors
    int counts_at;        // among the results, first reference
    int tables_at;        // its sensitivities, then its luminances
    int step;             // pixels of the frame from one of its pixels to the next
    float log_darkest, per_log_luminance;     // beginning of the sensitivities' table, 1 / its span
    float log_faintest, per_log_sensitivity;  // of the luminances' table
};

uniform int n_groups;
#ifdef HIDDEN
uniform int across;       // pixels of the frame
layout(std430, binding = 5) readonly buffer Seen { uint seen[]; };  // a bit for each pixel of the frame
#endif

layout(std430, binding = 0) readonly buffer Pyramid { float pyramid[]; };
layout(std430, binding = 1) readonly buffer Bands { Band bands[]; };
layout(std430, binding = 2) readonly buffer Tables { float tables[]; };
layout(std430, binding = 3) buffer Results { uint results[]; };
layout(std430, binding = 4) readonly buffer Factors { float factors[]; };  // references, then knots

const int TILE = 28, REGION = 32, COARSE = 18, COARSER = 11;
const int PER_THREAD = 4;
const float FAINTEST = 1e-30;  // of r: its 0.2th power is 1e-6, as good as 0
const float NEVER = -200.0;    // log r of a pixel that is not to be counted

shared float coarser[COARSER * COARSER];
shared vec2 pairs[COARSE * COARSE];  // level l + 1, and level l + 2 expanded to it
shared vec2 lines[REGION * COARSE];  // both expanded downwards
shared float power[REGION * REGION];
shared float sums[REGION * TILE];    // of five powers across
shared uint histogram[KNOTS * REPLICAS];  // by threads, which would wait for each other

// Twice the kernel's even taps or its odd ones, in differences from the centre.
vec2 expanded(vec2 before, vec2 here, vec2 after, bool odd) {
    precise vec2 on = here + TWICE_OUTER * ((before - here) + (after - here));
    precise vec2 between = TWICE_INNER * (here + after);
    return odd ? between : on;
}

float looked_up(int first, int size, float x) {
    float position = clamp(x, 0.0, 1.0) * float(size - 1);
    int k = int(min(position, float(size - 2)));
    float here = tables[first + k];
    return here + (position - float(k)) * (tables[first + k + 1] - here);
}

// The first knot at which a pixel is visible; KNOTS if at none.
int first_knot(float log_factor) {
    int first = factors.length() - KNOTS;
#ifdef EQUAL_RATIOS
    float lowest = factors[first];
    float passed = (log_factor - lowest) * (float(KNOTS - 1) / -lowest);
    return int(clamp(floor(passed) + 1.0, 0.0, float(KNOTS)));
#else
    int low = 0, high = KNOTS;
    while (low < high) {
        int middle = (low + high) / 2;
        if (log_factor < factors[first + middle]) high = middle; else low = middle + 1;
    }
    return low;
#endif
}

// Level l + 2 expanded to a pixel of level l + 1, given the corner of what is loaded.
float around(ivec2 pixel, ivec2 corner) {
    ivec2 here = clamp(pixel / 2 - corner, ivec2(1), ivec2(COARSER - 2));
    bvec2 odd = equal(pixel & 1, ivec2(1));
    float across[3];
    for (int k = 0; k < 3; k++) {
        int at = here.y * COARSER + here.x + k - 1;
        vec2 here_too = vec2(coarser[at]);
        across[k] = expanded(vec2(coarser[at - COARSER]), here_too, vec2(coarser[at + COARSER]), odd.y).x;
    }
    return expanded(vec2(across[0]), vec2(across[1]), vec2(across[2]), odd.x).x;
}

void load(Band band, ivec2 origin, int me) {
    ivec2 size = ivec2(band.width, band.height);
    ivec2 coarse_size = (size + 1) / 2, coarser_size = (coarse_size + 1) / 2;
    ivec2 corner = origin / 4 - 2;
    for (int k = me; k < COARSER * COARSER; k += REGION * 8) {
        ivec2 pixel = mirrored(2 * (corner + ivec2(k % COARSER, k / COARSER)), coarse_size) / 2;
        coarser[k] = pyramid[band.coarser_at + pixel.y * coarser_size.x + pixel.x];
    }
    for (int k = me; k < REPLICAS * KNOTS; k += REGION * 8) histogram[k] = 0u;
    barrier();
    for (int k = me; k < COARSE * COARSE; k += REGION * 8) {
        ivec2 pixel = mirrored(origin - 4 + 2 * ivec2(k % COARSE, k / COARSE), size) / 2;
        pairs[k] = vec2(pyramid[band.coarse_at + pixel.y * coarse_size.x + pixel.x], around(pixel, corner));
    }
    barrier();
    for (int k = me; k < REGION * COARSE; k += REGION * 8) {
        int y = k / COARSE, at = (y / 2 + 1) * COARSE + k % COARSE;
        lines[k] = expanded(pairs[at - COARSE], pairs[at], pairs[at + COARSE], (y & 1) == 1);
    }
    barrier();
}

void main() {
    int group = int(gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x);
    if (group >= n_groups) return;
    int number = 0;
    while (number + 1 < bands.length() && group >= bands[number + 1].first_group) number++;
    Band band = bands[number];
    int reference = (group - band.first_group) / band.tiles, tile = (group - band.first_group) % band.tiles;
    ivec2 size = ivec2(band.width, band.height);
    ivec2 origin = TILE * ivec2(tile % band.tiles_across, tile / band.tiles_across);
    int me = int(gl_LocalInvocationIndex), x = int(gl_LocalInvocationID.x);
    load(band, origin, me);

    float log_reference = factors[band.first_reference + reference];
    float log_ratio[PER_THREAD], log_adaptation[PER_THREAD], log_contrast[PER_THREAD];
    for (int k = 0; k < PER_THREAD; k++) {
        int y = int(gl_LocalInvocationID.y) + 8 * k;
        ivec2 pixel = origin - 2 + ivec2(x, y);
        log_ratio[k] = NEVER;
        log_adaptation[k] = log_contrast[k] = 0.0;
        float strength = 0.0;
        if (all(greaterThanEqual(pixel, ivec2(0))) && all(lessThan(pixel, size))) {
            int at = y * COARSE + x / 2 + 1;
            vec2 low_and_seen = expanded(lines[at - 1], lines[at], lines[at + 1], (x & 1) == 1);
            float light = max(low_and_seen.y, DARKEST);
            precise float difference = pyramid[band.fine_at + pixel.y * size.x + pixel.x] - low_and_seen.x;
            log_adaptation[k] = log2(light);
            log_ratio[k] = log2(max(abs(difference) / light, FAINTEST));
            float place = (log_adaptation[k] + log_reference - band.log_darkest) * band.per_log_luminance;
            log_contrast[k] = log_ratio[k] + looked_up(band.tables_at, SENSITIVITIES, place);
            strength = exp2(MASKING_EXPONENT * log_contrast[k]);
#ifdef POSITIVE_ONLY
            if (difference <= 0.0) log_ratio[k] = NEVER;
#endif
#ifdef HIDDEN
            int place_in_frame = band.step * (pixel.y * across + pixel.x);
            if ((seen[place_in_frame >> 5] >> (place_in_frame & 31) & 1u) == 0u) log_ratio[k] = NEVER;
#endif
        }
        power[y * REGION + x] = strength;
    }
    barrier();
    if (x < TILE)
        for (int y = int(gl_LocalInvocationID.y); y < REGION; y += 8) {
            int at = y * REGION + x;
            sums[y * TILE + x] = power[at] + power[at + 1] + power[at + 2] + power[at + 3] + power[at + 4];
        }
    barrier();
    for (int k = 0; k < PER_THREAD; k++) {
        int y = int(gl_LocalInvocationID.y) + 8 * k;
        ivec2 pixel = origin - 2 + ivec2(x, y);
        bool mine = x >= 2 && x < TILE + 2 && y >= 2 && y < TILE + 2 && all(lessThan(pixel, size));
        if (mine && log_ratio[k] > NEVER) {
            int at = (y - 2) * TILE + x - 2;
            float total = sums[at] + sums[at + TILE] + sums[at + 2 * TILE] + sums[at + 3 * TILE]
                        + sums[at + 4 * TILE];
            ivec2 reach = min(pixel + 2, size - 1) - max(pixel - 2, ivec2(0)) + 1;
            float n = float(reach.x * reach.y);
#ifdef WITHOUT_CENTRE
            total -= power[y * REGION + x];
            n = max(n - 1.0, 1.0);
#endif
            float log_masking = log2(max(total / n, FAINTEST)) - MASKING_EXPONENT * log_contrast[k];
            float place = (log_masking - MASKING_LOW) * PER_MASKING_SPAN;
            float log_threshold = looked_up(0, THRESHOLDS, place);
            place = (log_threshold - log_ratio[k] - band.log_faintest) * band.per_log_sensitivity;
            float log_light = looked_up(band.tables_at + SENSITIVITIES, LUMINANCES, place);
            int knot = first_knot(log_light - log_adaptation[k]);
            if (knot < KNOTS) atomicAdd(histogram[knot * REPLICAS + me % REPLICAS], 1u);
        }
    }
    barrier();
    for (int knot = me; knot < KNOTS; knot += REGION * 8) {
        uint counted = 0u;
        // Each thread begins elsewhere, so that no two read the same bank of memory at once.
        for (int k = 0; k < REPLICAS; k++) counted += histogram[knot * REPLICAS + (k + me) % REPLICAS];
        if (counted > 0u) atomicAdd(results[band.counts_at + reference * KNOTS + knot], counted);
    }
}
