// vec3 bent_normal_tangent(SkyVisibility sky, vec3 normal): component of the bent normal along the
// surface. It points away from the strongest occlusion, and is 0 if occlusion is even all around.

#include "sky_visibility.glsl"

vec3 bent_normal_tangent(SkyVisibility sky, vec3 normal) {
    return sky.bent_normal - normal * dot(normal, sky.bent_normal);
}
