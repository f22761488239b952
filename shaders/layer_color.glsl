// vec3 layer_color(Material m, vec3 normal, vec3 view, SkyVisibility sky, vec4 light_seen): exposed
// radiance of a surface toward the eye, or its value in a single-layer image.
// light_seen: Unshadowed share of each directional light.

#include "variant.constants"
#include "view.block"
#include "brdf.glsl"
#include "environment_light.glsl"
#include "tone_curve.glsl"
#if LIGHTS
#include "directional_light.glsl"
#endif

vec3 layer_color(Material m, vec3 normal, vec3 view, SkyVisibility sky, vec4 light_seen) {
#if LAYER == LAYER_ALL
    BrdfTerms r = brdf_terms(m, normal, view);
    vec3 radiance = environment_reflection(r, sky);
#if LIGHTS
    for (int i = 0; i < LIGHTS; ++i)
        if (light_seen[i] > 0.0) radiance += light_seen[i] * light_reflection(r, i);
#endif
    return exposure * radiance;
#elif LAYER == LAYER_NORMALS
    return normal * 0.5 + 0.5;
#elif LAYER == LAYER_REFLECTION
    return srgb_decode(vec3(m.roughness));
#else
    return m.albedo;
#endif
}
