// Gives pixels that cables cover in part, and in which nothing but sky is seen beside them, the class
// of cables, though perhaps all their samples see sky, or the cable.
#version 430 core
#include "blocks.glsl"
#include "octahedral.glsl"
#include "samples.glsl"
#include "keys_around.glsl"
#include "lens.glsl"
#include "view_ray.glsl"
#include "cables.glsl"

void main() {
    ivec2 middle = middle_of(ivec2(gl_FragCoord.xy));
    uint keys[FILTER_NEAR] = keys_near(middle);
    bool bare = true;
    for (int i = 0; i < FILTER_NEAR; ++i)
        bare = bare && (keys[i] == 0u || float(key_zone(keys[i])) == cable_zone);
    if (!bare || abs(cables_cover(gl_FragCoord.xy) - 0.5) > 0.496) discard;
    gl_FragDepth = CLASS_DEPTH_STEP * float(CLASS_CABLE);
}
