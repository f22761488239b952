// Compute stage that shades the listed pixels of one pixel class.
// Reads the list, the visibility buffer, material tables and lights. Writes colour and
// coverage, labels near decals and damages, and depth near holes.
#version 430 core
#include "lookups.constants"
#include "materials.constants"
#include "pixel_list.constants"
#include "samples.constants"
#include "variant.constants"
#include "zones.constants"
#include "scene.block"
#include "view.block"
#include "shade.glsl"
#include "output_images.glsl"
#include "pixel_list.glsl"
#if CABLE_CLASS
#include "cables.glsl"
#endif

layout(local_size_x = LIST_GROUP) in;

#if CABLE_CLASS
// A pixel that cables cover in part: steel with its mean rust, mixed with the sky by coverage. The eye
// sees two of a cable's four axis-aligned sides, each in proportion to how it faces the eye.
Shaded cable(vec2 center) {
    vec3 ray = view_ray(center);
    vec3 view = -normalize(ray);
    vec4 base = material_base[CABLE_MATERIAL];
    Material steel = Material(base.rgb, base.a, material_trait[CABLE_MATERIAL].x);
#if SHOWN_RUST
    steel.albedo = cable_mean_rust.rgb;
    steel.roughness = mix(steel.roughness, rust_roughness, cable_mean_rust.a);
    steel.metallic *= 1.0 - cable_mean_rust.a;
#endif
    wet(steel.albedo, steel.roughness, steel.metallic, 0.8 * wetness);   // The mean in material.glsl.
    vec3 color = vec3(0.0);
    for (int axis = 0; axis < 2; ++axis) {
        vec3 normal = vec3(0.0);
        normal[axis] = view[axis] < 0.0 ? -1.0 : 1.0;
        SkyVisibility whole = SkyVisibility(normal, 0.0, vec3(1.0), 1.0, 1.0, 0.0, vec3(0.0), steel.albedo,
                                  NO_TRACED_LIGHT);
        color += abs(view[axis]) * layer_color(steel, normal, view, whole, vec4(1.0));
    }
    color /= max(abs(view.x) + abs(view.y), 1e-6);
    Shaded s = sky(ray);
    s.cover = cable_coverage(center);
    s.color = mix(s.color, color, s.cover);
    return s;
}
#endif

void main() {
    if (gl_GlobalInvocationID.x >= pixels_listed()) return;
    uint entry = listed_at(gl_GlobalInvocationID.x);
    ivec2 pixel = listed_pixel(entry);
#if WITH_COARSE
    uint group = listed_group(entry);
    int first = findLSB(group);
    ivec2 block = pixel;
    pixel += in_group(first);
    coarse_offset = in_group(findMSB(group)) - in_group(first);
    coarse_pixels = float(bitCount(group));
#endif
#if WITH_MIXED
    vec2 center = vec2(pixel) + 0.5;
    ivec2 middle = center_texel(pixel);
    // Among the samples of the pixel filter, the material is evaluated once per zone, and lighting
    // once per surface id, which is an orientation within a zone.
    uint keys[FILTER_SAMPLES] = filter_surface_ids(middle);
    uint left = 0u;   // One bit per sample that is still to be shaded.
    float sky_weight = 0.0;
    for (int i = 0; i < FILTER_SAMPLES; ++i) {
        if (keys[i] == 0u) sky_weight += FILTER_WEIGHT[i];
        else left |= 1u << i;
#if WITH_HOLES
        int hole = hole_at(rest_at(middle + FILTER_OFFSET[i]));
        if (keys[i] != 0u && hole >= 0 && !before_sheet(id_zone(keys[i])))
            keys[i] = (HOLE_ZONE + 1u) | (uint(hole) << 10);
#endif
    }
    bool sees_sky = keys[0] == 0u;
    Shaded s = sky(view_ray(center));
    vec3 color = sky_weight * s.color;
    float done = sky_weight;
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
        Part p = part_at(middle + offset, first_key, view);
#if LOOKUPS > 1
        // Lookups are at the first samples of the zone. Two lookups skip the first of three or more
        // samples, the centre if the zone covers it, so that they lie on either side.
        int found = bitCount(of_part);
        uint others = LOOKUPS == 2 && found > 2 ? of_part & (of_part - 1u) : of_part;
        SurfacePoint mean = no_layers(p.surface);
        int lookup = 0, lookups = min(found, LOOKUPS);
        do {
            ivec2 at = offset;
            for (int i = FILTER_SAMPLES - 1; i >= 0; --i)
                if ((others & 1u << i) != 0u) at = FILTER_OFFSET[i];
            others &= others - 1u;   // Clears the lowest bit.
            add_layers(mean, p, zone, texelFetch(atlas_positions, middle + at, 0).xy, float(lookups));
        } while (++lookup < lookups);
        p.surface = mean;
#endif
        bool at_center = part == 0 && !sees_sky;
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
            vec3 lit_color = part_color(p, middle + side_offset, key, view);
#if WITH_HOLES
            if (zone == HOLE_ZONE) {
                Shaded through = through_hole(middle + offset, key, ray);
                lit_color = through.color;
                if (through.cover == 0.0) sky_weight += weight;
                if (at_center && side == 0) s = through;
            }
#endif
            color += weight * lit_color;
            done += weight;
        } while (++side < MAX_ORIENTATIONS && of_part != 0u);
    } while (++part < MAX_PARTS && left != 0u);
    color /= done;   // Surfaces beyond MAX_PARTS and MAX_ORIENTATIONS look like the rest.
    s.cover = 1.0 - sky_weight / done;
#elif CABLE_CLASS
    Shaded s = cable(vec2(pixel) + 0.5);
    vec3 color = s.color;
#else
    Shaded s = single_surface(pixel);
    vec3 color = s.color;
#endif
#if RADIANCE
    vec4 shown = vec4(color, s.cover);
#else
    uvec4 shown = uvec4(packUnorm4x8(vec4(displayed(color), s.cover)));
#endif
#if WITH_COARSE
    for (int i = 0; i < 4; ++i)
        if ((group & 1u << i) != 0u) imageStore(color_image, block + in_group(i), shown);
#else
    imageStore(color_image, pixel, shown);
#endif
    // For other classes classify.comp has written labels and depth.
#if WITH_DECALS || WITH_DAMAGE
    imageStore(label_image, pixel, uvec4(s.id | (s.damage << 16)));
#endif
#if WITH_HOLES
    imageStore(depth_image, pixel, vec4(s.depth));
#endif
}
