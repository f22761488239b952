// PropHit first_prop(vec3 ray, float depth): nearest prop along a view ray before a depth; body is -1 for
// none. vec3 prop_color(PropHit hit, vec3 at): its exposed radiance, without shadows of other props.
// void prop_shade(vec3 at, float blur_m, inout float open, inout float hidden): dims the sky's light on
// the ground beside and below props, and adds what they hide of the first light.

#include "ground.constants"
#include "ground.block"
#include "view.block"
#include "environment_map.glsl"
#include "ground_bodies.glsl"
#include "ground_light.glsl"

#if GROUND_SHADOWS || GROUND_PROPS
uniform usampler2D prop_tiles;   // See GroundPlan.masks.

// Bit masks of a tile: xy of the props that it may show, zw of those that may shade it.
uvec4 tile_props() {
    ivec2 pixel = ivec2(gl_FragCoord.xy) << GROUND_COARSE;
    return texelFetch(prop_tiles, pixel / TILE_PX, 0);
}

// The next prop of a mask, which loses it.
int next_prop(inout uvec2 left) {
    bool low = left.x != 0u;
    int bit = findLSB(low ? left.x : left.y);
    if (low) left.x &= left.x - 1u;
    else left.y &= left.y - 1u;
    return MAX_BOXES + bit + (low ? 0 : 32);
}
#endif

#if GROUND_SHADOWS
// A body shades the ground around it over about its height.
void prop_shade(vec3 at, float blur_m, inout float open, inout float hidden) {
    uvec2 left = tile_props().zw;
    while ((left.x | left.y) != 0u) {
        int i = next_prop(left);
        vec3 offset = in_body(at - body_center[i].xyz, i), size = body_half[i].xyz;
        vec3 apart = max(abs(offset) - size, 0.0), enter;
        float near = clamp(1.0 - length(apart) / min(2.0 * size.z, PROP_SHADE_M), 0.0, 1.0);
        open *= 1.0 - 0.6 * near * near;
        hidden += hidden_share(offset, size, body_light[i].xyz, light_direction[0].w, blur_m, enter);
    }
}
#endif

#if GROUND_PROPS
struct PropHit {
    float depth;
    vec3 normal;
    int body;
};

PropHit first_prop(vec3 ray, float depth) {
    PropHit first = PropHit(depth, vec3(0.0, 0.0, 1.0), -1);
    uvec2 left = tile_props().xy;
    while ((left.x | left.y) != 0u) {
        int i = next_prop(left);
        BodyHit hit = body_hit(eye_m, ray, i);
        if (hit.depth < first.depth) first = PropHit(hit.depth, hit.normal, i);
    }
    return first;
}

const float PROP_OFFSET_M = 0.004;

// Twin of _of_prop() in fastgen/render/scene_bodies.py.
vec3 prop_color(PropHit hit, vec3 at) {
    vec3 n = hit.normal;
    vec4 ambient = ground_ambient(fma(vec2(PROP_AMBIENT_BESIDE_M), n.xy, at.xy));
    vec3 beside = vec3(fma(vec2(PROP_SUNLIT_BESIDE_M), n.xy, at.xy), ground_height_m);
    float hidden = hidden_by_boxes(beside, PROP_SUNLIT_BESIDE_M);
    vec3 lit = ambient.rgb + ground_lights(beside, vec3(0.0, 0.0, 1.0), hidden, PROP_SUNLIT_BESIDE_M);
    float up = 0.5 + 0.5 * n.z, raised = clamp((at.z - ground_height_m) / PROP_OPEN_M, 0.0, 1.0);
    vec3 light = up * ambient.a * diffuse_radiance(n + vec3(0.0, 0.0, 0.5)) +
                 (1.0 - up) * ground_mean_albedo * lit;
    light *= mix(PROP_LOWEST_SHARE, 1.0, raised);
    vec3 outside = fma(vec3(PROP_OFFSET_M), n, at);
    light += ground_lights(outside, n, hidden_by_boxes(outside, PROP_OFFSET_M), PROP_OFFSET_M);
    return exposure * (body_paint[hit.body].rgb + PROP_SHEEN) * light;
}
#endif
