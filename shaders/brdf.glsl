// BrdfTerms reflector(Material m, vec3 normal, vec3 view): terms of the BRDF shared by all lights.
// float fresnel_climb(float cosine): Fresnel reflectance, rescaled from F0..1 to 0..1.
// Split sum of Karis 2013, Real Shading in Unreal Engine 4. Directions are in the world frame.

#include "reflectance.constants"

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
    vec2 dfg;
    // Energy that single scattering loses, per unit of F0: Turquin 2019, Practical multiple scattering
    // compensation for microfacet models, eq. 16.
    float gain;
    float dielectric;  // Share of all light that a clear coat mirrors.
    vec3 diffuse;      // Share of all light that the base below the coat returns.
};

// Cook and Torrance 1982, A Reflectance Model for Computer Graphics; see reflectance.py.
float fresnel_climb(float cosine) {
    float g = sqrt(fma(cosine, cosine, DIELECTRIC_INDEX * DIELECTRIC_INDEX - 1.0));
    float away = (g - cosine) / (g + cosine);
    float ratio = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0);
    return (0.5 * away * away * (1.0 + ratio * ratio) - DIELECTRIC_F0) / (1.0 - DIELECTRIC_F0);
}

BrdfTerms reflector(Material m, vec3 normal, vec3 view) {
    float n_dot_v = clamp(dot(normal, view), 0.0, 1.0);
    vec2 dfg = textureLod(dfg_table, vec2(n_dot_v, m.roughness), 0.0).rg;
    float gain = 1.0 / (dfg.x + dfg.y) - 1.0;
    float dielectric = (DIELECTRIC_F0 * dfg.x + dfg.y) * (1.0 + DIELECTRIC_F0 * gain);
    vec3 diffuse = m.albedo * ((1.0 - dielectric) * (1.0 - m.metallic));
    return BrdfTerms(m, normal, view, n_dot_v, dfg, gain, dielectric, diffuse);
}
