// vec3 environment_reflection(BrdfTerms r, SkyVisibility sky): radiance of the environment reflected
// toward the eye.
// Split sum of Karis 2013, Real Shading in Unreal Engine 4, with multiple scattering by Turquin 2019.

#include "brdf.glsl"
#include "environment_irradiance.glsl"
#include "environment_mirror.glsl"

vec3 environment_reflection(BrdfTerms r, SkyVisibility sky) {
    Material m = r.material;
    vec3 metal = (m.albedo * r.dfg.x + r.dfg.y) * (1.0 + m.albedo * r.gain);
    vec3 specular = mix(vec3(r.dielectric), metal, m.metallic);
    vec3 irradiance = environment_irradiance(sky, r.normal);
    return r.diffuse * irradiance + specular * environment_mirror(r, sky, irradiance);
}
