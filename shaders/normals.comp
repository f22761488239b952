// Compute stage of the normals: sums the world normals of each pixel's samples by the pixel filter.
// Reads the visibility buffer. Writes the sum, whose length is below 1 where samples differ or see sky.
#version 430 core
#include "pixel_list.constants"
#include "samples.constants"
#include "variant.constants"
#include "damage.block"
#include "surface_id.glsl"
#include "sample_lattice.glsl"
#include "visibility_buffer.glsl"
#include "zone.glsl"
#if WITH_DAMAGE
#include "damage_law.glsl"
#include "rest_position.glsl"
#endif

layout(local_size_x = LIST_GROUP) in;   // Pixels of one row.

layout(rgba32f, binding = 0) writeonly uniform image2D normal_image;

uniform ivec4 region;   // Corner x, y, width and height in pixels.

#if WITH_HOLES
// The interior that a hole reveals, seen from behind; 0 where it reveals the sky through another hole.
vec3 interior_normal(ivec2 sample_at) {
    ivec2 inner_at = ivec2(textureSize(surface_ids, 0).x - 1 - sample_at.x, sample_at.y + inner_row);
    uint surface_id = surface_id_at(inner_at);
    if (surface_id == 0u) return vec3(0.0);
    return deformed_normal(damage_at(rest_at(inner_at)).bend, -id_normal(surface_id));
}
#endif

void main() {
    ivec2 in_region = ivec2(gl_GlobalInvocationID.xy);
    if (in_region.x >= region.z) return;
    ivec2 pixel = region.xy + in_region;
    ivec2 middle = center_texel(pixel);
    vec3 sum = vec3(0.0);
#if WITH_HOLES
    // As in the image, all torn samples of a pixel show the interior behind the first one.
    vec3 interior = vec3(0.0);
    bool torn = false;
#endif
    for (int i = 0; i < FILTER_SAMPLES; ++i) {
        ivec2 sample_at = middle + FILTER_OFFSET[i];
        uint surface_id = surface_id_at(sample_at);
        if (surface_id == 0u) continue;
        vec3 normal = id_normal(surface_id);
#if WITH_DAMAGE
        vec3 rest_mm = rest_at(sample_at);
        normal = deformed_normal(damage_at(rest_mm).bend, normal);
#endif
#if WITH_HOLES
        if (hole_at(rest_mm) >= 0 && !is_door_gear(id_zone(surface_id))) {
            if (!torn) interior = interior_normal(sample_at);
            torn = true;
            normal = interior;
        }
#endif
        sum += FILTER_WEIGHT[i] * normal;
    }
    imageStore(normal_image, pixel, vec4(sum, 0.0));
}
