// PropHit first_prop(vec3 ray, float depth): nearest prop along a view ray before a depth; body is -1 for
// none. vec3 prop_color(PropHit hit, vec3 at): its exposed radiance.
// float beside_props(vec3 at): share of the sky's light on the ground next to props and below them.

#include "ground.constants"
#include "ground.block"
#include "view.block"
#include "environment_map.glsl"
#include "ground_bodies.glsl"
#include "ground_light.glsl"

#if GROUND_PROPS
struct PropHit {
    float depth;
    vec3 normal;
    int body;
};

PropHit first_prop(vec3 ray, float depth) {
    PropHit first = PropHit(depth, vec3(0.0, 0.0, 1.0), -1);
    for (int i = MAX_BOXES; i < MAX_BOXES + prop_count; ++i) {
        BodyHit hit = body_hit(eye_m, ray, i);
        if (hit.depth < first.depth) first = PropHit(hit.depth, hit.normal, i);
    }
    return first;
}

// A body shades the ground around it over about its height.
float beside_props(vec3 at) {
    float open = 1.0;
    for (int i = MAX_BOXES; i < MAX_BOXES + prop_count; ++i) {
        vec3 apart = max(abs(in_body(at - body_center[i].xyz, i)) - body_half[i].xyz, 0.0);
        float near = clamp(1.0 - length(apart) / min(2.0 * body_half[i].z, 0.6), 0.0, 1.0);
        open *= 1.0 - 0.6 * near * near;
    }
    return open;
}

const float PROP_OFFSET_M = 0.004;   // Keeps a prop out of its own shadow.

vec3 prop_color(PropHit hit, vec3 at) {
    vec3 n = hit.normal;
    // The ground beside the face stands for what is around it.
    vec4 ambient = ground_ambient(at.xy + 0.3 * n.xy);
    float up = 0.5 + 0.5 * n.z, raised = clamp((at.z - ground_height_m) / 0.4, 0.0, 1.0);
    vec3 light = up * ambient.a * diffuse_radiance(n + vec3(0.0, 0.0, 0.5)) +
                 (1.0 - up) * ground_albedo * ambient.rgb;
    light *= mix(0.55, 1.0, raised);
    light += ground_lights(fma(vec3(PROP_OFFSET_M), n, at), n, 0.25 * PROP_OFFSET_M);
    return exposure * body_paint[hit.body].rgb * light;
}
#endif
