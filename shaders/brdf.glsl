// BrdfTerms brdf_terms(Material m, vec3 normal, vec3 view): terms of the BRDF shared by all lights.
// Split sum of Karis 2013, Real Shading in Unreal Engine 4. Directions are in the world frame.

#include "reflectance.constants"
#include "multiple_scattering.glsl"

uniform sampler2D dfg_table;   // By n_dot_v and roughness: scale and bias of F0.

struct Material {
    vec3 albedo;
    float roughness;
    float metallic;
};

struct BrdfTerms {
    Material material;
    vec3 normal;
    vec3 view;         // Unit, toward the eye.
    float n_dot_v;
    vec2 dfg;          // Scale and bias of F0.
    float gain;        // multiple_scattering_gain(dfg)
    float dielectric;  // Share of all light that a clear coat mirrors.
    vec3 diffuse;      // Share of all light that the base below the coat returns.
};

BrdfTerms brdf_terms(Material m, vec3 normal, vec3 view) {
    float n_dot_v = clamp(dot(normal, view), 0.0, 1.0);
    vec2 dfg = textureLod(dfg_table, vec2(n_dot_v, m.roughness), 0.0).rg;
    float gain = multiple_scattering_gain(dfg);
    float dielectric = (DIELECTRIC_F0 * dfg.x + dfg.y) * (1.0 + DIELECTRIC_F0 * gain);
    vec3 diffuse = m.albedo * ((1.0 - dielectric) * (1.0 - m.metallic));
    return BrdfTerms(m, normal, view, n_dot_v, dfg, gain, dielectric, diffuse);
}
