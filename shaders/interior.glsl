// vec3 interior(vec3 normal, vec3 rest_mm): radiance of the container's interior, seen through a hole.
// vec3 interior_albedo(vec3 normal, vec3 rest_mm): its albedo, of a wooden floor and primed walls.
// Little light enters, so the radiance is a small share of the mean irradiance outside. Its variation
// by normal is an artistic choice that makes the sides distinguishable.

#include "inside.constants"
#include "environment_map.glsl"

// The floor is made of boards 140 mm wide, with dark joints.
vec3 interior_albedo(vec3 normal, vec3 rest_mm) {
    if (normal.z > 0.7) return INSIDE_WOOD * (0.85 + 0.15 * step(0.04, fract(rest_mm.y / 140.0)));
    return INSIDE_PRIMER;
}

vec3 interior(vec3 normal, vec3 rest_mm) {
    vec3 irradiance = 0.5 * (diffuse_radiance(vec3(0.0, 0.0, 1.0)) + diffuse_radiance(vec3(0.0, 0.0, -1.0)));
    float fall = 0.6 + 0.4 * abs(normal.z) + 0.15 * normal.x;
    return INSIDE_LIGHT * irradiance * interior_albedo(normal, rest_mm) * fall;
}
