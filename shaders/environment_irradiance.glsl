// vec3 environment_irradiance(SkyVisibility sky, vec3 normal): irradiance / pi on a surface, from the
// visible sky and from the occluders.

#include "environment_map.glsl"
#include "occluder_indirect.glsl"

vec3 environment_irradiance(SkyVisibility sky, vec3 normal) {
    if (sky.traced.weight > 0.0)
        return diffuse_radiance(normal) * sky.traced.sky_share + sky.traced.indirect;
    return diffuse_radiance(sky.bent_normal) *
           (sky.irradiance + sky.lacks_indirect * occluder_indirect(sky));
}
