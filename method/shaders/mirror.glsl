// Where an index beyond an axis lies in its mirror, the edge not repeated; as contrast/pyramid.py.
int mirrored(int index, int length) {
    if (length == 1) return 0;
    int period = 2 * (length - 1), folded = abs(index) % period;
    return min(folded, period - folded);
}

ivec2 mirrored(ivec2 pixel, ivec2 size) {
    return ivec2(mirrored(pixel.x, size.x), mirrored(pixel.y, size.y));
}
