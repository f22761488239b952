// Vertex stage of the geometry pass: deforms the rest mesh by its damages and projects it.
// Reads rest position, normal, atlas position, zone and sky visibility of each vertex. Writes the
// surface id and what geometry.frag stores in the visibility buffer.
// constants.py and blocks.py generate the .constants and .block includes.
#version 430 core
#include "sky_visibility.constants"
#include "units.constants"
#include "variant.constants"
#include "view.block"
#include "octahedral.glsl"
#include "surface_id.glsl"
#include "lens.glsl"
#if DAMAGED
#include "damage_law.glsl"
#endif

layout(location = 0) in vec3 in_position_mm;
layout(location = 1) in vec3 in_normal;
layout(location = 2) in vec2 in_atlas_mm;
layout(location = 3) in uint in_zone;
layout(location = 5) in vec3 in_sky_cone;
layout(location = 6) in vec4 in_sky_light;
layout(location = 7) in uvec3 in_visible_directions;   // One bit per direction of sky_visibility.py.

out vec2 atlas_mm;
out vec4 sky_visibility;   // Cone; share of open sky about the mirror direction.
out vec4 sky_light;
flat out uint surface_id;
#if DAMAGED
out vec3 rest_mm;
#endif

// Different programs draw damaged and undamaged triangles. Positions must be equal to the bit, or
// gaps would open between them.
invariant gl_Position;

uniform usampler2D lobe_masks;   // See lobe_masks in sky_visibility.py.

// Bit mask of the directions about `direction`, or of the hemisphere about it if below = LOBE_CELLS.
uvec3 direction_mask(vec3 direction, int below) {
    ivec2 cell = min(ivec2(octahedral(direction) * float(LOBE_CELLS)), ivec2(LOBE_CELLS - 1));
    return texelFetch(lobe_masks, cell + ivec2(0, below), 0).xyz;
}

// Share of open sky about the mirror direction of the view ray.
float mirror_visibility(vec3 position_m, vec3 normal) {
    vec3 mirror = reflect(position_m - eye_m, normal);
    uvec3 lobe = direction_mask(mirror, 0) & direction_mask(normal, LOBE_CELLS);
    ivec3 whole = bitCount(lobe), open = bitCount(lobe & in_visible_directions);
    return float(open.x + open.y + open.z) / float(max(whole.x + whole.y + whole.z, 1));
}

void main() {
    atlas_mm = in_atlas_mm;
    sky_light = in_sky_light;
    surface_id = pack_surface_id(in_zone, in_normal);
    vec3 position_mm = in_position_mm;
#if DAMAGED
    rest_mm = in_position_mm;
    position_mm = deformed(in_position_mm);
#endif
    sky_visibility = vec4(in_sky_cone, mirror_visibility(position_mm * MM, in_normal));
    gl_Position = lens_distorted(world_to_clip * vec4(position_mm * MM, 1.0));
#if HOLED
    // Viewport 1 holds the inner view, which holes reveal. It is mirrored: that swaps front and back
    // faces, so face culling keeps the inner sides.
    gl_ViewportIndex = 1;
    gl_Position.x = -gl_Position.x;
#endif
}
