// Lists the pixels that see more than sky by what is to be done there, and writes what is known of their
// labels already: decals, damages and holes are found where they are shaded.
// llvmpipe runs both sides of every branch in a shader; a list for each side is the branch it takes.
#version 430 core
#include "blocks.glsl"
#include "octahedral.glsl"
#include "decal_cell.glsl"
#include "samples.glsl"
#include "keys_around.glsl"
#include "pixel_list.glsl"
#if DAMAGED
#include "damage.glsl"
#include "rest.glsl"
#endif
#if CABLES_NEAR
#include "lens.glsl"
#include "view_ray.glsl"
#include "cables.glsl"
#endif

layout(local_size_x = LIST_GROUP) in;

uniform ivec4 region;   // x, y, width and height in pixels
uniform sampler2D sheet_points;
uniform sampler2D sheet_depths;

layout(r32ui, binding = 1) writeonly uniform uimage2D label_image;
layout(r32f, binding = 2) writeonly uniform image2D depth_image;

// what a pixel is listed as: NO_LIST where it sees sky alone
struct Seen {
    uint key;
    uint list;
};

bool bears_decals(uint key, ivec2 sample_at) {
    return key != 0u && cell_at(key_zone(key), texelFetch(sheet_points, sample_at, 0).xy).x != 0u;
}

Seen seen_at(ivec2 pixel) {
    ivec2 middle = middle_of(pixel);
    uint keys[FILTER_NEAR] = keys_near(middle);
    uint key = keys[0];
    bool decal = bears_decals(key, middle);
    uint list = key == 0u ? NO_LIST : decal ? LIST_DECAL : LIST_PLAIN;
#if SAMPLES_PER_AXIS > 1
    bool mixed = false;
    // the first and the last of other parts stand for all: few pixels see a fourth
    uint first = key, last = key;
    ivec2 first_at = middle, last_at = middle;
    for (int i = 1; i < FILTER_NEAR; ++i) {
        mixed = mixed || keys[i] != key;
        if (key_zone(keys[i]) == key_zone(key)) continue;
        last = keys[i];
        last_at = middle + FILTER_OFFSET[i];
        if (first == key) { first = last; first_at = last_at; }
    }
    decal = decal || bears_decals(first, first_at) || bears_decals(last, last_at);
    if (mixed) list = decal ? LIST_MIXED_DECAL : LIST_MIXED;
#endif
#if DAMAGED
    vec3 rest_mm = rest_at(middle);
    int near = 0;   // 1 near a damage, 2 near a hole
    for (int i = next_near(0, damage_count, rest_mm); i < damage_count;
         i = next_near(i + 1, damage_count, rest_mm))
        if (key != 0u && within_reach(i, rest_mm)) near = max(near, i < hole_count ? 2 : 1);
#if SAMPLES_PER_AXIS > 1
    if (near > 0) list = mixed ? LIST_MIXED_DAMAGED : LIST_DAMAGED;
#else
    if (near > 0) list = LIST_DAMAGED;
#endif
#if HOLED
    if (near > 1) list = LIST_HOLED;
#endif
#endif
#if CABLES_NEAR
    // in which nothing but sky is seen beside them, though perhaps all samples see sky, or the cable
    bool bare = true;
    for (int i = 0; i < FILTER_NEAR; ++i)
        bare = bare && (keys[i] == 0u || float(key_zone(keys[i])) == cable_zone);
    if (bare && abs(cables_cover(vec2(pixel) + 0.5) - 0.5) <= 0.496) list = LIST_CABLE;
#endif
    return Seen(key, list);
}

void write_labels(ivec2 pixel, uint key) {
    if (key == 0u) return;
    uint labels = key_zone(key) >= SPREADER_ZONE ? SPREADER_ID : CONTAINER_ID | (SOUND_CONTAINER << 16);
    imageStore(label_image, pixel, uvec4(labels));
    imageStore(depth_image, pixel, vec4(texelFetch(sheet_depths, middle_of(pixel), 0).r));
}

#if COARSE
// where two by two pixels see one facet alone, the first is shaded for all
void main() {
    ivec2 in_region = 2 * ivec2(gl_GlobalInvocationID.xy);
    if (in_region.x >= region.z) return;
    ivec2 pixel = region.xy + in_region;
    bool whole = all(lessThan(in_region + 1, region.zw));
    Seen seen[4];
    vec2 sheet_mm[4];
    for (int i = 0; i < 4; ++i) {
        ivec2 at = pixel + ivec2(i & 1, i >> 1);
        seen[i] = seen_at(at);
        sheet_mm[i] = texelFetch(sheet_points, at, 0).xy;
    }
    bool alike = whole;
    for (int i = 0; i < 4; ++i) {
        alike = alike && seen[i].key == seen[0].key && seen[i].list == LIST_PLAIN;
        // facets that face one way share a key: a step over the sheet tells of what lies hidden between
        vec2 step_mm = abs(sheet_mm[i ^ 1] - sheet_mm[i]) + abs(sheet_mm[i ^ 2] - sheet_mm[i]);
        float depth = texelFetch(sheet_depths, pixel + ivec2(i & 1, i >> 1), 0).r;
        alike = alike && max(step_mm.x, step_mm.y) < COARSE_STEP_PX * 1000.0 * pixel_angle * depth;
    }
    if (alike) list_pixel(LIST_COARSE, pixel);
    for (int i = 0; i < 4; ++i) {
        ivec2 at = pixel + ivec2(i & 1, i >> 1);
        if (any(greaterThanEqual(at - region.xy, region.zw))) continue;
        write_labels(at, seen[i].key);
        if (!alike && seen[i].list != NO_LIST) list_pixel(seen[i].list, at);
    }
}
#else
void main() {
    ivec2 in_region = ivec2(gl_GlobalInvocationID.xy);
    if (in_region.x >= region.z) return;
    ivec2 pixel = region.xy + in_region;
    Seen seen = seen_at(pixel);
    write_labels(pixel, seen.key);
    if (seen.list != NO_LIST) list_pixel(seen.list, pixel);
}
#endif
