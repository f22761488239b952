// Fragment stage that picks the points from which rays are cast: up to two per cell of a grid over
// the image. Reads the visibility buffer; writes surface id, position and normal of each point.
// The first point_rows rows hold the surface at the cell's middle pixel. The other rows hold another
// surface, if samples there or at adjacent pixels see one. Cells alternate between the first and the
// last such surface.
#version 430 core
#include "samples.constants"
#include "variant.constants"
#include "view.block"
#include "sample_lattice.glsl"
#include "surface_id.glsl"
#include "view_ray.glsl"
#include "visibility_buffer.glsl"
#include "zone_sample.glsl"

uniform int point_rows;     // Rows of cells over the image.
uniform ivec2 last_pixel;   // Column and row of the image's last pixel.

layout(location = 0) out uint out_surface_id;    // 0 for no point.
layout(location = 1) out vec4 out_position;  // Position relative to the eye in m; perceptual roughness.
layout(location = 2) out vec4 out_normal;

void main() {
    ivec2 cell = ivec2(gl_FragCoord.xy);
    bool other = cell.y >= point_rows;
    if (other) cell.y -= point_rows;
    ivec2 pixel = cell * point_step + point_step / 2;
    ivec2 sample_at = center_texel(pixel);
    uint surface_id = surface_id_at(sample_at);
    if (other) {
        uint first = surface_id;
        bool last = ((cell.x + cell.y) & 1) == 1;
        surface_id = 0u;
        // Neighbours are at most one pixel away and inside the image. Outside it the visibility buffer
        // holds earlier content.
        ivec2 before = -ivec2(min(point_step / 2, 1));
        ivec2 after = min(ivec2(min((point_step - 1) / 2, 1)), last_pixel - pixel);
        for (int y = before.y; y <= after.y; ++y) {
            for (int x = before.x; x <= after.x; ++x) {
                ivec2 middle = center_texel(pixel + ivec2(x, y));
                uint sample_ids[FILTER_NEAR] = near_surface_ids(middle);
                for (int i = 0; i < FILTER_NEAR; ++i) {
                    if (sample_ids[i] == 0u || sample_ids[i] == first || (surface_id != 0u && !last)) continue;
                    surface_id = sample_ids[i];
                    sample_at = middle + FILTER_OFFSET[i];
                }
            }
        }
    }
    vec3 ray = view_ray(sample_position(sample_at));
    ZoneSample p = zone_sample(sample_at, surface_id, -normalize(ray));
    vec3 normal = id_normal(surface_id);
#if WITH_DAMAGE
    normal = deformed_normal(p.bend, normal);
#endif
#if HOLED
    if (hole_at(rest_at(sample_at)) >= 0 && !is_door_gear(id_zone(surface_id))) surface_id = 0u;
#endif
    out_surface_id = surface_id;
    out_position = vec4(p.depth * ray, p.surface.material.roughness);
    out_normal = vec4(normal, 0.0);
}
