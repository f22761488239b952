// vec4 ground_ambient(vec2 at_m): irradiance / pi of sky and containers on the ground, and the share of
// an even sky that is seen there. See fastgen/light/ground_light.py.
// float below_boxes(vec3 at): share of that light which reaches below containers with a low gap.
// float hidden_by_boxes(vec3 at, float blur_m): share of the first directional light that they hide.
// float hidden_from(int i, vec3 at, float blur_m): share of another directional light that they hide.
// vec3 ground_lights(vec3 at, vec3 normal, float hidden, float blur_m): irradiance / pi of the
// directional lights.

#include "ground.block"
#include "variant.constants"
#include "view.block"
#include "ground_bodies.glsl"

uniform sampler2D ground_grid;

vec4 ground_ambient(vec2 at_m) {
    return textureLod(ground_grid, fma(at_m, grid_transform.xy, grid_transform.zw), 0.0);
}

// A gap of height h that is open along one straight edge shows a point at depth d below the box the
// share 1 - d / sqrt(d^2 + h^2) of what is seen at the edge.
float below_boxes(vec3 at) {
    float open = 1.0;
#define BELOW(i) { \
    vec2 inside = body_half[i].xy - abs(in_body(at - body_center[i].xyz, i).xy); \
    float depth = max(min(inside.x, inside.y), 0.0), gap = body_paint[i].w; \
    open *= 1.0 - depth * inversesqrt(fma(depth, depth, gap * gap)); }
    EACH_BOX(BELOW)
    return open;
}

// Share of the first light that boxes hide, or more where they hide one another.
float hidden_by_boxes(vec3 at, float blur_m) {
    float hidden = 0.0;
    if (light_count == 0) return hidden;
#define FIRST_LIGHT(i) { \
    vec3 enter; \
    hidden += hidden_share(in_body(at - body_center[i].xyz, i), body_half[i].xyz, body_light[i].xyz, \
                           light_direction[0].w, blur_m, enter); }
    EACH_BOX(FIRST_LIGHT)
    return hidden;
}

float hidden_from(int i, vec3 at, float blur_m) {
    vec4 light = light_direction[i];
    float hidden = 0.0;
#define OTHER_LIGHT(k) hidden += body_cover(at, light.xyz, k, light.w, blur_m);
    EACH_BOX(OTHER_LIGHT)
    return hidden;
}

// hidden: Share of the first light that is hidden. blur_m: Radius over which shadows are filtered.
vec3 ground_lights(vec3 at, vec3 normal, float hidden, float blur_m) {
    if (light_count == 0) return vec3(0.0);
    float facing = max(dot(normal, light_direction[0].xyz), 0.0);
    vec3 sum = light_irradiance[0].rgb * (facing * max(1.0 - hidden, 0.0));
    for (int i = 1; i < LIGHTS; ++i) {
        float seen = max(1.0 - hidden_from(i, at, blur_m), 0.0);
        sum += light_irradiance[i].rgb * (max(dot(normal, light_direction[i].xyz), 0.0) * seen);
    }
    return sum;
}
