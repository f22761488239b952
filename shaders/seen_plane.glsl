// float seen_plane(vec3 ray, out vec3 at, out float share): depth of the ground where it is seen, infinite
// elsewhere. at: World position in m where the ray meets the plane. share: Opacity of the ground over the
// panorama. Far away, the ground fades into the panorama. Behind the containers and props of the scene,
// obstacles of the panorama hide it.

#include "ground.constants"
#include "units.constants"
#include "ground.block"
#include "environment_map.glsl"
#include "plane_depth.glsl"

uniform sampler2D obstacle_map;   // Share of containers and other obstacles; octahedral.

float seen_plane(vec3 ray, out vec3 at, out float share) {
    float depth = plane_depth(ray, at);
    share = isinf(depth) ? 0.0 : 1.0;
#if GROUND_PLANE
    float away_m = length(at.xy);
    if (isinf(depth) || away_m < ground_clear_m) return depth;
    vec2 uv = bordered(octahedral(to_environment(ray)), float(textureSize(obstacle_map, 0).x));
    float hidden = textureLod(obstacle_map, uv, 0.0).r *
                   smoothstep(ground_clear_m, 1.6 * ground_clear_m, away_m);
    if (dot(ray.xy, at.xy) < 0.0) hidden = 0.0;   // In front of the scene.
    share = (1.0 - smoothstep(GROUND_FADE_START * ground_reach_m, ground_reach_m, away_m)) *
            (1.0 - smoothstep(0.25, 0.5, hidden));
    if (hidden >= 0.5) depth = NO_DEPTH;
#endif
    return depth;
}
