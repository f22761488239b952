// Compute stage that sorts every pixel that sees more than sky into the list of its pixel class.
// Reads the visibility buffer, decal cells and damages. Writes the lists, and label and depth of each
// pixel whose centre sees a surface. shade.comp overwrites labels near decals and damages.
// The lists replace branches: Mesa's CPU driver llvmpipe executes both sides of every branch.
#version 430 core
#include "labels.constants"
#include "pixel_list.constants"
#include "samples.constants"
#include "variant.constants"
#include "scene.block"
#include "damage.block"
#include "surface_id.glsl"
#include "zone_id.glsl"
#include "decals_near.glsl"
#include "sample_lattice.glsl"
#include "visibility_buffer.glsl"
#include "pixel_list.glsl"
#include "output_images.glsl"
#if DAMAGED
#include "damage_law.glsl"
#include "rest_position.glsl"
#endif

layout(local_size_x = LIST_GROUP) in;

uniform ivec4 region;   // Corner x, y, width and height in pixels.

#if DAMAGED
// 2 where samples of the pixel see a hole, 1 near any damage, else 0. The class of holes filters the
// material differently. Pixels beside a hole are not in it, because this would reveal the hole.
int damage_near(vec3 rest_mm, ivec2 middle) {
    int near = 0, samples = 0;
    for (int i = next_damage_near(0, damage_count, rest_mm); i < damage_count;
         i = next_damage_near(i + 1, damage_count, rest_mm))
        if (within_reach(i, rest_mm)) {
            near = 1;
            samples = i < hole_count ? FILTER_SAMPLES : samples;
        }
    for (int i = 0; i < samples; ++i)
        if (hole_at(rest_at(middle + FILTER_OFFSET[i])) >= 0) near = 2;
    return near;
}
#endif

// Column and row of this invocation in a grid of size.x by size.y, counted row by row. Surplus
// invocations get a row of size.y or more.
ivec2 in_turn(ivec2 size) {
    int number = int(gl_GlobalInvocationID.x);
    int row = int(float(number) / float(size.x));
    // Rounding may move the first or last cell of a row into the neighbouring row.
    int column = number - row * size.x;
    if (column < 0) --row;
    if (column >= size.x) ++row;
    return ivec2(number - row * size.x, row);
}

void write_labels(ivec2 pixel, uint surface_id, float depth) {
    uint labels = zone_id(id_zone(surface_id));
    if (labels != SPREADER_ID) labels |= uint(undamaged_value) << 16;
    imageStore(label_image, pixel, uvec4(labels));
    imageStore(depth_image, pixel, vec4(depth));
}

// Offset of a bit's pixel in a 2x2 block.
ivec2 in_block(int bit) { return ivec2(bit & 1, bit >> 1); }

// Reserves room in a list for the pixels of a 2x2 block whose bits are set.
uint room_for(uint bits, uint list) {
    if (bits == 0u) return 0u;
    return listed(list, bitCount(bits));
}

// Adds the pixels of a 2x2 block to lists. Bit i of each argument puts pixel i into the list of a class.
void list_block(ivec2 block, uint plain, uint decals, uint mixed, uint mixed_decals, uint damaged,
                uint mixed_damaged, uint holed) {
    uint bits[7] = uint[7](plain, decals, mixed, mixed_decals, damaged, mixed_damaged, holed);
    uint next[7] = uint[7](room_for(plain, LIST_PLAIN), room_for(decals, LIST_DECAL),
                           room_for(mixed, LIST_MIXED), room_for(mixed_decals, LIST_MIXED_DECAL),
                           room_for(damaged, LIST_DAMAGED), room_for(mixed_damaged, LIST_MIXED_DAMAGED),
                           room_for(holed, LIST_HOLED));
    for (int i = 0; i < 4; ++i) {
        uint lists = 0u, at = 0u;
        for (int k = 0; k < 7; ++k) {
            uint bit = bits[k] >> i & 1u;
            at = bit != 0u ? next[k] : at;
            next[k] += bit;
            lists += bit;
        }
        if (lists != 0u) list_entries[at] = list_entry(block + in_block(i));
    }
}

#if SAMPLES_PER_AXIS > 1
// List of a pixel, or NO_LIST, from the samples near its centre. center_id: Surface id of the centre.
uint list_of(ivec2 middle, out uint center_id) {
    uint sample_ids[FILTER_NEAR] = near_surface_ids(middle);
    center_id = sample_ids[0];
    bool mixed = false;
    // Test three zones for decals: that of the centre, and the first and the last other one. Few
    // pixels see a fourth.
    uint first = center_id, last = center_id;
    ivec2 first_at = middle, last_at = middle;
    for (int i = 1; i < FILTER_NEAR; ++i) {
        mixed = mixed || sample_ids[i] != center_id;
        if (id_zone(sample_ids[i]) == id_zone(center_id)) continue;
        last = sample_ids[i];
        last_at = middle + FILTER_OFFSET[i];
        if (first == center_id) { first = last; first_at = last_at; }
    }
    uint tested_id = center_id;
    ivec2 tested_at = middle;
    bool decal = false;
    int zones = first == center_id ? 1 : first_at == last_at ? 2 : 3, tested = 0;
    do {
        vec2 atlas_mm = texelFetch(atlas_positions, tested_at, 0).xy;
        decal = decal || (tested_id != 0u && near_decals(id_zone(tested_id), atlas_mm));
        tested_id = tested == 0 ? first : last;
        tested_at = tested == 0 ? first_at : last_at;
    } while (++tested < zones);
    uint list = center_id == 0u ? NO_LIST : decal ? LIST_DECAL : LIST_PLAIN;
    if (mixed) list = decal ? LIST_MIXED_DECAL : LIST_MIXED;
#if DAMAGED
    int near = center_id != 0u ? damage_near(rest_at(middle), middle) : 0;
    if (near > 0) list = mixed ? LIST_MIXED_DAMAGED : LIST_DAMAGED;
    if (near > 1) list = LIST_HOLED;
#endif
    return list;
}

// One invocation classifies a 2x2 block. Each list grows once, and pixels that the driver shades at once
// are more alike than those of a row.
void main() {
    ivec2 in_region = 2 * in_turn((region.zw + 1) / 2);
    if (in_region.y >= region.w) return;
    ivec2 block = region.xy + in_region;
    uint plain = 0u, decals = 0u, mixed = 0u, mixed_decals = 0u;   // One bit per pixel and class.
    uint damaged = 0u, mixed_damaged = 0u, holed = 0u;
    int i = 0;
    do {
        ivec2 pixel = block + in_block(i);
        if (any(greaterThanEqual(pixel - region.xy, region.zw))) continue;
        ivec2 middle = center_texel(pixel);
        uint center_id, list = list_of(middle, center_id), bit = 1u << i;
        if (center_id != 0u) write_labels(pixel, center_id, texelFetch(surface_depths, middle, 0).r);
        plain |= list == LIST_PLAIN ? bit : 0u;
        decals |= list == LIST_DECAL ? bit : 0u;
        mixed |= list == LIST_MIXED ? bit : 0u;
        mixed_decals |= list == LIST_MIXED_DECAL ? bit : 0u;
#if DAMAGED
        damaged |= list == LIST_DAMAGED ? bit : 0u;
        mixed_damaged |= list == LIST_MIXED_DAMAGED ? bit : 0u;
        holed |= list == LIST_HOLED ? bit : 0u;
#endif
    } while (++i < 4);
    list_block(block, plain, decals, mixed, mixed_decals, damaged, mixed_damaged, holed);
}
#else
// One invocation classifies a 2x2 block, so that four gathers read it and each list grows once.
void main() {
    ivec2 in_region = 2 * in_turn((region.zw + 1) / 2);
    if (in_region.y >= region.w) return;
    ivec2 block = region.xy + in_region;
    vec2 middle = vec2(block + 1) / vec2(textureSize(surface_ids, 0));
    // The swizzle .wzxy reorders the texels of textureGather as in_block counts them.
    uvec4 surface_id = textureGather(surface_ids, middle).wzxy;
    vec4 atlas_x = textureGather(atlas_positions, middle, 0).wzxy;
    vec4 atlas_y = textureGather(atlas_positions, middle, 1).wzxy;
    vec4 depth = textureGather(surface_depths, middle).wzxy;
#if DAMAGED
    vec4 rest_mm[3] = vec4[3](textureGather(rest_x, middle).wzxy, textureGather(rest_y, middle).wzxy,
                              textureGather(rest_z, middle).wzxy);
#endif
    uint plain = 0u, decals = 0u, damaged = 0u, holed = 0u;   // One bit per pixel and class.
    for (int i = 0; i < 4; ++i) {
        ivec2 pixel = block + in_block(i);
        if (any(greaterThanEqual(pixel - region.xy, region.zw)) || surface_id[i] == 0u) continue;
        write_labels(pixel, surface_id[i], depth[i]);
        uint bit = 1u << i;
#if DAMAGED
        int near = damage_near(vec3(rest_mm[0][i], rest_mm[1][i], rest_mm[2][i]), center_texel(pixel));
        if (near > 1) holed |= bit;
        if (near == 1) damaged |= bit;
        if (near > 0) continue;
#endif
        if (near_decals(id_zone(surface_id[i]), vec2(atlas_x[i], atlas_y[i]))) decals |= bit;
        else plain |= bit;
    }
    list_block(block, plain, decals, 0u, 0u, damaged, 0u, holed);
}
#endif
