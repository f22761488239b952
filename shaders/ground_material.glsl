// GroundMaterial ground_material(vec2 at_mm, GroundFootprint f): the ground at a world position.
// The kind of ground is a constant of the program. All patterns are filtered over the footprint.

#include "ground.constants"
#include "ground.block"
#include "cell_noise.glsl"
#include "ground_pattern.glsl"
#include "noise.glsl"
#include "wetness.glsl"

struct GroundMaterial {
    vec3 albedo;
    float roughness;
};

// Cracks follow level lines of noise, whose share of the area does not depend on the footprint.
float cracks(float value, float lost) {
    return covered(value, 0.495, lost, 0.004) - covered(value, 0.505, lost, 0.004);
}

// A mended rectangle in some cells: its change of the albedo. at: Position along and across the lines.
float patch_tone(vec2 at, vec2 filter_width) {
    const vec2 cell_mm = vec2(5200.0, 7300.0);
    vec2 cell = floor(at / cell_mm);
    vec4 random = cell_noise(cell), other = cell_noise(cell + 101.0);
    vec2 half_size = mix(vec2(300.0, 400.0), vec2(1400.0, 2600.0), random.xy * random.xy);
    vec2 from_center = at - (cell + 0.5) * cell_mm - (random.zw - 0.5) * (cell_mm - 2.0 * half_size);
    float patched = band_cover(from_center.x, half_size.x, filter_width.x) *
                    band_cover(from_center.y, half_size.y, filter_width.y);
    float filled = band_cover(from_center.x, half_size.x - 25.0, filter_width.x) *
                   band_cover(from_center.y, half_size.y - 25.0, filter_width.y);
    // A seam of bitumen around it.
    float exists = step(other.x, 0.55 * ground_wear);
    return 1.0 + exists * (filled * (other.y > 0.35 ? -0.28 : 0.22) - 0.45 * (patched - filled));
}

// Blocks of 200 x 100 mm in herringbone bond: their color, and sand in the joints.
vec3 paving(vec2 at, GroundFootprint f, vec2 filter_width) {
    vec2 cell = floor(at * 0.01);
    int kind = int(cell.x - cell.y) & 3;   // 0 and 1: along x; 3 and 2: along y.
    bool across = kind < 2;
    vec2 origin = cell - (across ? vec2(kind, 0.0) : vec2(0.0, 3 - kind));
    vec2 size = across ? vec2(200.0, 100.0) : vec2(100.0, 200.0);
    vec2 to_edge = 0.5 * size - abs(at - origin * 100.0 - 0.5 * size);
    vec2 block = clamp((to_edge - 3.0) / filter_width + 0.5, 0.0, 1.0);
    vec4 random = cell_noise(origin);
    float near = 1.0 - smoothstep(45.0, 110.0, f.noise);
    vec3 tone = 0.86 + 0.28 * random.x + vec3(0.05, 0.0, -0.05) * (random.y - 0.4) * 2.0;
    tone *= mix(0.5, 1.0, block.x * block.y);
    return mix(vec3(0.96, 0.955, 0.95), tone, near);   // The mean of blocks and joints.
}

GroundMaterial ground_material(vec2 at_mm, GroundFootprint f) {
    vec2 along = line_direction, side = vec2(along.y, -along.x);
    vec2 on_lines = vec2(dot(at_mm, side), dot(at_mm, along));
    vec2 filter_width = vec2(width_along(f, side), width_along(f, along));
    vec2 shifted = at_mm + ground_noise_mm;
    // Turned against each other, so that their periods do not coincide.
    NoiseSample broad = read_noise(0, mat2(0.8, 0.6, -0.6, 0.8) * shifted, 9000.0, f.noise);
    NoiseSample fine = read_noise(1, on_lines + ground_noise_mm.yx, 2700.0, f.noise);
    float grain = fine.value.w - 0.5, mottle = broad.value.w - 0.5;

    float tone = 1.0 + ground_wear * (0.55 * (broad.value.x - 0.5) + 0.3 * (fine.value.y - 0.5));
    float oil = normal_covered(broad.value.y, stain_threshold, broad.lost.y, 0.3);
    tone *= 1.0 - 0.5 * ground_wear * oil;
    // Wheels keep to tracks between the lines and leave streaks of rubber.
    float in_lane = on_lines.x - line_spacing_mm * round(on_lines.x / line_spacing_mm);
    float track = 1.0 - smoothstep(0.0, 420.0 + filter_width.x, abs(abs(in_lane) - 950.0));
    float rubber = covered(fine.value.z, 0.8, fine.lost.z, 0.2);
    tone *= 1.0 - ground_wear * (0.14 * track + rubber * fma(0.22, track, 0.1));
    vec3 albedo = ground_albedo;
    float crack = cracks(fine.value.y, fine.lost.y) * smoothstep(0.45, 0.75, broad.value.x);
#if GROUND_ASPHALT
    tone *= patch_tone(on_lines + ground_noise_mm, filter_width);
    tone *= fma(0.85, grain, 1.0) * fma(0.3, mottle, 1.0);
    tone *= 1.0 - 0.7 * min(2.0 * ground_wear, 1.0) * crack;
#elif GROUND_CONCRETE
    vec2 on_slabs = on_lines + ground_noise_mm;
    vec4 slab = cell_noise(floor(on_slabs / slab_mm));
    vec2 joints = vec2(bands_cover(on_slabs.x, slab_mm, 14.0, filter_width.x),
                       bands_cover(on_slabs.y, slab_mm, 14.0, filter_width.y));
    vec2 edges = vec2(bands_cover(on_slabs.x, slab_mm, 160.0, filter_width.x + 150.0),
                      bands_cover(on_slabs.y, slab_mm, 160.0, filter_width.y + 150.0));
    tone *= fma(0.16, slab.x - 0.5, 1.0) * fma(0.22, grain, 1.0);
    tone *= fma(0.22, mottle, 1.0);
    tone *= (1.0 - 0.16 * ground_wear * max(edges.x, edges.y)) * (1.0 - 0.6 * max(joints.x, joints.y));
    tone *= 1.0 - 0.5 * ground_wear * crack;
    albedo *= mix(vec3(1.0), vec3(1.04, 1.0, 0.94), slab.y);
#else
    albedo *= paving(on_lines + ground_noise_mm, f, filter_width);
    tone *= fma(0.4, grain, 1.0) * fma(0.3, mottle, 1.0);
#endif
    albedo *= max(tone, 0.05);

    float line = bands_cover(on_lines.x + 0.5 * line_spacing_mm, line_spacing_mm, LINE_MM, filter_width.x);
    // Paint stays longest on high places and goes first under wheels.
    float paint = covered(fma(0.6, broad.value.x - 0.5, fine.value.y), line_threshold, fine.lost.y, 0.2);
    vec3 line_tone = line_albedo * (1.0 - 0.35 * ground_wear * (1.0 - broad.value.x)) *
                     fma(0.25, grain, 1.0);
    albedo = mix(albedo, line_tone, line * paint * fma(0.3, grain, 0.85));

    float roughness = 0.9;
#if GROUND_WET
    float puddle = covered(broad.value.x, puddle_threshold, broad.lost.x, 0.05);
    float damp = max(covered(broad.value.x, damp_threshold, broad.lost.x, DAMP_SOFTNESS), puddle);
    apply_wetness(albedo, roughness, 0.0, DAMP_WETNESS * damp);
    roughness = mix(roughness, 0.06, puddle);
#endif
    return GroundMaterial(albedo, roughness);
}
