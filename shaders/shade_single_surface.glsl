// Shaded shade_single_surface(ivec2 pixel): a pixel whose near samples all see the same surface.

#include "lookups.constants"
#include "samples.constants"
#include "shaded.glsl"
#include "view_ray.glsl"
#include "zone_color.glsl"
#if LOOKUPS > 1
#include "material_mean.glsl"
#endif

Shaded shade_single_surface(ivec2 pixel) {
    ivec2 middle = center_texel(pixel);
    uint surface_id = surface_id_at(middle);
    vec3 ray = view_ray(vec2(pixel) + 0.5);
    vec3 view = -normalize(ray);
    ZoneSample p = zone_sample(middle, surface_id, view);
#if LOOKUPS > 1
    // The surface is nearly flat between the centre sample and two other near samples, so the atlas
    // position is linear in the pixel.
    const ivec2 one = ivec2(FILTER_STEP), other = ivec2(FILTER_STEP, -FILTER_STEP);
    const mat2 pixels = mat2(from_center(vec2(one)), from_center(vec2(other)));
    vec2 atlas_mm = texelFetch(atlas_positions, middle, 0).xy;
    mat2 moved_mm = mat2(texelFetch(atlas_positions, middle + one, 0).xy - atlas_mm,
                         texelFetch(atlas_positions, middle + other, 0).xy - atlas_mm);
    mat2 mm_of_pixel = moved_mm * inverse(pixels);
    SurfacePoint mean = empty_material_sum(p.surface);
    for (int i = 0; i < LOOKUPS; ++i)
        add_material(mean, p, id_zone(surface_id), atlas_mm + mm_of_pixel * LOOKUP_PLACE[i], float(LOOKUPS));
    p.surface = mean;
#endif
    return Shaded(zone_color(p, middle, surface_id, ray, view), p.id, p.damage, p.depth, 1.0);
}
