// vec2 octahedral(vec3 n): octahedral coordinates in [0, 1]^2 of a direction of any length.
// vec3 octahedral_direction(vec2 uv): unit vector of octahedral coordinates.
// Twin of fastgen/light/octahedral.py. Cigolle et al. 2014, A Survey of Efficient Representations for
// Independent Unit Vectors, JCGT 3(2), section 3.2.

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
