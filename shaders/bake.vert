// Lays the rest mesh out on its atlas, once as it is and once for every texel of its gutter.
#version 430 core
#include "blocks.glsl"

#if DAMAGED
layout(location = 0) in vec3 in_position_mm;
#endif
layout(location = 1) in vec2 in_atlas_mm;
layout(location = 2) in uint in_zone;

uniform vec4 atlas_to_clip;                 // scale x, y, offset x, y
uniform vec2 gutter_clip[GUTTER_STEPS];     // the first is 0, nearer ones come first

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
    // a gutter lies behind the parts themselves
    gl_Position = vec4(place, 2.0 * float(gl_InstanceID) / float(GUTTER_STEPS) - 1.0, 1.0);
}
