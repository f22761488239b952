// float lobe_visibility(SkyVisibility sky, vec3 mirror, float roughness): share of a GGX lobe about
// `mirror` that reaches the sky, 0..1.
// It mixes two estimates: the cone of visible sky, and the visibility about the mirror direction. The
// constants are fitted to GGX lobes of 96 rays from the pixels of 32 scenes. The terms for strong
// occlusion are fitted to path-traced images.

#include "sky_visibility.glsl"

float lobe_visibility(SkyVisibility sky, vec3 mirror, float roughness) {
    float within = smoothstep(0.58 * sky.cone_cosine - 0.55,
                              0.58 * sky.cone_cosine + 0.69 + 0.76 * roughness,
                              dot(mirror, sky.bent_normal));
    // At a cosine of 0 nothing is hidden.
    within = mix(1.0, within, min(sky.cone_cosine / 0.3, 1.0));
    // On a roof under a spreader, a lobe passes through one gap or none.
    float pointed = 0.22 + 0.32 * sky.cone_cosine + 0.4 * smoothstep(0.6, 0.9, sky.cone_cosine);
    return mix(within, sky.mirror, pointed);
}
