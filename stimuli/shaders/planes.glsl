#version 330
// R, G, B of 8 bits from Y, Cb, Cr, in whole numbers: what `contrast.frame_light.convert_planes` computes.
uniform usampler2D luma;
uniform usampler2D blue;      // Cb, with as many samples or half of them each way
uniform usampler2D red;       // Cr
uniform bvec2 amid;           // whether a sample of chroma lies amid two pixels, down and across
uniform int black;            // code of it
uniform int gain;             // of Y
uniform ivec4 gains;          // of Cr in R, Cb in B, Cr and Cb in G
out uvec4 levels;
const int SHIFT = 17, MIDDLE = 16 * 128;

// Chroma of a column of samples, at a row of pixels: in fourths of a code.
int down(usampler2D plane, int column, ivec4 rows) {
    column = clamp(column, 0, textureSize(plane, 0).x - 1);
    return rows.z * int(texelFetch(plane, ivec2(column, rows.x), 0).r)
         + rows.w * int(texelFetch(plane, ivec2(column, rows.y), 0).r);
}

// Chroma at a pixel, in 16ths of a code from gray.
int chroma(usampler2D plane, ivec2 pixel, ivec2 whole) {
    ivec2 size = textureSize(plane, 0), odd = pixel % 2, near = pixel / 2;
    ivec4 rows = ivec4(pixel.yy, 4, 0);  // the near one and the far one, and their weights
    if (size.y < whole.y) {
        int other = amid.x ? 1 : 2 * odd.y;
        rows = ivec4(near.y, clamp(near.y + 2 * odd.y - 1, 0, size.y - 1), 4 - other, other);
    }
    if (size.x == whole.x) return 4 * down(plane, pixel.x, rows) - MIDDLE;
    int own = amid.y ? 3 : 4 - 2 * odd.x;
    int sum = own * down(plane, near.x, rows);
    if (own < 4) sum += (4 - own) * down(plane, near.x + 2 * odd.x - 1, rows);
    return sum - MIDDLE;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy), whole = textureSize(luma, 0);
    int cb = chroma(blue, pixel, whole), cr = chroma(red, pixel, whole);
    int y = (int(texelFetch(luma, pixel, 0).r) - black) * gain + (1 << (SHIFT - 1));
    ivec3 rgb = ivec3(y + gains.x * cr, y + gains.z * cr + gains.w * cb, y + gains.y * cb) >> SHIFT;
    levels = uvec4(uvec3(clamp(rgb, 0, 255)), 255u);
}
