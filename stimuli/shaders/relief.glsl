// Turns a normal as a map says. Where u and v grow is taken from how places and coordinates change from pixel
// to pixel (Schuler 2006, Normal mapping without precomputed tangents).
uniform sampler2DArray relief;  // towards where u and v grow; 0.5 is straight

vec3 with_relief(vec3 n) {
    vec3 px = dFdx(where_), py = dFdy(where_), across = cross(py, n), up = cross(n, px);
    vec2 ax = dFdx(at.xy), ay = dFdy(at.xy);
    vec3 u = across * ax.x + up * ay.x, v = across * ax.y + up * ay.y;
    vec2 turned = 2.0 * texture(relief, at).rg - 1.0;
    vec3 along = turned.x * inversesqrt(max(dot(u, u), 1e-30)) * u;
    along += turned.y * inversesqrt(max(dot(v, v), 1e-30)) * v;
    along *= sign(dot(px, across));  // from behind, and where pictures are mirrored, they grow the other way
    return normalize(along + n * sqrt(max(1.0 - dot(turned, turned), 0.0)));
}
