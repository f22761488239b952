// TracedLight traced_light_at(vec2 place, uint surface_id, vec3 from_eye, vec3 normal): light that rays
// found at the points of ray_points.frag near `place`, a position in the image in pixels.
// from_eye: Vector from the eye to the surface in m.

#include "variant.constants"
#include "view.block"
#include "sky_visibility.glsl"

uniform usampler2D ray_point_ids;
uniform sampler2D ray_point_positions;
uniform sampler2DArray ray_point_light;   // Layers in the order of traced_light.py.

// Weighted mean over points on the same surface. weight: Sum of the weights, 0 for no point.
TracedLight traced_light_at(vec2 place, uint surface_id, vec3 from_eye, vec3 normal) {
    vec2 at = (place - 0.5 - float(point_step / 2)) / float(point_step);   // In cells.
    ivec2 nearest = ivec2(round(at));
    ivec2 cells = textureSize(ray_point_ids, 0) / ivec2(1, 2);
    TracedLight mean = TracedLight(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), 0.0);
    for (int i = 0; i < 18; ++i) {
        ivec2 cell = nearest + ivec2(i % 3, i / 3 % 3) - 1;
        // This filter gives equal weight to the four sets of rays of a 2x2 tile: Keller and Heidrich
        // 2001, Interleaved Sampling.
        vec2 near = clamp(1.5 - abs(vec2(cell) - at), 0.0, 1.0);
        cell = abs(cell);   // Mirroring at the borders keeps the parity that selects a set.
        cell = max(min(cell, 2 * (cells - 1) - cell), 0);
        if (i >= 9) cell.y += cells.y;
        vec3 apart = texelFetch(ray_point_positions, cell, 0).xyz - from_eye;
        // Points within 5 mm of the plane are on the same surface: corrugation is at least 20 mm deep.
        // Damaged sheets are curved, so distant points may lie farther off.
        float off = WITH_DAMAGE == 1 ? fma(0.15, length(apart), 0.005) : 0.005;
        bool same = texelFetch(ray_point_ids, cell, 0).r == surface_id && abs(dot(apart, normal)) < off;
        if (!same) continue;
        float weight = near.x * near.y;
        mean.sky_share += weight * texelFetch(ray_point_light, ivec3(cell, 0), 0).rgb;
        mean.indirect += weight * texelFetch(ray_point_light, ivec3(cell, 1), 0).rgb;
        mean.mirror_sky_share += weight * texelFetch(ray_point_light, ivec3(cell, 2), 0).rgb;
        mean.mirror_indirect += weight * texelFetch(ray_point_light, ivec3(cell, 3), 0).rgb;
        mean.weight += weight;
    }
    float share = 1.0 / max(mean.weight, 1e-6);
    mean.sky_share *= share;
    mean.indirect *= share;
    mean.mirror_sky_share *= share;
    mean.mirror_indirect *= share;
    return mean;
}
