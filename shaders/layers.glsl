// float covered(...), normal_covered(...): how much of a footprint lies above a noise threshold;
// NoiseSample read_noise(...).

uniform sampler2DArray noise_tiles;

struct NoiseSample {
    vec4 value;
    vec4 lost;   // standard deviation that filtering removed
};

// tile_mm: length of a tile on the sheet; footprint_mm: width of the pixel on the sheet
// The level of texels no wider than the footprint, for bilinear lookups widen them.
NoiseSample read_noise(int layer, vec2 sheet_mm, float tile_mm, float footprint_mm) {
    float lod = clamp(floor(log2(footprint_mm * NOISE_SIZE / tile_mm)), 0.0, NOISE_LEVELS - 1.0);
    vec4 value = textureLod(noise_tiles, vec3(sheet_mm / tile_mm, layer), lod);
    return NoiseSample(value, noise_lost[layer * int(NOISE_LEVELS) + int(lod)]);
}

// A linear ramp, softer by the spread of what was filtered away: an even spread over a half-width h has
// a variance of h * h / 3, and variances add.
float covered(float value, float threshold, float lost, float softness) {
    float half_width = sqrt(softness * softness + 3.0 * lost * lost);
    return clamp(0.5 + 0.5 * (value - threshold) / half_width, 0.0, 1.0);
}

// As covered, of a normal channel (fastgen/noise.py) and the `share` of it that lies above the threshold;
// softness in deviations of the channel.
float normal_covered(float value, float share, float lost, float softness) {
    float rare = min(share, 1.0 - share);
    // the quantile of a share: Abramowitz and Stegun 1964, 26.2.22
    float t = sqrt(-2.0 * log(max(rare, 1e-6)));
    float quantile = t - (2.30753 + 0.27061 * t) / (1.0 + t * (0.99229 + 0.04481 * t));
    float threshold = share < 0.5 ? quantile : -quantile;
    float spread = 2.0 * NORMAL_REACH * lost;
    float x = (2.0 * NORMAL_REACH * (value - 0.5) - threshold) *
              inversesqrt(spread * spread + softness * softness);
    // Phi: Page 1977, Approximations to the cumulative normal function and its inverse
    return 1.0 / (1.0 + exp(-x * (1.5976 + 0.070566 * x * x)));
}
