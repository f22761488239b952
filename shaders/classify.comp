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

void write_labels(ivec2 pixel, uint key, float depth) {
    uint labels = zone_id(id_zone(key));
    if (labels != SPREADER_ID) labels |= uint(undamaged_value) << 16;
    imageStore(label_image, pixel, uvec4(labels));
    imageStore(depth_image, pixel, vec4(depth));
}

#if SAMPLES_PER_AXIS == 1
// Offset of a bit's pixel in a 2x2 block.
ivec2 in_block(int bit) { return ivec2(bit & 1, bit >> 1); }

// Adds each pixel of a 2x2 block whose bit is set to a list.
void list_each(uint list, ivec2 block, uint bits) {
    if (bits == 0u) return;
    uint at = listed(list, bitCount(bits));
    for (int i = 0; i < 4; ++i)
        if ((bits & 1u << i) != 0u) list_entries[at++] = list_entry(block + in_block(i));
}

// One invocation classifies a 2x2 block, so that four gathers read it and each list grows once.
void main() {
    ivec2 in_region = 2 * in_turn((region.zw + 1) / 2);
    if (in_region.y >= region.w) return;
    ivec2 block = region.xy + in_region;
    vec2 middle = vec2(block + 1) / vec2(textureSize(surface_ids, 0));
    // The swizzle .wzxy reorders the texels of textureGather as in_block counts them.
    uvec4 key = textureGather(surface_ids, middle).wzxy;
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
        if (any(greaterThanEqual(pixel - region.xy, region.zw)) || key[i] == 0u) continue;
        write_labels(pixel, key[i], depth[i]);
        uint bit = 1u << i;
#if DAMAGED
        int near = damage_near(vec3(rest_mm[0][i], rest_mm[1][i], rest_mm[2][i]), center_texel(pixel));
        if (near > 1) holed |= bit;
        if (near == 1) damaged |= bit;
        if (near > 0) continue;
#endif
        if (near_decals(id_zone(key[i]), vec2(atlas_x[i], atlas_y[i]))) decals |= bit;
        else plain |= bit;
    }
    list_each(LIST_PLAIN, block, plain);
    list_each(LIST_DECAL, block, decals);
#if DAMAGED
    list_each(LIST_DAMAGED, block, damaged);
    list_each(LIST_HOLED, block, holed);
#endif
}
#else
void main() {
    ivec2 in_region = in_turn(region.zw);
    if (in_region.y >= region.w) return;
    ivec2 pixel = region.xy + in_region;
    ivec2 middle = center_texel(pixel);
    uint keys[FILTER_NEAR] = near_surface_ids(middle);
    uint key = keys[0];
    bool mixed = false;
    // Test three zones for decals: that of the centre, and the first and the last other one. Few
    // pixels see a fourth.
    uint first = key, last = key;
    ivec2 first_at = middle, last_at = middle;
    for (int i = 1; i < FILTER_NEAR; ++i) {
        mixed = mixed || keys[i] != key;
        if (id_zone(keys[i]) == id_zone(key)) continue;
        last = keys[i];
        last_at = middle + FILTER_OFFSET[i];
        if (first == key) { first = last; first_at = last_at; }
    }
    uint part[3] = uint[3](key, first, last);
    ivec2 part_at[3] = ivec2[3](middle, first_at, last_at);
    bool decal = false;
    for (int i = 0; i < 3; ++i)
        decal = decal || (part[i] != 0u && near_decals(id_zone(part[i]),
                                                       texelFetch(atlas_positions, part_at[i], 0).xy));
    if (key != 0u) write_labels(pixel, key, texelFetch(surface_depths, middle, 0).r);
    uint list = key == 0u ? NO_LIST : decal ? LIST_DECAL : LIST_PLAIN;
    if (mixed) list = decal ? LIST_MIXED_DECAL : LIST_MIXED;
#if DAMAGED
    int near = key != 0u ? damage_near(rest_at(middle), middle) : 0;
    if (near > 0) list = mixed ? LIST_MIXED_DAMAGED : LIST_DAMAGED;
    if (near > 1) list = LIST_HOLED;
#endif
    if (list != NO_LIST) list_entries[listed(list, 1u)] = list_entry(pixel);
}
#endif
