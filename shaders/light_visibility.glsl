// vec4 light_visibility(vec3 outward, vec3 from_eye, vec3 normal, float footprint_m): unshadowed share of
// each directional light at a pixel, 0..1.
// outward: Outward axis of the panel's face, or 0. from_eye: Vector from the eye to the surface in m.
// footprint_m: Width of the pixel.

#include "shadow.constants"
#include "variant.constants"
#include "view.block"
#include "shadow_map.glsl"

// Percentage-closer filtering (Reeves et al. 1987, Rendering Antialiased Shadows with Depth Maps) over
// the pixel's footprint, or at least SHADOW_TEXELS, which hides the map's texels.
float filtered_light_visibility(vec3 from_eye, vec3 normal, float footprint_m) {
    MainShadowPosition found = main_shadow_position(from_eye);
    vec3 at = found.at;
    mat3 axes = transpose(mat3(ray_to_shadow[0]));   // Axes of the map, in its units per metre.
    axes[0] *= found.scale.x;
    axes[1] *= found.scale.y;
    vec3 squared = vec3(dot(axes[0], axes[0]), dot(axes[1], axes[1]), dot(axes[2], axes[2]));
    vec2 texels = SHADOW_TEXELS / vec2(textureSize(shadow_map, 0));
    vec2 reach = max(texels, min(0.22 * footprint_m, 0.03) * sqrt(squared.xy));
    // A rotated grid: each lookup has its own row and column.
    vec3 u = vec3(reach * vec2(0.75, 0.25), 0.0), v = vec3(reach * vec2(-0.25, 0.75), 0.0);
    // Lookups follow the plane of the surface in depth.
    vec3 plane = normal * axes / squared;
    vec2 slope = plane.xy / min(plane.z, -1e-3);
    u.z = -dot(slope, u.xy);
    v.z = -dot(slope, v.xy);
    return 0.25 * (shadow_lookup(at + u, found.tile) + shadow_lookup(at - u, found.tile) +
                   shadow_lookup(at + v, found.tile) + shadow_lookup(at - v, found.tile));
}

// The brightest light is filtered. The others have one lookup each, in a body that is small enough for
// Mesa to unroll the loop.
vec4 light_visibility(vec3 outward, vec3 from_eye, vec3 normal, float footprint_m) {
    vec4 seen = vec4(0.0);
    // The whole container blocks a light behind the panel, but it is too close to a groove for the
    // shadow map to show that.
    if (dot(outward, light_direction[0].xyz) >= 0.0)
        seen[0] = filtered_light_visibility(from_eye, normal, footprint_m);
    for (int i = 1; i < LIGHTS; ++i)
        if (i < light_count && dot(outward, light_direction[i].xyz) >= 0.0)
            seen[i] = shadow_map_at(from_eye, i);
    return seen;
}
