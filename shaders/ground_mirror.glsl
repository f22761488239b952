// vec3 ground_mirror(vec3 at, vec3 ray, GroundMaterial m): radiance of surroundings that wet ground
// mirrors.
// vec3 ground_glare(vec3 at, vec3 ray, GroundMaterial m, float hidden, float blur_m): the same for the
// directional lights, which the surroundings do not contain.

#include "ground.constants"
#include "reflectance.constants"
#include "variant.constants"
#include "ground.block"
#include "view.block"
#include "environment_map.glsl"
#include "ggx.glsl"
#include "ground_bodies.glsl"
#include "ground_light.glsl"
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
    /* Hardly any light comes from bottoms. */ \
    if (face < 4) sides += cover * (face < 2 ? face < 1 ? face_radiance[4 * i] : face_radiance[4 * i + 1] \
                               : face < 3 ? face_radiance[4 * i + 2] : face_radiance[4 * i + 3]).rgb; }
    EACH_BOX(MIRRORED)
    // Boxes that hide one another count for what they hide together.
    vec3 seen = prefiltered(mirror, m.roughness) * max(1.0 - hidden, 0.0) + sides / max(hidden, 1.0);
    // Rough lobes climb less: Lagarde and de Rousiers 2014, Moving Frostbite to PBR, section 4.9.3.
    float climb = (fresnel(mirror.z, WATER_INDEX) - WATER_F0) / (1.0 - WATER_F0);
    return seen * (WATER_F0 + (max(1.0 - m.roughness, WATER_F0) - WATER_F0) * climb);
}

// ray: Unit vector. hidden: Share of the first light that is hidden. blur_m: Radius over which shadows
// are filtered.
vec3 ground_glare(vec3 at, vec3 ray, GroundMaterial m, float hidden, float blur_m) {
    vec3 sum = vec3(0.0);
    if (light_count == 0) return sum;
    for (int i = 0; i < LIGHTS; ++i) {
        vec3 toward = light_direction[i].xyz;
        if (toward.z <= 0.0) continue;
        if (i > 0) hidden = hidden_from(i, at, blur_m);
        vec3 half_way = normalize(toward - ray);
        // The light's disc and the pixel spread half vectors by half their radius.
        float alpha = m.roughness * m.roughness + 0.5 * (light_direction[i].w + (1.0 + GROUND_COARSE) * pixel_angle);
        float lobe = ggx(alpha, half_way.z, toward.z, max(-ray.z, 1e-3));
        float reflected = fresnel(clamp(dot(toward, half_way), 0.0, 1.0), WATER_INDEX);
        sum += light_irradiance[i].rgb * (max(1.0 - hidden, 0.0) * reflected * lobe * toward.z);
    }
    return sum;
}
