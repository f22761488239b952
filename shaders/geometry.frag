// Fragment stage of the geometry pass: writes the visibility buffer, which later passes shade.
// Reads the interpolated atlas position, sky visibility and rest position. Writes surface id, atlas
// position, depth, sky visibility and light, and the rest position if there is damage.
#version 430 core
#include "variant.constants"
#if HOLED
#include "surface_id.glsl"
#include "damage_law.glsl"
#include "zone.glsl"
#endif

in vec2 atlas_mm;
in vec4 sky_visibility;
in vec4 sky_light;
flat in uint surface_id;

layout(location = 0) out uint out_surface_id;
layout(location = 1) out vec2 out_atlas_mm;   // Atlas x, y in mm.
layout(location = 2) out float out_depth;  // In m.
layout(location = 3) out uint out_sky_visibility;   // Cone of visible sky, as sky_visibility.py encodes it,
                                              // and share of open sky about the mirror direction.
layout(location = 4) out uint out_sky_light;      // Light from the cone, by the same module.
#if DAMAGED
in vec3 rest_mm;

layout(location = 5) out float out_rest_x;   // Rest position in mm.
layout(location = 6) out float out_rest_y;
layout(location = 7) out float out_rest_z;
#endif

// The result of packUnorm4x8 in fewer instructions.
uint pack_bytes(vec4 v) {
    ivec4 steps = clamp(ivec4(fma(v, vec4(255.0), vec4(0.5))), 0, 255);
    return uint(steps.x | (steps.y << 8) | (steps.z << 16) | (steps.w << 24));
}

void main() {
#if HOLED
    // This program draws the inner view, which holes reveal, so it discards torn sheet. The outer view
    // keeps torn sheet to mark the hole.
    if (hole_at(rest_mm) >= 0 && !is_door_gear(id_zone(surface_id))) discard;
#endif
    out_surface_id = surface_id;
    out_atlas_mm = atlas_mm;
    // gl_FragCoord.w is 1 / clip w, and clip w is the depth along the optical axis. Unlike the depth
    // buffer it is not quantized.
    out_depth = 1.0 / gl_FragCoord.w;
    out_sky_visibility = pack_bytes(sky_visibility);
    out_sky_light = pack_bytes(sky_light);
#if DAMAGED
    out_rest_x = rest_mm.x;
    out_rest_y = rest_mm.y;
    out_rest_z = rest_mm.z;
#endif
}
