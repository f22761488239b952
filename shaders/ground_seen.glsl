// float seen_plane(vec3 ray, out vec3 at, out float share): depth of the ground where it is seen, infinite
// elsewhere. at: World position in m where the ray meets the plane. share: Of the ground; the rest is the
// panorama. Far away, the ground fades into the panorama. Beyond the containers and props, what the panorama
// shows standing on its own ground hides it.

#include "ground.constants"
#include "units.constants"
#include "ground.block"
#include "environment_map.glsl"
#include "ground_ray.glsl"

uniform sampler2D standing_map;   // Share that stands on the ground; octahedral.

float seen_plane(vec3 ray, out vec3 at, out float share) {
    float depth = plane_depth(ray, at);
    share = 1.0;
#if GROUND_FADES
    if (isinf(depth)) return depth;
    float away_m = length(at.xy);
    if (away_m < ground_standing_m) return depth;
    vec2 uv = bordered(octahedral(to_environment(ray)), float(textureSize(standing_map, 0).x));
    float standing = textureLod(standing_map, uv, 0.0).r;
    standing *= smoothstep(ground_standing_m, 1.6 * ground_standing_m, away_m);
    share = (1.0 - smoothstep(GROUND_FADE_START * ground_reach_m, ground_reach_m, away_m)) *
            (1.0 - smoothstep(0.25, 0.5, standing));
    if (standing >= 0.5) depth = NO_DEPTH;
#endif
    return depth;
}
