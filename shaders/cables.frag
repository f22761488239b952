// Gives pixels that cables cover in part, and in which nothing but sky is seen beside them, the class
// of cables, though perhaps all their samples see sky, or the cable.
#version 430 core
#include "blocks.glsl"
#include "octahedral.glsl"
#include "keys_around.glsl"
#include "lens.glsl"
#include "view_ray.glsl"
#include "cables.glsl"

void main() {
    ivec2 middle = ivec2(gl_FragCoord.xy) * SAMPLES_PER_AXIS + SAMPLES_PER_AXIS / 2;
    uint keys[TENT_SAMPLES] = keys_around(middle);
    bool bare = true;
    for (int i = 0; i < TENT_SAMPLES; ++i)
        bare = bare && (keys[i] == 0u || float(key_chart(keys[i])) == cable_chart);
    if (!bare || abs(cables_cover(gl_FragCoord.xy) - 0.5) > 0.496) discard;
    gl_FragDepth = CLASS_DEPTH_STEP * float(CLASS_CABLE);
}
