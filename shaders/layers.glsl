// float covered(...): how much of a footprint lies above a noise threshold; NoiseSample read_noise(...).

uniform sampler2DArray noise_tiles;

struct NoiseSample {
    vec4 value;
    vec4 lost;   // standard deviation that filtering removed
};

// tile_mm: length of a tile on the sheet; footprint_mm: width of the pixel on the sheet
// Half a level finer than the footprint, for bilinear lookups widen a texel by about that.
NoiseSample read_noise(int layer, vec2 sheet_mm, float tile_mm, float footprint_mm) {
    float lod = clamp(log2(footprint_mm * NOISE_SIZE / tile_mm) - 0.5, 0.0, NOISE_LEVELS - 1.0);
    int low = int(lod);
    int high = min(low + 1, int(NOISE_LEVELS) - 1);
    vec4 value = textureLod(noise_tiles, vec3(sheet_mm / tile_mm, layer), lod);
    vec4 lost = mix(noise_lost[layer * int(NOISE_LEVELS) + low],
                    noise_lost[layer * int(NOISE_LEVELS) + high], lod - float(low));
    return NoiseSample(value, lost);
}

// A linear ramp with the spread of what was filtered away (uniform: half-width = sqrt(3) deviations).
float covered(float value, float threshold, float lost, float softness) {
    float half_width = softness + 1.732 * lost;
    return clamp(0.5 + 0.5 * (value - threshold) / half_width, 0.0, 1.0);
}
