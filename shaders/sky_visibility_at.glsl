// SkyVisibility sky_visibility_at(ivec2 sample_at, uint zone): sky visibility of a sample, without its
// occluders.

#include "sky_visibility.constants"
#include "zones.constants"
#include "sky_visibility.glsl"
#include "visibility_buffer.glsl"

// Decodes what fastgen/light/sky_visibility.py encodes. On the spreader the light includes indirect light
// already; see indirect_light.py.
SkyVisibility sky_visibility_at(ivec2 sample_at, uint zone) {
    vec4 stored = unpackUnorm4x8(texelFetch(sky_visibility_cones, sample_at, 0).r);
    vec3 cone = stored.xyz * (255.0 / 127.0) - 128.0 / 127.0;
    float size = length(cone);
    vec4 encoded = unpackUnorm4x8(texelFetch(sky_visibility_light, sample_at, 0).r);
    vec3 light = encoded.rgb * (255.0 / LIGHT_STEPS * fma(encoded.a, 255.0 / LIGHT_TIMES, 1.0));
    float lacks_indirect = zone < SPREADER_ZONE ? 1.0 : 0.0;
    float cone_cosine = clamp(2.0 - 2.0 * size, 0.0, 1.0);
    return SkyVisibility(cone / size, cone_cosine, light, stored.w, lacks_indirect, vec3(0.0),
                         NO_TRACED_LIGHT);
}
