// Vertex stage of texture export: places the rest mesh at its atlas positions.
// Reads rest position, atlas position and zone; passes them to bake.frag. Instance 0 draws the mesh.
// Later instances draw it shifted, which fills a gutter of up to two texels around each part: texture
// filtering at a part's border must not pick up the background.
#version 430 core
#include "bake.constants"
#include "variant.constants"

#if DAMAGED
layout(location = 0) in vec3 in_position_mm;
#endif
layout(location = 1) in vec2 in_atlas_mm;
layout(location = 2) in uint in_zone;

uniform vec4 atlas_to_clip;                 // Scale (xy) and offset (zw).
uniform vec2 gutter_clip[GUTTER_STEPS];     // Shift of each instance: zero first, then outward.

out vec2 atlas_mm;
#if DAMAGED
out vec3 rest_mm;
#endif
flat out uint zone;

void main() {
    atlas_mm = in_atlas_mm;
#if DAMAGED
    rest_mm = in_position_mm;
#endif
    zone = in_zone;
    vec2 place = in_atlas_mm * atlas_to_clip.xy + atlas_to_clip.zw + gutter_clip[gl_InstanceID];
    // Depth grows with the instance, so a gutter never covers a part.
    gl_Position = vec4(place, 2.0 * float(gl_InstanceID) / float(GUTTER_STEPS) - 1.0, 1.0);
}
