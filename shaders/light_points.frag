// Points of surfaces that rays are cast from, two a cell of a grid over the image. Upper half: what the
// middle pixel of the cell sees, if that is a surface. Lower half: another surface among the samples of
// that pixel and those of the cell beside it, if any, by turns the first and the last.
#version 430 core
#include "blocks.glsl"
#include "shade.glsl"

uniform int point_rows;     // of cells
uniform ivec2 last_pixel;   // of the image

layout(location = 0) out uint out_key;    // 0 for none
layout(location = 1) out vec4 out_place;  // from the eye in m; perceptual roughness
layout(location = 2) out vec4 out_normal;

void main() {
    ivec2 cell = ivec2(gl_FragCoord.xy);
    bool other = cell.y >= point_rows;
    if (other) cell.y -= point_rows;
    ivec2 pixel = cell * point_step + point_step / 2;
    ivec2 sample_at = middle_of(pixel);
    uint key = key_at(sample_at);
    if (other) {
        uint first = key;
        bool last = ((cell.x + cell.y) & 1) == 1;
        key = 0u;
        // no pixel beyond the next, nor outside the image: there the targets hold what was drawn before
        ivec2 before = -ivec2(min(point_step / 2, 1));
        ivec2 after = min(ivec2(min((point_step - 1) / 2, 1)), last_pixel - pixel);
        for (int y = before.y; y <= after.y; ++y) {
            for (int x = before.x; x <= after.x; ++x) {
                ivec2 middle = middle_of(pixel + ivec2(x, y));
                uint keys[FILTER_NEAR] = keys_near(middle);
                for (int i = 0; i < FILTER_NEAR; ++i) {
                    if (keys[i] == 0u || keys[i] == first || (key != 0u && !last)) continue;
                    key = keys[i];
                    sample_at = middle + FILTER_OFFSET[i];
                }
            }
        }
    }
    vec3 ray = view_ray(place_of(sample_at));
    Part p = part_at(sample_at, key, -normalize(ray));
    vec3 normal = key_normal(key);
#if WITH_DAMAGE
    normal = bent_normal(p.bend, normal);
#endif
#if HOLED
    if (hole_at(rest_at(sample_at)) >= 0 && !before_sheet(key_zone(key))) key = 0u;
#endif
    out_key = key;
    out_place = vec4(p.depth * ray, p.surface.material.roughness);
    out_normal = vec4(normal, 0.0);
}
