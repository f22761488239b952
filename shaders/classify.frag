// Writes each pixel's class as its depth, so that the depth test picks who is shaded by what, and what
// is known of its labels already: decals, damages and holes are found where they are shaded.
// llvmpipe runs both sides of every branch in a shader; the depth test is the branch that it takes.
#version 430 core
#extension GL_ARB_derivative_control : enable
#include "blocks.glsl"
#include "octahedral.glsl"
#include "decal_cell.glsl"
#include "samples.glsl"
#include "keys_around.glsl"
#if DAMAGED
#include "damage.glsl"
#include "rest.glsl"
#endif

uniform sampler2D sheet_points;
uniform sampler2D sheet_depths;

layout(location = 1) out uint out_labels;   // object id | damage value << 16
layout(location = 2) out float out_depth;   // m

bool bears_decals(uint key, ivec2 sample_at) {
    return key != 0u && cell_at(key_zone(key), texelFetch(sheet_points, sample_at, 0).xy).x != 0u;
}

void main() {
    ivec2 middle = middle_of(ivec2(gl_FragCoord.xy));
    uint keys[FILTER_NEAR] = keys_near(middle);
    uint key = keys[0];
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
    bool decal = bears_decals(key, middle) || bears_decals(first, first_at) || bears_decals(last, last_at);
    int found = mixed ? CLASS_MIXED : key == 0u ? CLASS_SKY : CLASS_PLAIN;
    if (decal) ++found;   // programs.PIXEL_CLASSES has the one with decals next
#if DAMAGED
    vec3 rest_mm = rest_at(middle);
    int near = 0;   // 1 near a damage, 2 near a hole
    for (int i = next_near(0, damage_count, rest_mm); i < damage_count;
         i = next_near(i + 1, damage_count, rest_mm))
        if (key != 0u && within_reach(i, rest_mm)) near = max(near, i < hole_count ? 2 : 1);
    if (near > 0) found = mixed ? CLASS_MIXED_DAMAGED : CLASS_DAMAGED;
#if HOLED
    if (near > 1) found = CLASS_HOLED;
#endif
#endif
#if COARSE && defined(GL_ARB_derivative_control)
    // where two by two pixels see one facet alone, the first is shaded for all; fragments run so, and
    // derivatives tell what is alike (as floats that hold all bits of a key, in two parts). Facets that
    // face one way share a key: a step over the sheet tells of what lies hidden between them
    vec3 known = vec3(key & 0xffffu, key >> 16, found);
    vec2 sheet_mm = texelFetch(sheet_points, middle, 0).xy;
    vec2 step_mm = abs(dFdxFine(sheet_mm)) + abs(dFdyFine(sheet_mm));
    float most_mm = COARSE_STEP_PX * 1000.0 * pixel_angle * texelFetch(sheet_depths, middle, 0).r;
    bool alike = abs(dFdxFine(known)) + abs(dFdyFine(known)) == vec3(0.0);
    float one = float(found == CLASS_PLAIN && alike && max(step_mm.x, step_mm.y) < most_mm);
    float row = one * float(dFdxFine(one) == 0.0);
    float block = row * float(dFdyFine(row) == 0.0);
    if (block > 0.0) found = ivec2(gl_FragCoord.xy) % 2 == ivec2(0) ? CLASS_COARSE : CLASS_WITHIN;
#endif
    gl_FragDepth = CLASS_DEPTH_STEP * float(found);
    out_labels = key == 0u                        ? 0u
                 : key_zone(key) >= SPREADER_ZONE ? SPREADER_ID
                                                  : CONTAINER_ID | (SOUND_CONTAINER << 16);
    out_depth = key == 0u ? VOID_DEPTH : texelFetch(sheet_depths, middle, 0).r;
}
