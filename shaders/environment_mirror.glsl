// vec3 environment_mirror(BrdfTerms r, SkyVisibility sky, vec3 irradiance): mean radiance that the specular
// lobe of a surface receives from the sky and from the occluders.
// irradiance: Irradiance / pi on the surface. Bend, width and lean of the lobe are fitted as in
// lobe_visibility.glsl.

#include "scene.block"
#include "brdf.glsl"
#include "environment_map.glsl"
#include "lobe_direction.glsl"
#include "lobe_visibility.glsl"

// Mean radiance of the ground that is seen from the side of the container with this normal.
vec3 ground_radiance(vec3 normal) {
    vec3 share = normal * normal;
    return share.x * side_ground_radiance[normal.x > 0.0 ? 1 : 0].rgb +
           share.y * side_ground_radiance[normal.y > 0.0 ? 3 : 2].rgb +
           share.z * side_ground_radiance[normal.z > 0.0 ? 5 : 4].rgb;
}

vec3 environment_mirror(BrdfTerms r, SkyVisibility sky, vec3 irradiance) {
    float roughness = r.material.roughness;
    // Rough lobes bend toward the normal (Lagarde and de Rousiers 2014, Moving Frostbite to PBR,
    // section 4.9.3) and are narrower at grazing angles.
    float aslant = 1.0 - r.n_dot_v;
    float bend = min(roughness * roughness * (1.47 * roughness - 0.54 + 0.39 * aslant), 1.0);
    vec3 mirror = normalize(mix(reflect(-r.view, r.normal), r.normal, bend));
    float width = roughness * (1.025 - (0.79 - 0.415 * roughness) * aslant);
    if (sky.traced.weight > 0.0)
        return prefiltered(mirror, width) * sky.traced.mirror_sky_share + sky.traced.mirror_indirect;
    // The hidden part of a lobe mirrors the occluders.
    float open = lobe_visibility(sky, mirror, roughness);
    vec3 direction = lobe_direction(sky, r.normal, mirror, roughness, open);
    // A ground replaces what the environment has below the horizon. The share of the lobe below it, and
    // the direction of the rest, are fitted to GGX lobes of dielectrics: within 0.05, and within 6 % of
    // the mean radiance of four HDRIs.
    float spread = fma(1.95 * width, width, 0.02);
    float below = 0.5 - 0.5 * mirror.z * inversesqrt(fma(mirror.z, mirror.z, spread * spread));
    float raised = 0.5 * (direction.z + length(vec2(direction.z, 1.3 * spread)));
    direction.z = mix(direction.z, raised, side_ground_radiance[0].w);
    below *= side_ground_radiance[0].w;
    vec3 seen = mix(prefiltered(direction, width), ground_radiance(r.normal), below);
    return mix(sky.occluder_albedo * irradiance, seen, open);
}
