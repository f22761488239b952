// Shading of pixels of all classes:
// Shaded sky(vec3 ray): the background. Shaded single_surface(ivec2 pixel): a pixel of one surface.
// Part part_at(ivec2 sample_at, uint key, vec3 view): the material that a part of a pixel shares.
// vec3 part_color(Part p, ivec2 sample_at, uint key, vec3 view): its light toward the eye.
// Shaded through_hole(ivec2 sample_at, uint key, vec3 ray): the view through a hole.
// vec3 displayed(vec3 color): tone-mapped and encoded colour, or `color` itself in a radiance image.

#include "labels.constants"
#include "lookups.constants"
#include "materials.constants"
#include "samples.constants"
#include "sky_visibility.constants"
#include "units.constants"
#include "variant.constants"
#include "zones.constants"
#include "scene.block"
#include "view.block"
#include "damage.block"

#include "surface_id.glsl"
#include "sample_lattice.glsl"
#include "visibility_buffer.glsl"
#include "lens.glsl"
#include "view_ray.glsl"
#include "tone_curve.glsl"
#include "brdf.glsl"
#include "sky_visibility.glsl"
#include "environment_map.glsl"
#include "environment_light.glsl"
#if LIGHTS
#include "directional_light.glsl"
#include "light_visibility.glsl"
#include "occluder_light.glsl"
#endif
#include "noise.glsl"
#include "ageing.glsl"
#include "dirt.glsl"
#include "rust.glsl"
#include "scratches.glsl"
#include "wear.glsl"
#include "wetness.glsl"
#include "decal_cell.glsl"
#include "decal.glsl"
#include "zone.glsl"
#include "material.glsl"
#if TRACED
#include "traced_light.glsl"
#endif
#if WITH_DAMAGE
#include "damage_law.glsl"
#include "interior.glsl"
#include "rest_position.glsl"
#endif

struct Shaded {
    vec3 color;   // Exposed radiance; in a single-layer image the value to show.
    uint id;
    uint damage;
    float depth;
    float cover;   // Share of the pixel that is not sky.
};

// 2x2 coarse shading evaluates several pixels once, midway between the first and the last pixel.
// coarse_offset: Offset of the last pixel from the first. coarse_pixels: Number of pixels.
#if WITH_COARSE
ivec2 coarse_offset;
float coarse_pixels;
#else
const ivec2 coarse_offset = ivec2(0);
const float coarse_pixels = 1.0;
#endif

// Value of a visibility-buffer texture at that midpoint; sample_at belongs to the first pixel.
vec4 coarse_mean(sampler2D values, ivec2 sample_at) {
    vec4 first = texelFetch(values, sample_at, 0);
#if WITH_COARSE
    return 0.5 * (first + texelFetch(values, sample_at + coarse_offset, 0));
#else
    return first;
#endif
}

vec4 coarse_mean_bytes(usampler2D values, ivec2 sample_at) {
    vec4 first = unpackUnorm4x8(texelFetch(values, sample_at, 0).r);
#if WITH_COARSE
    return 0.5 * (first + unpackUnorm4x8(texelFetch(values, sample_at + coarse_offset, 0).r));
#else
    return first;
#endif
}

// Decodes what sky_visibility.py encodes. On the spreader the light includes indirect light already;
// see indirect_light.py.
SkyVisibility sky_visibility_at(ivec2 sample_at, uint zone) {
    vec4 stored = coarse_mean_bytes(sky_visibility_cones, sample_at);
    vec3 cone = stored.xyz * (255.0 / 127.0) - 128.0 / 127.0;
    float size = length(cone);
    vec4 encoded = coarse_mean_bytes(sky_visibility_light, sample_at);
    vec3 light = encoded.rgb * (255.0 / LIGHT_STEPS * fma(encoded.a, 255.0 / LIGHT_TIMES, 1.0));
    float bounces = zone < SPREADER_ZONE ? 1.0 : 0.0;
    float rim = clamp(2.0 - 2.0 * size, 0.0, 1.0);
    return SkyVisibility(cone / size, rim, light, stored.w, bounces, 0.0, vec3(0.0), vec3(0.0),
                    NO_TRACED_LIGHT);
}

// Must run after the pixel filter, because a pixel averages light, not encoded values.
vec3 displayed(vec3 color) {
#if RADIANCE || LAYER == LAYER_NORMALS
    return color;
#elif LAYER == LAYER_ALL
    color = neutral_tone(color);
#endif
    return srgb_encode(color);
}

// light_seen: Unshadowed share of each directional light.
vec3 layer_color(Material m, vec3 normal, vec3 view, SkyVisibility sky, vec4 light_seen) {
#if LAYER == LAYER_ALL
    BrdfTerms r = brdf_terms(m, normal, view);
    vec3 radiance = environment_reflection(r, sky);
#if LIGHTS
    for (int i = 0; i < LIGHTS; ++i)
        if (light_seen[i] > 0.0) radiance += light_seen[i] * light_reflection(r, i);
#endif
    return exposure * radiance;
#elif LAYER == LAYER_NORMALS
    return normal * 0.5 + 0.5;
#elif LAYER == LAYER_REFLECTION
    return srgb_decode(vec3(m.roughness));
#else
    return m.albedo;
#endif
}

Shaded sky(vec3 ray) {
#if LAYER == LAYER_ALL
    vec3 color = exposure * background(ray);
#elif LAYER == LAYER_NORMALS
    vec3 color = vec3(0.5);   // The sky has no normal.
#else
    vec3 color = vec3(1.0);
#endif
    return Shaded(color, 0u, 0u, NO_DEPTH, 0.0);
}

// A part is one zone within a pixel. All its samples share these values, taken at one point.
struct Part {
    SurfacePoint surface;
    uint id;
    uint damage;
    float depth;
    float footprint_mm;   // Width of a material lookup on the surface.
    float scar;
#if WITH_DAMAGE
    mat3 bend;
#endif
};

Part part_at(ivec2 sample_at, uint key, vec3 view) {
    vec2 sheet_mm = coarse_mean(atlas_positions, sample_at).xy;
    vec3 normal = id_normal(key);
    Part p;
    p.damage = UNDAMAGED_CONTAINER;
    p.depth = coarse_mean(surface_depths, sample_at).r;
    p.scar = 0.0;
#if WITH_DAMAGE
    DamageSample d = damage_at(rest_at(sample_at));
    if (d.value != 0u) p.damage = d.value;
    p.scar = d.scar;
    p.bend = d.bend;
    normal = deformed_normal(d.bend, normal);
#endif
    float facing = dot(normal, view);
    // Geometric mean of the footprint's two axes on the surface.
    p.footprint_mm = sqrt(coarse_pixels) * LOOKUP_PX * p.depth * pixel_angle * 1000.0 *
                     inversesqrt(max(facing, 0.05));
    p.surface = surface_at(id_zone(key), sheet_mm, p.footprint_mm, p.scar);
    p.id = p.surface.decal_id != 0u ? p.surface.decal_id : CONTAINER_ID;
    if (id_zone(key) >= SPREADER_ZONE) {
        p.id = SPREADER_ID;
        p.damage = 0u;
    }
    return p;
}

#if LOOKUPS > 1
// A sum of lookups before the first one: zero, except for values that are the same for all lookups.
SurfacePoint no_layers(SurfacePoint first) {
    first.material = Material(vec3(0.0), 0.0, 0.0);
    first.printed = 0.0;
    return first;
}

// Adds the material of `p` at another atlas position to `sum`, the mean of `count` lookups.
void add_layers(inout SurfacePoint sum, Part p, uint zone, vec2 sheet_mm, float count) {
    SurfacePoint s = surface_at(zone, sheet_mm, p.footprint_mm, p.scar);
    sum.material.albedo += s.material.albedo / count;
    sum.material.roughness += s.material.roughness / count;
    sum.material.metallic += s.material.metallic / count;
    sum.printed += s.printed / count;
}
#endif

vec3 part_color(Part p, ivec2 sample_at, uint key, vec3 view) {
    vec3 normal = id_normal(key);
    SkyVisibility sky = sky_visibility_at(sample_at, id_zone(key));
#if WITH_DAMAGE
    normal = deformed_normal(p.bend, normal);
    sky.bent_normal = deformed_normal(p.bend, sky.bent_normal);
#endif
    // Occluders are assumed to have the local albedo, because heavy rust is rarely isolated. A decal
    // says nothing about them, so the sheet's paint replaces it.
    sky.occluder_albedo = mix(p.surface.material.albedo, material_base[SHEET_MATERIAL].rgb, p.surface.printed);
    // Above a roof the occluder is the spreader.
    sky.overhead = above.a * sky.lacks_indirect * max(p.surface.outward.z, 0.0);
    sky.occluder_albedo = mix(sky.occluder_albedo, above.rgb, sky.overhead);
    vec4 light_seen = vec4(0.0);
    float depth = coarse_mean(surface_depths, sample_at).r;
    vec2 place = sample_position(sample_at) + 0.5 * vec2(coarse_offset);
    vec3 from_eye = depth * view_ray(place);
#if TRACED
    sky.traced = traced_light_at(place, key, from_eye, normal);
#endif
#if LIGHTS && LAYER == LAYER_ALL
    vec3 outward = p.surface.outward;
    light_seen = light_visibility(outward, from_eye, normal, depth * pixel_angle);
    sky.occluder_light = occluder_light(outward, from_eye, normal, sky);
#endif
    return layer_color(p.surface.material, normal, view, sky, light_seen);
}

// A pixel whose near samples all see the same surface.
Shaded single_surface(ivec2 pixel) {
    ivec2 middle = center_texel(pixel);
    uint key = surface_id_at(middle);
    vec3 view = -normalize(view_ray(vec2(pixel) + 0.5 + 0.5 * vec2(coarse_offset)));
    Part p = part_at(middle, key, view);
#if LOOKUPS > 1
    // The surface is nearly flat between the centre sample and two other near samples, so the atlas
    // position is linear in the pixel.
    const ivec2 one = ivec2(FILTER_STEP), other = ivec2(FILTER_STEP, -FILTER_STEP);
    const mat2 pixels = mat2(from_center(vec2(one)), from_center(vec2(other)));
    vec2 sheet_mm = texelFetch(atlas_positions, middle, 0).xy;
    mat2 moved_mm = mat2(texelFetch(atlas_positions, middle + one, 0).xy - sheet_mm,
                         texelFetch(atlas_positions, middle + other, 0).xy - sheet_mm);
    mat2 mm_of_pixel = moved_mm * inverse(pixels);
    SurfacePoint mean = no_layers(p.surface);
    for (int i = 0; i < LOOKUPS; ++i)
        add_layers(mean, p, id_zone(key), sheet_mm + mm_of_pixel * LOOKUP_PLACE[i], float(LOOKUPS));
    p.surface = mean;
#endif
    return Shaded(part_color(p, middle, key, view), p.id, p.damage, p.depth, 1.0);
}

#if WITH_HOLES
// Shows the interior of the container, or the sky through another hole.
Shaded through_hole(ivec2 sample_at, uint key, vec3 ray) {
    ivec2 inner_at = ivec2(textureSize(surface_ids, 0).x - 1 - sample_at.x, sample_at.y + inner_row);
    uint inner_key = surface_id_at(inner_at);
    vec3 rest_mm = rest_at(inner_at);
    float depth = texelFetch(surface_depths, inner_at, 0).r;
    Shaded s = sky(ray);
    if (inner_key != 0u) {
        vec3 normal = -id_normal(inner_key);   // The inner view sees surfaces from behind.
#if LAYER == LAYER_NORMALS
        vec3 seen = deformed_normal(damage_at(rest_mm).bend, normal) * 0.5 + 0.5;
#elif LAYER == LAYER_ALL
        vec3 seen = exposure * inside(normal, rest_mm);
#elif LAYER == LAYER_REFLECTION
        vec3 seen = vec3(1.0);   // Maximum roughness.
#else
        vec3 seen = inside_albedo(normal, rest_mm);
#endif
        s = Shaded(seen, CONTAINER_ID, 0u, depth, 1.0);
    }
    s.damage = uint(damage_shape[3 * int(key >> 10) + 2].w);
    return s;
}
#endif
