// Traced traced_at(vec2 place, uint key, vec3 from_eye, vec3 normal): light found by rays at the points
// of light_points.frag near `place`, a position in the image in pixels.
// key: Surface id. from_eye: Vector from the eye to the surface in m.

#include "variant.constants"
#include "view.block"

uniform usampler2D point_keys;
uniform sampler2D point_places;
uniform sampler2DArray point_light;   // Layers in the order of traced_light.py.

// Weighted mean over points on the same surface. known: Sum of the weights, 0 for no point.
Traced traced_at(vec2 place, uint key, vec3 from_eye, vec3 normal) {
    vec2 at = (place - 0.5 - float(point_step / 2)) / float(point_step);   // In cells.
    ivec2 nearest = ivec2(round(at));
    ivec2 cells = textureSize(point_keys, 0) / ivec2(1, 2);
    Traced mean = Traced(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), 0.0);
    for (int i = 0; i < 18; ++i) {
        ivec2 cell = nearest + ivec2(i % 3, i / 3 % 3) - 1;
        // This filter gives equal weight to the four sets of rays of a 2x2 tile: Keller and Heidrich
        // 2001, Interleaved Sampling.
        vec2 near = clamp(1.5 - abs(vec2(cell) - at), 0.0, 1.0);
        cell = abs(cell);   // Mirroring at the borders keeps the parity that selects a set.
        cell = max(min(cell, 2 * (cells - 1) - cell), 0);
        if (i >= 9) cell.y += cells.y;
        vec3 apart = texelFetch(point_places, cell, 0).xyz - from_eye;
        // Points within 5 mm of the plane are on the same surface: corrugation is at least 20 mm deep.
        // Damaged sheets are curved, so distant points may lie farther off.
        float off = WITH_DAMAGE == 1 ? fma(0.15, length(apart), 0.005) : 0.005;
        bool same = texelFetch(point_keys, cell, 0).r == key && abs(dot(apart, normal)) < off;
        if (!same) continue;
        float weight = near.x * near.y;
        mean.open += weight * texelFetch(point_light, ivec3(cell, 0), 0).rgb;
        mean.thrown += weight * texelFetch(point_light, ivec3(cell, 1), 0).rgb;
        mean.mirrored_open += weight * texelFetch(point_light, ivec3(cell, 2), 0).rgb;
        mean.mirrored_thrown += weight * texelFetch(point_light, ivec3(cell, 3), 0).rgb;
        mean.known += weight;
    }
    float share = 1.0 / max(mean.known, 1e-6);
    mean.open *= share;
    mean.thrown *= share;
    mean.mirrored_open *= share;
    mean.mirrored_thrown *= share;
    return mean;
}
