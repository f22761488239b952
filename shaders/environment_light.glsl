// vec3 lit(BrdfTerms r, SkyVisibility sky): radiance of the environment reflected toward the eye.
// vec3 diffuse_radiance(vec3 normal): irradiance / pi of the whole environment on a surface.
// vec3 background(vec3 direction): radiance of the environment from a direction of any length.
// Directions are in the world frame. prefilter.py makes the maps.

#include "environment.constants"
#include "materials.constants"
#include "scene.block"
#include "view.block"
#include "octahedral.glsl"

uniform sampler2DArray specular_map;   // GGX-prefiltered radiance, one layer per roughness.
uniform sampler2D irradiance_map;      // Irradiance / pi by surface normal.
uniform sampler2D environment_map;      // Radiance; +x is the middle of the map.

// World to environment frame; yaw: cosine and sine of the environment's rotation about +z.
vec3 to_environment(vec3 d) {
    return vec3(fma(yaw.x, d.x, yaw.y * d.y), fma(yaw.x, d.y, -yaw.y * d.x), d.z);
}

// Texture coordinates inside the border of one texel of a map `size` texels wide.
vec2 bordered(vec2 uv, float size) {
    float texel = 1.0 / size;
    return fma(uv, vec2(1.0 - 2.0 * texel), vec2(texel));
}

vec3 prefiltered(vec3 direction, float roughness) {
    vec2 uv = bordered(octahedral(to_environment(direction)), SPECULAR_SIZE);
    float layer = SPECULAR_LAYER(roughness);
    float below = floor(layer);
    vec3 a = textureLod(specular_map, vec3(uv, below), 0.0).rgb;
    vec3 b = textureLod(specular_map, vec3(uv, min(below + 1.0, SPECULAR_LAYERS - 1.0)), 0.0).rgb;
    return mix(a, b, layer - below);
}

vec3 diffuse_radiance(vec3 normal) {
    vec2 uv = bordered(octahedral(to_environment(normal)), IRRADIANCE_SIZE);
    return textureLod(irradiance_map, uv, 0.0).rgb;
}

vec3 background(vec3 direction) {
    vec2 uv = bordered(octahedral(to_environment(direction).yzx), background_size);
    return textureLod(environment_map, uv, 0.0).rgb;
}

// Light at a point, found by rays.
struct TracedLight {
    vec3 sky_share;          // Share of the whole sky's irradiance that arrives.
    vec3 indirect;           // Irradiance / pi of indirect light.
    vec3 mirror_sky_share;   // Share of the sky's mirrored radiance that arrives.
    vec3 mirror_indirect;    // Mirrored radiance of other surfaces.
    float weight;            // Weight of the rays found; 0 without rays.
};

const TracedLight NO_TRACED_LIGHT = TracedLight(vec3(1.0), vec3(0.0), vec3(1.0), vec3(0.0), 0.0);

// Sky visibility of a point, and its occluders: the surfaces that hide a share of its hemisphere.
// lit() uses the rays instead if rays.weight > 0.
struct SkyVisibility {
    vec3 bent_normal;       // Bent normal: mean direction of the visible sky.
    float cone_cosine;      // Cosine of the half-angle of the cone of visible sky.
    vec3 irradiance;        // Irradiance of the visible sky, relative to a whole sky about the bent normal.
    float mirror;           // Share of open sky about the mirror direction.
    float lacks_indirect;   // 1 if `irradiance` lacks light reflected by the occluders, else 0.
    float overhead;         // Share of the occluders that is a spreader overhead, 0..1.
    vec3 occluder_light;    // Irradiance / pi of directional lights on occluders, times their share.
    vec3 occluder_albedo;   // Albedo of the occluders.
    TracedLight traced;
};

// Component of the bent normal along the surface. It points away from the strongest occlusion, and is
// 0 if occlusion is even all around.
vec3 bent_normal_tangent(SkyVisibility sky, vec3 normal) {
    return sky.bent_normal - normal * dot(normal, sky.bent_normal);
}

// Light reflected by the occluders, as a share of a whole sky: the fit of Jimenez et al. 2016,
// Practical Realtime Strategies for Accurate Indirect Occlusion, section 4, less its direct part.
// Corners of path-traced containers have three quarters of the fitted light. Small occluders reflect
// more, because they are in the open themselves.
vec3 bounced(SkyVisibility sky) {
    float share = 1.0 - sky.cone_cosine * sky.cone_cosine;
    vec3 a = 2.0404 * sky.occluder_albedo - 0.3324;
    vec3 b = -4.7951 * sky.occluder_albedo + 0.6417;
    vec3 c = 2.7552 * sky.occluder_albedo + 0.6903;
    vec3 fit = clamp(((share * a + b) * share + c) * share, share, 1.0) - share;
    return min(fit * (0.75 + max(0.75 - 1.5 * sky.cone_cosine, 0.0)), 1.0 - share);
}

// Share of a GGX lobe about `mirror` that reaches the sky. It mixes two estimates: the cone of visible
// sky, and the visibility about the mirror direction. The constants here, and the bend, width and lean
// of lobes in lit(), are fitted to GGX lobes of 96 rays from the pixels of 32 scenes. The terms for
// strong occlusion are fitted to path-traced images.
float lobe_visibility(SkyVisibility sky, vec3 mirror, float roughness) {
    float within = smoothstep(0.58 * sky.cone_cosine - 0.55, 0.58 * sky.cone_cosine + 0.69 + 0.76 * roughness,
                              dot(mirror, sky.bent_normal));
    within = mix(1.0, within, min(sky.cone_cosine / 0.3, 1.0));   // A rim of 0 has no occluders.
    // On a roof under a spreader, a lobe passes through one gap or none.
    float pointed = 0.22 + 0.32 * sky.cone_cosine + 0.4 * smoothstep(0.6, 0.9, sky.cone_cosine);
    return mix(within, sky.mirror, pointed);
}

vec3 lit(BrdfTerms r, SkyVisibility sky) {
    Material m = r.material;
    // Karis 2013 (split sum), Turquin 2019 (multiple scattering).
    vec3 metal = (m.albedo * r.dfg.x + r.dfg.y) * (1.0 + m.albedo * r.gain);
    vec3 specular = mix(vec3(r.dielectric), metal, m.metallic);

    // Rough lobes bend toward the normal (Lagarde and de Rousiers 2014, Moving Frostbite to PBR,
    // section 4.9.3) and are narrower at grazing angles.
    float aslant = 1.0 - r.n_dot_v;
    float bend = min(m.roughness * m.roughness * (1.47 * m.roughness - 0.54 + 0.39 * aslant), 1.0);
    vec3 mirror = normalize(mix(reflect(-r.view, r.normal), r.normal, bend));
    float width = m.roughness * (1.025 - (0.79 - 0.415 * m.roughness) * aslant);
    vec3 around = diffuse_radiance(sky.bent_normal) * (sky.irradiance + sky.lacks_indirect * bounced(sky));
    // Occluders reflect with the mean of their assumed albedo and the sheet's paint.
    around += sky.occluder_light * mix(sky.occluder_albedo, material_base[SHEET_MATERIAL].rgb, 0.5);
    // The hidden part of a lobe mirrors the occluders. The rest leans away from them.
    float open = lobe_visibility(sky, mirror, m.roughness);
    vec3 aside = bent_normal_tangent(sky, r.normal);
    float most = length(aside);
    float lean = 1.12 * m.roughness * (1.0 - open) * smoothstep(0.0, 0.2, most) / max(most, 1e-3);
    vec3 mirrored = mix(sky.occluder_albedo * around, prefiltered(fma(vec3(lean), aside, mirror), width), open);
    if (sky.traced.weight > 0.0) {
        around = diffuse_radiance(r.normal) * sky.traced.sky_share + sky.traced.indirect;
        mirrored = prefiltered(mirror, width) * sky.traced.mirror_sky_share + sky.traced.mirror_indirect;
    }
    return r.diffuse * around + specular * mirrored;
}
