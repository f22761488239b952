// Shaded shade_hole(ivec2 sample_at, uint surface_id, Shaded behind): the view through a hole, at the
// interior of the container, or through another hole at what lies behind. Its id is then 0.
// surface_id: That of the sample, with the index of the hole in place of the normal.

#include "variant.constants"
#include "damage.block"
#include "scene.block"
#include "view.block"
#include "damage_law.glsl"
#include "interior.glsl"
#include "rest_position.glsl"
#include "shaded.glsl"
#include "surface_id.glsl"
#include "visibility_buffer.glsl"

Shaded shade_hole(ivec2 sample_at, uint surface_id, Shaded behind) {
    ivec2 inner_at = ivec2(textureSize(surface_ids, 0).x - 1 - sample_at.x, sample_at.y + inner_row);
    uint inner_id = surface_id_at(inner_at);
    vec3 rest_mm = rest_at(inner_at);
    float depth = texelFetch(surface_depths, inner_at, 0).r;
    Shaded s = behind;
    if (inner_id != 0u) {
        vec3 normal = -id_normal(inner_id);   // The inner view sees surfaces from behind.
#if LAYER == LAYER_NORMALS
        vec3 seen = deformed_normal(damage_at(rest_mm).bend, normal) * 0.5 + 0.5;
#elif LAYER == LAYER_ALL
        vec3 seen = exposure * interior(normal, rest_mm);
#elif LAYER == LAYER_REFLECTION
        vec3 seen = vec3(1.0);   // Maximum roughness.
#else
        vec3 seen = interior_albedo(normal, rest_mm);
#endif
        s = Shaded(seen, uint(container_id), 0u, depth, 1.0);
    }
    s.damage = uint(damage_reach[int(surface_id >> 10)].w);
    return s;
}
