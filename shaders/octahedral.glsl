// vec2 octahedral(vec3 n): octahedral coordinates in [0, 1]^2 of a direction of any length.
// vec3 octahedral_direction(vec2 uv): unit vector of octahedral coordinates.
// uint pack_surface_id(uint zone, vec3 normal): surface id; id_zone and id_normal unpack it.
// Cigolle et al. 2014, A Survey of Efficient Representations for Independent Unit Vectors, JCGT 3(2),
// section 3.2.

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

// Zone + 1 is in the low 10 bits, so that 0 means no surface. The normal takes 2 x 11 bits.
uint pack_surface_id(uint zone, vec3 normal) {
    // An even number of steps represents the axes exactly.
    uvec2 n = uvec2(octahedral(normal) * 2046.0 + 0.5);
    return (zone + 1u) | (n.x << 10) | (n.y << 21);
}

uint id_zone(uint key) { return (key & 1023u) - 1u; }

vec3 id_normal(uint key) {
    return octahedral_direction(vec2((key >> 10) & 2047u, key >> 21) / 2046.0);
}
