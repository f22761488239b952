// vec3 ground_mirror(vec3 at, vec3 ray, GroundMaterial m): radiance that wet ground mirrors.

#include "ground.block"
#include "environment_map.glsl"
#include "ground_bodies.glsl"
#include "ground_material.glsl"
#include "reflectance.glsl"

vec3 ground_mirror(vec3 at, vec3 ray, GroundMaterial m) {
    vec3 mirror = vec3(ray.xy, abs(ray.z));
    float alpha = m.roughness * m.roughness, hidden = 0.0;
    vec3 sides = vec3(0.0);
#define MIRRORED(i) { \
    int face; \
    float cover = body_cover(at, mirror, i, alpha, 0.01, face); \
    hidden += cover; \
    sides += cover * (face < 2 ? face < 1 ? face_radiance[4 * i] : face_radiance[4 * i + 1] \
                               : face < 3 ? face_radiance[4 * i + 2] : face_radiance[4 * i + 3]).rgb; }
    EACH_BOX(MIRRORED)
    // Boxes that hide one another count for what they hide together.
    vec3 seen = prefiltered(mirror, m.roughness) * max(1.0 - hidden, 0.0) + sides / max(hidden, 1.0);
    // Water has a refractive index of 1.33. Rough lobes climb less: Lagarde and de Rousiers 2014, Moving
    // Frostbite to PBR, section 4.9.3.
    float climb = fresnel_climb(mirror.z);
    return seen * (0.02 + (max(1.0 - m.roughness, 0.02) - 0.02) * climb);
}
