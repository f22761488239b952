// Compute stage that shades the listed pixels of one pixel class.
// Reads the list, the visibility buffer, material tables and lights. Writes colour and
// coverage, labels near decals and damages, and depth near holes.
#version 430 core
#include "lookups.constants"
#include "pixel_list.constants"
#include "samples.constants"
#include "variant.constants"
#include "zones.constants"
#include "display_color.glsl"
#include "output_images.glsl"
#include "pixel_list.glsl"
#include "shade_single_surface.glsl"
#include "shade_behind.glsl"
#include "view_ray.glsl"
#include "zone_color.glsl"
#if WITH_HOLES
#include "shade_hole.glsl"
#endif

layout(local_size_x = LIST_GROUP) in;

void main() {
    if (gl_GlobalInvocationID.x >= pixels_listed()) return;
    ivec2 pixel = listed_pixel(gl_GlobalInvocationID.x);
#if WITH_MIXED
    vec2 center = vec2(pixel) + 0.5;
    ivec2 middle = center_texel(pixel);
    // Among the samples of the pixel filter, the material is evaluated once per zone, and lighting
    // once per surface id, which is an orientation within a zone.
    uint keys[FILTER_SAMPLES] = filter_surface_ids(middle);
    uint left = 0u;   // One bit per sample that is still to be shaded.
    float behind_weight = 0.0;
    for (int i = 0; i < FILTER_SAMPLES; ++i) {
        if (keys[i] == 0u) behind_weight += FILTER_WEIGHT[i];
        else left |= 1u << i;
#if WITH_HOLES
        int hole = hole_at(rest_at(middle + FILTER_OFFSET[i]));
        if (keys[i] != 0u && hole >= 0 && !is_door_gear(id_zone(keys[i])))
            keys[i] = (HOLE_ZONE + 1u) | (uint(hole) << 10);
#endif
    }
    bool at_body = keys[0] != 0u;
    Shaded behind = shade_behind(pixel, view_ray(center));
    Shaded s = behind;
    vec3 color = vec3(0.0);
    float done = 0.0;
    // Conditions are at the end of loops, because llvmpipe executes a body once more for a condition
    // at the start. At least one sample of a mixed pixel sees a surface.
    int part = 0;
    do {
        uint first_key = 0u;
        ivec2 offset = ivec2(0);
        for (int i = FILTER_SAMPLES - 1; i >= 0; --i)
            if ((left & 1u << i) != 0u) { first_key = keys[i]; offset = FILTER_OFFSET[i]; }
        uint zone = id_zone(first_key);
        uint of_part = 0u;
        for (int i = 0; i < FILTER_SAMPLES; ++i)
            if (id_zone(keys[i]) == zone) of_part |= 1u << i;
        of_part &= left;
        vec3 ray = view_ray(center + from_center(vec2(offset)));
        vec3 view = -normalize(ray);
        ZoneSample p = zone_sample(middle + offset, first_key, view);
#if LOOKUPS > 1
        // Lookups are at the first samples of the zone. Two lookups skip the first of three or more
        // samples, the centre if the zone covers it, so that they lie on either side.
        int found = bitCount(of_part);
        uint others = LOOKUPS == 2 && found > 2 ? of_part & (of_part - 1u) : of_part;
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
        bool at_center = part == 0 && at_body;
        if (at_center) s = Shaded(vec3(0.0), p.id, p.damage, p.depth, 1.0);
        int side = 0;
        do {
            uint key = 0u;
            ivec2 side_offset = offset;
            for (int i = FILTER_SAMPLES - 1; i >= 0; --i)
                if ((of_part & 1u << i) != 0u) { key = keys[i]; side_offset = FILTER_OFFSET[i]; }
            float weight = 0.0;
            uint of_side = 0u;
            for (int i = 0; i < FILTER_SAMPLES; ++i)
                if (keys[i] == key) { weight += FILTER_WEIGHT[i]; of_side |= 1u << i; }
            of_part &= ~of_side;
            left &= ~of_side;
            ivec2 side_at = middle + side_offset;
            vec3 lit_color = zone_color(p, side_at, key, view_ray(sample_position(side_at)), view);
#if WITH_HOLES
            if (zone == HOLE_ZONE) {
                Shaded through = shade_hole(middle + offset, key, behind);
                lit_color = through.color;
                if (at_center && side == 0) s = through;
                if (through.id == 0u) {
                    behind_weight += weight;
                    weight = 0.0;
                }
            }
#endif
            color += weight * lit_color;
            done += weight;
        } while (++side < MAX_ORIENTATIONS && of_part != 0u);
    } while (++part < MAX_PARTS && left != 0u);
    // Surfaces beyond MAX_PARTS and MAX_ORIENTATIONS look like the rest.
    float share = behind_weight / (behind_weight + done);
    color = before(color / max(done, 1e-6), behind, share);
    s.cover = 1.0 - share * (1.0 - behind.cover);
#else
    Shaded s = shade_single_surface(pixel);
    vec3 color = display_color(s.color);
    const bool at_body = true;
#endif
#if RADIANCE
    vec4 shown = vec4(color, s.cover);
#else
    uvec4 shown = uvec4(packUnorm4x8(vec4(color, s.cover)));
#endif
    imageStore(color_image, pixel, shown);
    // For other classes classify.comp has written labels and depth.
#if OVER
    if (!at_body) return;   // What lies behind has its labels already.
#endif
#if WITH_DECALS || WITH_DAMAGE
    imageStore(label_image, pixel, uvec4(s.id | (s.damage << 16)));
#endif
#if WITH_HOLES
    imageStore(depth_image, pixel, vec4(s.depth));
#endif
}
