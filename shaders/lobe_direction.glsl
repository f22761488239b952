// vec3 lobe_direction(SkyVisibility sky, vec3 normal, vec3 mirror, float roughness, float open): mean
// direction, of any length, of the visible part of a GGX lobe about `mirror`. It leans away from the
// occluders.
// open: Share of the lobe that reaches the sky. The constants are fitted as in lobe_visibility.glsl.

#include "bent_normal_tangent.glsl"

vec3 lobe_direction(SkyVisibility sky, vec3 normal, vec3 mirror, float roughness, float open) {
    vec3 aside = bent_normal_tangent(sky, normal);
    float most = length(aside);
    float lean = 1.12 * roughness * (1.0 - open) * smoothstep(0.0, 0.2, most) / max(most, 1e-3);
    return fma(vec3(lean), aside, mirror);
}
