// Shaded shade_mixed(ivec2 pixel, out bool at_body): a pixel whose samples see different surfaces, or the
// sky beside them. Its colour is display colour, or with RADIANCE exposed radiance. at_body: A surface
// is at the pixel's centre.

#include "lookups.constants"
#include "samples.constants"
#include "variant.constants"
#include "zones.constants"
#include "sample_lattice.glsl"
#include "shade_behind.glsl"
#include "shaded.glsl"
#include "surface_id.glsl"
#include "view_ray.glsl"
#include "visibility_buffer.glsl"
#include "zone_color.glsl"
#include "zone_sample.glsl"
#if LOOKUPS > 1
#include "material_mean.glsl"
#endif
#if WITH_HOLES
#include "shade_hole.glsl"
#endif

#if WITH_MIXED
Shaded shade_mixed(ivec2 pixel, out bool at_body) {
    vec2 center = vec2(pixel) + 0.5;
    ivec2 middle = center_texel(pixel);
    // Among the samples of the pixel filter, the material is evaluated once per zone, and lighting
    // once per surface id, which is an orientation within a zone.
    uint sample_ids[FILTER_SAMPLES] = filter_surface_ids(middle);
    uint left = 0u;   // One bit per sample that is still to be shaded.
    float behind_weight = 0.0;
    for (int i = 0; i < FILTER_SAMPLES; ++i) {
        if (sample_ids[i] == 0u) behind_weight += FILTER_WEIGHT[i];
        else left |= 1u << i;
#if WITH_HOLES
        int hole = hole_at(rest_at(middle + FILTER_OFFSET[i]));
        if (sample_ids[i] != 0u && hole >= 0 && !is_door_gear(id_zone(sample_ids[i])))
            sample_ids[i] = (HOLE_ZONE + 1u) | (uint(hole) << 10);
#endif
    }
    at_body = sample_ids[0] != 0u;
    Shaded behind = shade_behind(pixel, view_ray(center));
    Shaded s = behind;
    vec3 color = vec3(0.0);
    float done = 0.0;
    // Conditions are at the end of loops, because llvmpipe executes a body once more for a condition
    // at the start. At least one sample of a mixed pixel sees a surface.
    int zone_number = 0;
    do {
        uint first_id = 0u;
        ivec2 offset = ivec2(0);
        for (int i = FILTER_SAMPLES - 1; i >= 0; --i)
            if ((left & 1u << i) != 0u) { first_id = sample_ids[i]; offset = FILTER_OFFSET[i]; }
        uint zone = id_zone(first_id);
        uint of_zone = 0u;
        for (int i = 0; i < FILTER_SAMPLES; ++i)
            if (id_zone(sample_ids[i]) == zone) of_zone |= 1u << i;
        of_zone &= left;
        vec3 ray = view_ray(center + from_center(vec2(offset)));
        vec3 view = -normalize(ray);
        ZoneSample p = zone_sample(middle + offset, first_id, view);
#if LOOKUPS > 1
        // Lookups are at the first samples of the zone. Two lookups skip the first of three or more
        // samples, the centre if the zone covers it, so that they lie on either side.
        int found = bitCount(of_zone);
        uint others = LOOKUPS == 2 && found > 2 ? of_zone & (of_zone - 1u) : of_zone;
        SurfacePoint mean = empty_material_sum(p.surface);
        int lookup = 0, lookups = min(found, LOOKUPS);
        do {
            ivec2 at = offset;
            for (int i = FILTER_SAMPLES - 1; i >= 0; --i)
                if ((others & 1u << i) != 0u) at = FILTER_OFFSET[i];
            others &= others - 1u;   // Clears the lowest bit.
            add_material(mean, p, zone, texelFetch(atlas_positions, middle + at, 0).xy, float(lookups));
        } while (++lookup < lookups);
        p.surface = mean;
#endif
        bool at_center = zone_number == 0 && at_body;
        if (at_center) s = Shaded(vec3(0.0), p.id, p.damage, p.depth, 1.0);
        int orientation_number = 0;
        do {
            uint surface_id = 0u;
            ivec2 orientation_at = middle + offset;
            for (int i = FILTER_SAMPLES - 1; i >= 0; --i)
                if ((of_zone & 1u << i) != 0u) {
                    surface_id = sample_ids[i];
                    orientation_at = middle + FILTER_OFFSET[i];
                }
            float weight = 0.0;
            uint of_orientation = 0u;
            for (int i = 0; i < FILTER_SAMPLES; ++i)
                if (sample_ids[i] == surface_id) {
                    weight += FILTER_WEIGHT[i];
                    of_orientation |= 1u << i;
                }
            of_zone &= ~of_orientation;
            left &= ~of_orientation;
            vec3 ray_there = view_ray(sample_position(orientation_at));
            vec3 lit_color = zone_color(p, orientation_at, surface_id, ray_there, view);
#if WITH_HOLES
            if (zone == HOLE_ZONE) {
                Shaded through = shade_hole(middle + offset, surface_id, behind);
                lit_color = through.color;
                if (at_center && orientation_number == 0) s = through;
                if (through.id == 0u) {
                    behind_weight += weight;
                    weight = 0.0;
                }
            }
#endif
            color += weight * lit_color;
            done += weight;
        } while (++orientation_number < MAX_ORIENTATIONS && of_zone != 0u);
    } while (++zone_number < MAX_PIXEL_ZONES && left != 0u);
    // Surfaces beyond MAX_PIXEL_ZONES and MAX_ORIENTATIONS look like the rest.
    float share = behind_weight / (behind_weight + done);
    s.color = blend_over(color / max(done, 1e-6), behind, share);
    s.cover = 1.0 - share * (1.0 - behind.cover);
    return s;
}
#endif
