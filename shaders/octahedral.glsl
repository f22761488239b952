// Unit vectors to [0, 1]^2 and back, and the surface keys that hold a normal so.
// Cigolle et al. 2014, A Survey of Efficient Representations for Independent Unit Vectors.

vec2 octahedral(vec3 n) {
    n /= abs(n.x) + abs(n.y) + abs(n.z);
    vec2 folded = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
    return (n.z < 0.0 ? folded : n.xy) * 0.5 + 0.5;
}

vec3 octahedral_direction(vec2 uv) {
    vec2 f = uv * 2.0 - 1.0;
    vec3 n = vec3(f, 1.0 - abs(f.x) - abs(f.y));
    float t = max(-n.z, 0.0);
    n.xy -= vec2(n.x < 0.0 ? -t : t, n.y < 0.0 ? -t : t);
    return normalize(n);
}

// zone + 1 in the low bits, so that 0 is the void; the normal in 2 x 11 bits
uint pack_surface_key(uint zone, vec3 normal) {
    // 2046 steps, so that the axes are met exactly
    uvec2 n = uvec2(octahedral(normal) * 2046.0 + 0.5);
    return (zone + 1u) | (n.x << 10) | (n.y << 21);
}

uint key_zone(uint key) { return (key & 1023u) - 1u; }

vec3 key_normal(uint key) {
    return octahedral_direction(vec2((key >> 10) & 2047u, key >> 21) / 2046.0);
}
