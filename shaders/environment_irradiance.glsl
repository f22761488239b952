// vec3 environment_irradiance(SkyVisibility sky, vec3 normal): irradiance / pi on a surface, from the
// visible sky and from the occluders.

#include "materials.constants"
#include "scene.block"
#include "environment_map.glsl"
#include "occluder_indirect.glsl"

vec3 environment_irradiance(SkyVisibility sky, vec3 normal) {
    if (sky.traced.weight > 0.0)
        return diffuse_radiance(normal) * sky.traced.sky_share + sky.traced.indirect;
    vec3 around = diffuse_radiance(sky.bent_normal) *
                  (sky.irradiance + sky.lacks_indirect * occluder_indirect(sky));
    // Occluders reflect with the mean of their assumed albedo and the sheet's paint.
    return around + sky.occluder_light * mix(sky.occluder_albedo, material_base[SHEET_MATERIAL].rgb, 0.5);
}
