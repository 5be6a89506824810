// The noise is `stimuli.dithering.hashed`: pcg4d of Jarzynski & Olano (2020), in arithmetic modulo 2^32.
uvec4 mixed(uvec4 v) {
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

uint hashed(uvec4 v) {
    v = mixed(v * 1664525u + 1013904223u);
    return mixed(v ^ (v >> 16u)).w;
}
