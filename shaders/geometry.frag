// Fragment stage of the geometry draw: which surface, where on its sheet, how far. Shading comes later.
#version 430 core
#include "blocks.glsl"
#if HOLED
#include "octahedral.glsl"
#include "damage.glsl"
#include "zone.glsl"
#endif

in vec2 atlas_mm;
in vec4 openness;
in vec4 sky_light;
flat in uint surface_key;

layout(location = 0) out uint out_key;
layout(location = 1) out vec2 out_sheet;   // sheet x, y in mm
layout(location = 2) out float out_depth;  // m
layout(location = 3) out uint out_openness;   // a cone as openness.py encodes it, and the share of
                                              // open sky about the mirrored ray
layout(location = 4) out uint out_light;      // from the cone, as openness.py encodes it
#if DAMAGED
in vec3 rest_mm;

layout(location = 5) out float out_rest_x;   // rest position in mm
layout(location = 6) out float out_rest_y;
layout(location = 7) out float out_rest_z;
#endif

// packUnorm4x8, for less
uint four_bytes(vec4 v) {
    ivec4 steps = clamp(ivec4(fma(v, vec4(255.0), vec4(0.5))), 0, 255);
    return uint(steps.x | (steps.y << 8) | (steps.z << 16) | (steps.w << 24));
}

void main() {
#if HOLED
    // seen from outside torn sheet marks the hole, from inside it is not there
    if (hole_at(rest_mm) >= 0 && !before_sheet(key_zone(surface_key))) discard;
#endif
    out_key = surface_key;
    out_sheet = atlas_mm;
    // 1 / w is the depth along the optical axis, free of the depth buffer's rounding
    out_depth = 1.0 / gl_FragCoord.w;
    out_openness = four_bytes(openness);
    out_light = four_bytes(sky_light);
#if DAMAGED
    out_rest_x = rest_mm.x;
    out_rest_y = rest_mm.y;
    out_rest_z = rest_mm.z;
#endif
}
