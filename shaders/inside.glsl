// vec3 inside_albedo(vec3 normal, vec3 rest_mm), vec3 inside(...): radiance of the container's inside,
// seen through a hole.
// Little light gets in: a share of the average around, unlike by where a side faces, so that the sides
// can be told apart.

vec3 inside_albedo(vec3 normal, vec3 rest_mm) {
    if (normal.z > 0.7) return INSIDE_WOOD * (0.85 + 0.15 * step(0.04, fract(rest_mm.y / 140.0)));
    return INSIDE_PRIMER;
}

vec3 inside(vec3 normal, vec3 rest_mm) {
    vec3 around = 0.5 * (diffuse_radiance(vec3(0.0, 0.0, 1.0)) + diffuse_radiance(vec3(0.0, 0.0, -1.0)));
    float fall = 0.6 + 0.4 * abs(normal.z) + 0.15 * normal.x;
    return INSIDE_LIGHT * around * inside_albedo(normal, rest_mm) * fall;
}
