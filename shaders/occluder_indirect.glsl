// vec3 occluder_indirect(SkyVisibility sky): light reflected by the occluders, as a share of a whole sky.
// The fit of Jimenez et al. 2016, Practical Realtime Strategies for Accurate Indirect Occlusion,
// section 4, less its direct part. Corners of path-traced containers have three quarters of the fitted
// light. Small occluders reflect more, because they are in the open themselves.

#include "sky_visibility.glsl"

vec3 occluder_indirect(SkyVisibility sky) {
    float share = 1.0 - sky.cone_cosine * sky.cone_cosine;
    vec3 a = 2.0404 * sky.occluder_albedo - 0.3324;
    vec3 b = -4.7951 * sky.occluder_albedo + 0.6417;
    vec3 c = 2.7552 * sky.occluder_albedo + 0.6903;
    vec3 fit = clamp(((share * a + b) * share + c) * share, share, 1.0) - share;
    return min(fit * (0.75 + max(0.75 - 1.5 * sky.cone_cosine, 0.0)), 1.0 - share);
}
