// Reflected lobes do not lean away from occluders.

#include "sky_visibility.glsl"

vec3 lobe_direction(SkyVisibility sky, vec3 normal, vec3 mirror, float roughness, float open) {
    return mirror;
}
