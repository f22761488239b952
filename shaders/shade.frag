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
#include "decal_cell.glsl"
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

// all that the samples of one part within a pixel share: its layers, the point they are taken at
struct Part {
    SurfacePoint surface;
    uint id;
    uint damage;
    float depth;
#if WITH_DAMAGE
    mat3 bend;
#endif
};

Part part_at(ivec2 sample_at, uint key, vec3 view) {
    vec4 sheet = texelFetch(sheet_points, sample_at, 0);
    vec3 normal = key_normal(key);
    Part p;
    p.damage = SOUND_CONTAINER;
    p.depth = sheet.z;
    float scar = 0.0;
#if WITH_DAMAGE
    Damaged d = damage_at(texelFetch(rest_points, sample_at, 0).xyz);
    if (d.value != 0u) p.damage = d.value;
    scar = d.scar;
    p.bend = d.bend;
    normal = bent_normal(d.bend, normal);
#endif
    float facing = dot(normal, view);
    // the geometric mean of the footprint's two axes on the sheet
    float footprint_mm = sheet.z * pixel_angle * 1000.0 * inversesqrt(max(facing, 0.05));
    p.surface = surface_at(key_chart(key), sheet.xy, footprint_mm, scar);
    p.id = p.surface.decal_id != 0u ? p.surface.decal_id : CONTAINER_ID;
    if (key_chart(key) >= SPREADER_CHART) {
        p.id = SPREADER_ID;
        p.damage = 0u;
    }
    return p;
}

vec3 part_color(Part p, uint key, vec3 view) {
    vec3 normal = key_normal(key);
#if WITH_DAMAGE
    normal = bent_normal(p.bend, normal);
#endif
    return layer_color(p.surface, normal, view);
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
    uint key = texelFetch(surface_keys, middle, 0).r;
    vec3 view = -normalize(view_ray(center));
    Part p = part_at(middle, key, view);
    Shaded s = Shaded(vec3(0.0), p.id, p.damage, p.depth);
    vec3 color = part_color(p, key, view);
#else
    // a tent filter over the samples on and between the neighbouring pixel centres: the layers once
    // for each part of the container seen, the light once for each of its orientations
    uint keys[TENT_SAMPLES];
    float sky_weight = 0.0;
    for (int i = 0; i < TENT_SAMPLES; ++i) {
        ivec2 at = middle + TENT_OFFSET[i];
        keys[i] = texelFetch(surface_keys, at, 0).r;
        if (keys[i] == 0u) { sky_weight += TENT_WEIGHT[i]; keys[i] = TAKEN; }
#if WITH_HOLES
        int hole = hole_at(texelFetch(rest_points, at, 0).xyz);
        if (keys[i] != TAKEN && hole >= 0) keys[i] = (PORTAL_CHART + 1u) | (uint(hole) << 10);
#endif
    }
    bool sees_sky = keys[0] == TAKEN;
    Shaded s = sky(view_ray(center));
    vec3 color = sky_weight * s.color;
    float done = sky_weight;
    for (int part = 0; part < MAX_PARTS && done < 0.999; ++part) {
        int first = -1;
        uint chart = 0u;
        for (int i = 0; i < TENT_SAMPLES; ++i)
            if (first < 0 && keys[i] != TAKEN) { first = i; chart = key_chart(keys[i]); }
        ivec2 offset = TENT_OFFSET[first];
        vec3 ray = view_ray(center + vec2(offset) / float(SAMPLES_PER_AXIS));
        vec3 view = -normalize(ray);
        Part p = part_at(middle + offset, keys[first], view);
        bool at_center = part == 0 && !sees_sky;
        if (at_center) s = Shaded(vec3(0.0), p.id, p.damage, p.depth);
        bool more = true;
        for (int side = 0; side < MAX_SIDES && more; ++side) {
            uint key = TAKEN;
            float weight = 0.0;
            more = false;
            for (int i = 0; i < TENT_SAMPLES; ++i) {
                bool same_part = keys[i] != TAKEN && key_chart(keys[i]) == chart;
                if (same_part && key == TAKEN) key = keys[i];
                if (same_part && keys[i] == key) { weight += TENT_WEIGHT[i]; keys[i] = TAKEN; }
                else more = more || same_part;
            }
            vec3 lit_color = part_color(p, key, view);
#if WITH_HOLES
            if (chart == PORTAL_CHART) {
                Shaded through = through_hole(middle + offset, key, ray);
                lit_color = through.color;
                if (at_center && side == 0) s = through;
            }
#endif
            color += weight * lit_color;
            done += weight;
        }
    }
    color /= done;   // of a busy pixel, what was not come to counts like the rest
#endif
    out_color = vec4(srgb_encode(color), 1.0);
    out_labels = s.id | (s.damage << 16);
    out_depth = s.depth;
}
