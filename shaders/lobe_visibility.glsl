// float lobe_visibility(SkyVisibility sky, vec3 mirror, float roughness): share of a GGX lobe about
// `mirror` that reaches the sky, 0..1.
// It mixes two estimates: the cone of visible sky, and the visibility about the mirror direction. The
// constants are fitted to GGX lobes of 96 rays from the pixels of 32 scenes. The smoothstep from 0.6 to
// 0.9, for strong occlusion, is fitted to path-traced images.

#include "sky_visibility.glsl"

float lobe_visibility(SkyVisibility sky, vec3 mirror, float roughness) {
    float within = smoothstep(0.58 * sky.cone_cosine - 0.55,
                              0.58 * sky.cone_cosine + 0.69 + 0.76 * roughness,
                              dot(mirror, sky.bent_normal));
    // A cone with cosine 0 is the whole hemisphere, so nothing is hidden.
    within = mix(1.0, within, min(sky.cone_cosine / 0.3, 1.0));
    // Weight of the mirror estimate; it grows as the cone narrows. Under a spreader, what decides is
    // whether the mirror direction hits a gap.
    float pointed = 0.22 + 0.32 * sky.cone_cosine + 0.4 * smoothstep(0.6, 0.9, sky.cone_cosine);
    return mix(within, sky.mirror, pointed);
}
