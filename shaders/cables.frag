// Makes pixels that cables cover in part ones of the class that has several surfaces, though all
// their samples see sky, or the cable.
#version 430 core
#include "blocks.glsl"
#include "octahedral.glsl"
#include "keys_around.glsl"
#include "lens.glsl"
#include "view_ray.glsl"
#include "cables.glsl"

void main() {
    ivec2 middle = ivec2(gl_FragCoord.xy) * SAMPLES_PER_AXIS + SAMPLES_PER_AXIS / 2;
    uint key = key_at(middle);
    float cover = cables_cover(gl_FragCoord.xy);
    bool thin = key == 0u || float(key_chart(key)) == cable_chart;
    if (!thin || abs(cover - 0.5) > 0.496) discard;
    gl_FragDepth = CLASS_DEPTH_STEP * float(CLASS_MIXED);
}
