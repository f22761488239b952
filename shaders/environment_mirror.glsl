// vec3 environment_mirror(BrdfTerms r, SkyVisibility sky, vec3 around): mean radiance that the specular
// lobe of a surface receives from the sky and from the occluders.
// around: Irradiance / pi on the surface. Bend, width and lean of the lobe are fitted as in
// lobe_visibility.glsl.

#include "brdf.glsl"
#include "environment_map.glsl"
#include "lobe_direction.glsl"
#include "lobe_visibility.glsl"

vec3 environment_mirror(BrdfTerms r, SkyVisibility sky, vec3 around) {
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
    vec3 seen = prefiltered(lobe_direction(sky, r.normal, mirror, roughness, open), width);
    return mix(sky.occluder_albedo * around, seen, open);
}
