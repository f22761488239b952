// vec3 lobe_direction(SkyVisibility sky, vec3 normal, vec3 mirror, float roughness, float open): mean
// direction, of any length, of the visible part of a GGX lobe about `mirror`. It leans away from the
// occluders, whose mean direction is opposite to the bent normal's component along the surface.
// open: Share of the lobe that reaches the sky. The constants are fitted as in lobe_visibility.glsl.

#include "sky_visibility.glsl"

vec3 lobe_direction(SkyVisibility sky, vec3 normal, vec3 mirror, float roughness, float open) {
    vec3 aside = sky.bent_normal - normal * dot(normal, sky.bent_normal);
    float most = length(aside);
    float lean = 1.12 * roughness * (1.0 - open) * smoothstep(0.0, 0.2, most) / max(most, 1e-3);
    return fma(vec3(lean), aside, mirror);
}
