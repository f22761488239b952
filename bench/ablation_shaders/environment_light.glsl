// Every surface is diffuse and mirrors no part of the environment.

#include "brdf.glsl"
#include "environment_irradiance.glsl"

vec3 environment_reflection(BrdfTerms r, SkyVisibility sky) {
    Material m = r.material;
    return m.albedo * (1.0 - m.metallic) * environment_irradiance(sky, r.normal);
}
