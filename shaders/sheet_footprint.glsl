// Footprint sheet_footprint(uint zone, vec3 normal, vec3 view, float depth): part of a sheet that one lookup
// of the decals averages. view: Unit, toward the eye. depth: In m.

#include "lookups.constants"
#include "zones.constants"
#include "scene.block"
#include "view.block"
#include "footprint.glsl"
#include "zone.glsl"

// Widths of a pixel between which the plane of the face replaces the local normal. A wide pixel covers
// flats and slopes of a corrugation alike.
const float LOCAL_MM = 20.0;
const float MEAN_MM = 80.0;
// Longest distance, relative to the margin of decals, beyond which the tables list no decals.
const float MOST_MARGINS = 1.5;

Footprint sheet_footprint(uint zone, vec3 normal, vec3 view, float depth) {
    vec4 part = texelFetch(zone_table, ivec2(int(zone), 1), 0);
    float stretch = texelFetch(zone_table, ivec2(int(zone), 2), 0).w;
    float depth_mm = 1000.0 * depth;
    float mean = smoothstep(LOCAL_MM, MEAN_MM, depth_mm * pixel_angle);
    vec3 n = normalize(mix(normal, part.yzw, mean));
    vec3 up = abs(part.w) > 0.5 ? vec3(0.0, 1.0, 0.0) : vec3(0.0, 0.0, 1.0);
    vec3 right = cross(up, part.yzw);
    // The surface unfolds along the edges of its corrugation.
    bool along_y = sheet_number(int(part.x)) == CORRUGATED_ALONG_Y;
    vec3 u, v;
    if (along_y) {
        v = normalize(up - n * dot(n, up));
        u = cross(v, n);
    } else {
        u = normalize(right - n * dot(n, right));
        v = cross(n, u);
    }
    float facing = max(dot(n, view), 0.05);
    vec3 moved_right = depth_mm * (ray_right - view * (dot(n, ray_right) / facing));
    vec3 moved_down = depth_mm * (ray_down - view * (dot(n, ray_down) / facing));
    mat2 pixel_mm = mat2(dot(u, moved_right), dot(v, moved_right), dot(u, moved_down), dot(v, moved_down));
    float longer = mix(1.0, stretch, mean);
    vec2 unfolded = along_y ? vec2(1.0, longer) : vec2(longer, 1.0);
    vec2 to_right = pixel_mm[0] * unfolded, to_down = pixel_mm[1] * unfolded;
    float most = MOST_MARGINS * decal_margin_mm;
    mat2 lookup_mm = DECAL_PX * mat2(to_right * min(1.0, most / length(to_right)),
                                     to_down * min(1.0, most / length(to_down)));
    float tilt = dot(along_y ? up : right, view) / max(dot(part.yzw, view), 0.05);
    return footprint_of(lookup_mm, vec3(stretch, stretch * tilt, mean));
}
