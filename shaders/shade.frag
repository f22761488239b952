// Shades the pixels of one class, each once for every different surface that its samples see.
#version 430 core
#include "blocks.glsl"
#include "octahedral.glsl"
#include "tone.glsl"
#include "ibl.glsl"
#include "layers.glsl"
#include "ageing.glsl"
#include "dirt.glsl"
#include "rust.glsl"
#include "scratches.glsl"
#include "wear.glsl"
#include "decal.glsl"
#include "material.glsl"
#if WITH_DAMAGE
#include "damage.glsl"
#include "inside.glsl"

uniform sampler2D rest_points;
#endif

uniform usampler2D surface_keys;
uniform sampler2D sheet_points;

layout(location = 0) out vec4 out_color;
layout(location = 1) out uint out_labels;   // object id | damage value << 16
layout(location = 2) out float out_depth;

struct Shaded {
    vec3 color;   // displayed, linear
    uint id;
    uint damage;
    float depth;
};

vec3 view_ray(vec2 pixel) { return ray_corner + pixel.x * ray_right + pixel.y * ray_down; }

vec3 layer_color(SurfacePoint s, vec3 normal, vec3 view) {
#if LAYER == LAYER_ALL
    return neutral_tone(exposure * lit(s.material, normal, view));
#elif LAYER == LAYER_NORMALS
    return srgb_decode(normal * 0.5 + 0.5);
#elif LAYER == LAYER_REFLECTION
    return srgb_decode(vec3(s.material.roughness));
#else
    return s.material.albedo;
#endif
}

Shaded sky(vec3 ray) {
#if LAYER == LAYER_ALL
    vec3 color = neutral_tone(exposure * background(normalize(ray)));
#else
    vec3 color = vec3(1.0);
#endif
    return Shaded(color, 0u, 0u, VOID_DEPTH);
}

Shaded shade(ivec2 sample_at, uint key, vec3 ray) {
    vec4 sheet = texelFetch(sheet_points, sample_at, 0);
    vec3 normal = key_normal(key);
    vec3 view = -normalize(ray);
    uint damage = SOUND_CONTAINER;
    float scar = 0.0;
#if WITH_DAMAGE
    Damaged d = damage_at(texelFetch(rest_points, sample_at, 0).xyz, normal);
    if (d.value != 0u) damage = d.value;
    scar = d.scar;
    normal = d.normal;
#endif
    float facing = dot(normal, view);
    // the geometric mean of the footprint's two axes on the sheet
    float footprint_mm = sheet.z * pixel_angle * 1000.0 * inversesqrt(max(facing, 0.05));
    SurfacePoint s = surface_at(key_chart(key), sheet.xy, footprint_mm, scar);
    uint id = s.decal_id != 0u ? s.decal_id : CONTAINER_ID;
    return Shaded(layer_color(s, normal, view), id, damage, sheet.z);
}

#if WITH_HOLES
// what a hole shows: the inside of the container, or the sky through another hole
Shaded through_hole(ivec2 sample_at, uint key, vec3 ray) {
    ivec2 inner_at = ivec2(textureSize(surface_keys, 0).x - 1 - sample_at.x, sample_at.y + inner_row);
    uint inner_key = texelFetch(surface_keys, inner_at, 0).r;
    vec3 rest_mm = texelFetch(rest_points, inner_at, 0).xyz;
    float depth = texelFetch(sheet_points, inner_at, 0).z;
    Shaded s = sky(ray);
    if (inner_key != 0u && hole_at(rest_mm) < 0) {
        vec3 seen = inside(-key_normal(inner_key), rest_mm);
#if LAYER == LAYER_ALL
        seen = neutral_tone(exposure * seen);
#endif
        s = Shaded(seen, CONTAINER_ID, 0u, depth);
    }
    s.damage = uint(damage_shape[3 * int(key >> 10) + 2].w);
    return s;
}
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec2 center = vec2(pixel) + 0.5;
    ivec2 middle = pixel * SAMPLES_PER_AXIS + SAMPLES_PER_AXIS / 2;

#if CLASS == CLASS_SKY
    Shaded s = sky(view_ray(center));
    vec3 color = s.color;
#elif !WITH_MIXED
    Shaded s = shade(middle, texelFetch(surface_keys, middle, 0).r, view_ray(center));
    vec3 color = s.color;
#else
    // a tent filter over the samples on and between the neighbouring pixel centres: one round for
    // each different surface, the centre's first
    uint keys[TENT_SAMPLES];
    for (int i = 0; i < TENT_SAMPLES; ++i) {
        ivec2 at = middle + TENT_OFFSET[i];
        keys[i] = texelFetch(surface_keys, at, 0).r;
#if WITH_HOLES
        int hole = hole_at(texelFetch(rest_points, at, 0).xyz);
        if (keys[i] != 0u && hole >= 0) keys[i] = (PORTAL_CHART + 1u) | (uint(hole) << 10);
#endif
    }
    Shaded s;
    vec3 color = vec3(0.0);
    float left = 1.0;
    for (int round = 0; round < MAX_SURFACES && left > 0.001; ++round) {
        int first = -1;
        uint key = 0u;
        float weight = 0.0;
        for (int i = 0; i < TENT_SAMPLES; ++i) {
            bool fresh = keys[i] != TAKEN;
            if (fresh && first < 0) { first = i; key = keys[i]; }
            if (fresh && keys[i] == key) { weight += TENT_WEIGHT[i]; keys[i] = TAKEN; }
        }
        left -= weight;
        // what is left of a busy pixel counts with its last surface
        if (round == MAX_SURFACES - 1) weight += left;
        ivec2 offset = TENT_OFFSET[first];
        vec3 ray = view_ray(center + vec2(offset) / float(SAMPLES_PER_AXIS));
        Shaded one = shade(middle + offset, key, ray);
        if (key == 0u) one = sky(ray);
#if WITH_HOLES
        if (key_chart(key) == PORTAL_CHART) one = through_hole(middle + offset, key, ray);
#endif
        color += weight * one.color;
        if (round == 0) s = one;
    }
#endif
    out_color = vec4(srgb_encode(color), 1.0);
    out_labels = s.id | (s.damage << 16);
    out_depth = s.depth;
}
