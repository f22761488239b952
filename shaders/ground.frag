// Fragment stage of the ground and of the props on it, found by casting the pixel's view ray.
// Writes display colour, the share that is not the panorama, no labels, and depth. With GROUND_COARSE
// the image has half the resolution, and the colour is exposed radiance for ground_spread.frag.
#version 430 core
#include "ground.constants"
#include "lookups.constants"
#include "units.constants"
#include "variant.constants"
#include "view.block"
#include "display_color.glsl"
#include "environment_map.glsl"
#include "ground_bodies.glsl"
#include "ground_light.glsl"
#include "ground_material.glsl"
#include "ground_mirror.glsl"
#include "ground_props.glsl"
#include "seen_plane.glsl"
#include "view_ray.glsl"

layout(location = 0) out vec4 out_color;
#if !GROUND_COARSE
layout(location = 1) out uint out_labels;
layout(location = 2) out float out_depth;
#endif

const float PIXEL_WIDTH = 1.0 + GROUND_COARSE;

// Exposed radiance of the plane at a world position, which the ray meets at a depth.
vec3 ground_color(vec3 at, vec3 ray, float depth) {
    float stretch = dot(ray, ray) / (ray.z * ray.z);
    float least = depth * pixel_angle * PIXEL_WIDTH;
    float blur_m = GROUND_FILTER_PX * least * sqrt(sqrt(stretch));
    vec2 along = ray.xy * inversesqrt(max(dot(ray.xy, ray.xy), 1e-12));
    float longest = 1e3 * least * sqrt(stretch);
    // Sharper than the longer axis; the shorter one alone would flicker.
    float noise = max(1e3 * least * sqrt(sqrt(stretch)), 0.4 * longest);
    GroundFootprint f = GroundFootprint(along, 1e3 * least, stretch - 1.0, noise);
    GroundMaterial m = ground_material(1e3 * at.xy, f);

    float open = below_boxes(at), hidden = hidden_by_boxes(at, blur_m);
#if GROUND_SHADOWS
    prop_shade(at, blur_m, open, hidden);
#endif
    vec3 light = ground_ambient(at.xy).rgb * open +
                 ground_lights(at, vec3(0.0, 0.0, 1.0), hidden, blur_m);
    vec3 color = m.albedo * light;
#if GROUND_WET
    vec3 view_ray = normalize(ray);
    color += ground_mirror(at, view_ray, m) * open + ground_glare(at, view_ray, m, hidden, blur_m);
#endif
    return exposure * color;
}

// Exposed radiance along a ray, and the share of it that is not the panorama. depth is that of the
// plane or a prop; infinite where the panorama replaces both.
vec4 seen_color(vec3 ray, out float depth) {
    vec3 at;
    float share;
    depth = seen_plane(ray, at, share);
#if LAYER != LAYER_ALL
    vec3 color = vec3(LAYER == LAYER_NORMALS ? 0.5 : 1.0);
#else
    vec3 color = vec3(0.0);
#if GROUND_PLANE
    color = ground_color(at, ray, isinf(depth) ? 1.0 : depth);
#endif
#endif
#if GROUND_PLANE == 0
    share = 0.0;
#elif LAYER != LAYER_ALL
    share = isinf(depth) ? 0.0 : 1.0;
#endif
#if LAYER == LAYER_ALL
    if (share < 1.0) {
        vec3 behind = exposure * background(ray);
        color = share > 0.0 ? mix(behind, color, share) : behind;
    }
#endif
#if GROUND_PROPS
    PropHit hit = first_prop(ray, depth);
    if (hit.body >= 0) {
        depth = hit.depth;
        share = 1.0;
#if LAYER == LAYER_ALL
        color = prop_color(hit, fma(vec3(depth), ray, eye_m));
#endif
    } else {
        depth = GROUND_PLANE == 1 ? depth : NO_DEPTH;
    }
#endif
    return vec4(color, share);
}

void main() {
    float depth;
#if GROUND_COARSE
    out_color = seen_color(view_ray(PIXEL_WIDTH * gl_FragCoord.xy), depth);
#else
#if GROUND_PROPS
    bool shows_props = tile_props().xy != uvec2(0u);
    if (GROUND_PLANE == 0 && !shows_props) discard;
#endif
#if GROUND_PROPS && LOOKUPS > 1
    // Elsewhere the pattern of the plane is filtered already.
    int samples = shows_props ? 4 : 1;
    vec4 color = vec4(0.0);
    for (int i = 0; i < samples; ++i) {
        vec2 offset = shows_props ? vec2(i & 1, i >> 1) * 0.5 - 0.25 : vec2(0.0);
        color += seen_color(view_ray(gl_FragCoord.xy + offset), depth) / float(samples);
    }
    vec3 at, ray = view_ray(gl_FragCoord.xy);
    float share;
    depth = seen_plane(ray, at, share);
    depth = first_prop(ray, depth).depth;
#else
    vec4 color = seen_color(view_ray(gl_FragCoord.xy), depth);
#endif
    if (isinf(depth) && color.a == 0.0) discard;
    out_color = vec4(display_color(color.rgb), color.a);
    out_labels = 0u;
    out_depth = depth;
#endif
}
