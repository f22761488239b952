// Fragment stage of the ground and of the props on it, found by casting the pixel's view ray.
// Writes display colour, the share that is not the panorama, no labels, and depth.
#version 430 core
#include "ground.constants"
#include "samples.constants"
#include "variant.constants"
#include "units.constants"
#include "ground.block"
#include "view.block"
#include "display_color.glsl"
#include "environment_map.glsl"
#include "ground_bodies.glsl"
#include "ground_light.glsl"
#include "ground_material.glsl"
#include "ground_mirror.glsl"
#include "ground_props.glsl"
#include "view_ray.glsl"

layout(location = 0) out vec4 out_color;
layout(location = 1) out uint out_labels;
layout(location = 2) out float out_depth;

// Exposed radiance of the plane at a world position, which the ray meets at a depth.
vec3 ground_color(vec3 at, vec3 ray, float depth) {
    float stretch = dot(ray, ray) / (ray.z * ray.z);
    float least = depth * pixel_angle;
    float blur_m = 0.35 * least * sqrt(sqrt(stretch));
    vec2 along = ray.xy * inversesqrt(max(dot(ray.xy, ray.xy), 1e-12));
    float longest = 1e3 * least * sqrt(stretch);
    // Sharper than the longer axis; the shorter one alone would flicker.
    float noise = max(1e3 * least * sqrt(sqrt(stretch)), 0.4 * longest);
    Footprint f = Footprint(along, 1e3 * least, stretch - 1.0, noise);
    GroundMaterial m = ground_material(1e3 * at.xy, f);

    float open = below_boxes(at);
#if GROUND_PROPS
    open *= beside_props(at);
#endif
    vec3 light = ground_ambient(at.xy).rgb * open + ground_lights(at, vec3(0.0, 0.0, 1.0), blur_m);
    vec3 color = m.albedo * light;
#if GROUND_WET
    color += ground_mirror(at, normalize(ray), m) * open;
#endif
    return exposure * color;
}

// Exposed radiance along a ray, and the share of it that is not the panorama. depth is that of the
// plane or a prop; infinite where the panorama replaces both.
vec4 seen_color(vec3 ray, out float depth) {
    float down = (ground_height_m - eye_m.z) / ray.z;
    vec3 at = fma(vec3(down), ray, eye_m);
    float away = down > 0.0 ? length(at.xy) : 1e9;
    depth = away < ground_reach_m ? down : NO_DEPTH;
#if LAYER != LAYER_ALL
    vec3 color = vec3(LAYER == LAYER_NORMALS ? 0.5 : 1.0);
#else
    vec3 color = ground_color(at, ray, down);
#endif
    float share = 1.0;
#if GROUND_FADES && LAYER == LAYER_ALL
    share = 1.0 - smoothstep(GROUND_FADE_START, 1.0, away / ground_reach_m);
    color = mix(exposure * background(ray), color, share);
    if (share == 0.0) color = exposure * background(ray);
#endif
#if GROUND_PROPS
    PropHit hit = first_prop(ray, depth);
    if (hit.body >= 0) {
        depth = hit.depth;
        share = 1.0;
#if LAYER == LAYER_ALL
        color = prop_color(hit, fma(vec3(depth), ray, eye_m));
#endif
    }
#endif
    return vec4(color, share);
}

void main() {
    float depth;
#if GROUND_PROPS && SAMPLES_PER_AXIS > 1
    vec4 color = vec4(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 offset = vec2(i & 1, i >> 1) * 0.5 - 0.25;
        color += 0.25 * seen_color(view_ray(gl_FragCoord.xy + offset), depth);
    }
    vec3 ray = view_ray(gl_FragCoord.xy);
    float down = (ground_height_m - eye_m.z) / ray.z;
    depth = down > 0.0 && length(fma(vec3(down), ray, eye_m).xy) < ground_reach_m ? down : NO_DEPTH;
    depth = min(depth, first_prop(ray, depth).depth);
#else
    vec4 color = seen_color(view_ray(gl_FragCoord.xy), depth);
    if (isinf(depth)) discard;
#endif
    out_color = vec4(display_color(color.rgb), color.a);
    out_labels = 0u;
    out_depth = depth;
}
