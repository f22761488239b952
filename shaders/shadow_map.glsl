// float shadow_map_at(vec3 from_eye, int i): unshadowed share of directional light i at a point, 0..1,
// by one bilinear lookup.
// MainShadowPosition main_shadow_position(vec3 from_eye): where light 0 looks up a point.
// float shadow_lookup(vec3 at, vec4 tile): the lookup. from_eye: Vector from the eye to the point in m.

#include "view.block"

uniform sampler2DShadow shadow_map;   // One tile per light, and light 0's end tile.

// Texture coordinates and depth of a point in the tile of light i.
vec3 shadow_position(vec3 from_eye, int i) {
    return (ray_to_shadow[i] * vec4(from_eye, 1.0)).xyz;
}

// Points outside a tile are lit: lookups are clamped to its edge, where nothing is drawn.
float shadow_lookup(vec3 at, vec4 tile) {
    return textureLod(shadow_map, vec3(clamp(at.xy, tile.xy, tile.zw), at.z), 0.0);
}

// Position of a shadow lookup for light 0. A finer tile shows the end of the container on which the
// light shines.
struct MainShadowPosition {
    vec3 at;
    vec2 scale;   // Magnification relative to the first tile.
    vec4 tile;    // Bounds of lookups.
};

MainShadowPosition main_shadow_position(vec3 from_eye) {
    vec3 at = shadow_position(from_eye, 0);
    vec2 fine = fma(at.xy, shadow_end_transform.xy, shadow_end_transform.zw);
    bool end = all(greaterThan(fine, shadow_end_bounds.xy)) && all(lessThan(fine, shadow_end_bounds.zw)) &&
               shadow_end_plane.x * from_eye.x > shadow_end_plane.y;
    return end ? MainShadowPosition(vec3(fine, at.z), shadow_end_transform.xy, vec4(0.0, 0.0, 1.0, 1.0))
               : MainShadowPosition(at, vec2(1.0), shadow_tile[0]);
}

float shadow_map_at(vec3 from_eye, int i) {
    if (i > 0) return shadow_lookup(shadow_position(from_eye, i), shadow_tile[i]);
    MainShadowPosition found = main_shadow_position(from_eye);
    return shadow_lookup(found.at, found.tile);
}
