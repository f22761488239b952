// vec3 light_reflection(BrdfTerms r, int i): radiance of directional light i reflected toward the eye,
// without shadow. The lights are extracted from the HDRI: the sun or lamps; light 0 is the brightest.

#include "reflectance.constants"
#include "view.block"
#include "brdf.glsl"
#include "ggx.glsl"
#include "reflectance.glsl"

vec3 light_reflection(BrdfTerms r, int i) {
    Material m = r.material;
    vec3 toward = light_direction[i].xyz;
    float n_dot_v = max(r.n_dot_v, 1e-3);
    float n_dot_l = max(dot(r.normal, toward), 0.0);
    vec3 half_way = normalize(r.view + toward);
    float n_dot_h = max(dot(r.normal, half_way), 0.0);
    // The light's disc spreads half vectors by half its radius (after Karis 2013, area lights).
    float alpha = m.roughness * m.roughness + 0.5 * light_direction[i].w;
    float grazing = fresnel_climb(clamp(dot(r.view, half_way), 0.0, 1.0));
    vec3 metal = mix(m.albedo, vec3(1.0), grazing) * (1.0 + m.albedo * r.gain);
    float dielectric = mix(DIELECTRIC_F0, 1.0, grazing) * (1.0 + DIELECTRIC_F0 * r.gain);
    vec3 specular = mix(vec3(dielectric), metal, m.metallic) * ggx(alpha, n_dot_h, n_dot_l, n_dot_v);
    return (r.diffuse + specular) * light_irradiance[i].rgb * n_dot_l;
}
