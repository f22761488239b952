// float covered(...), normal_covered(...): how much of a footprint lies above a noise threshold;
// normal_threshold(share); NoiseSample read_noise(...), read_without_period(...).

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

// The sum of two lookups whose tiles are to each other as the golden ratio, one of them mirrored, so
// that it repeats nowhere; the grain of the last channel is of one. Weights whose squares add up to 1
// keep mean and deviation, and of normal channels the distribution: Heitz and Neyret 2018,
// High-Performance By-Example Noise using a Histogram-Preserving Blending Operator, section 3.
NoiseSample read_without_period(int layer, vec2 sheet_mm, float tile_mm, float footprint_mm) {
    NoiseSample a = read_noise(layer, sheet_mm, 0.7862 * tile_mm, footprint_mm);
    NoiseSample b = read_noise(layer, vec2(-sheet_mm.x, sheet_mm.y), 1.2720 * tile_mm, footprint_mm);
    a.value.xyz = clamp(0.5 + (a.value.xyz + b.value.xyz - 1.0) * 0.70710678, 0.0, 1.0);
    a.lost.xyz = sqrt(0.5 * (a.lost.xyz * a.lost.xyz + b.lost.xyz * b.lost.xyz));
    return a;
}

// A linear ramp, softer by the spread of what was filtered away: an even spread over a half-width h has
// a variance of h * h / 3, and variances add.
float covered(float value, float threshold, float lost, float softness) {
    float half_width = sqrt(softness * softness + 3.0 * lost * lost);
    return clamp(0.5 + 0.5 * (value - threshold) / half_width, 0.0, 1.0);
}

// Above what a normal channel (fastgen/drawing/noise.py) lies for `share` of the sheet, in deviations: the
// quantile of Abramowitz and Stegun 1964, 26.2.22.
float normal_threshold(float share) {
    float rare = min(share, 1.0 - share);
    float t = sqrt(-2.0 * log(max(rare, 1e-6)));
    float quantile = t - (2.30753 + 0.27061 * t) / (1.0 + t * (0.99229 + 0.04481 * t));
    return share < 0.5 ? quantile : -quantile;
}

// As covered, of a normal channel; thresholds and softness in its deviations.
vec3 normal_covered(float value, vec3 threshold, float lost, vec3 softness) {
    float spread = 2.0 * NORMAL_REACH * lost;
    vec3 x = (2.0 * NORMAL_REACH * (value - 0.5) - threshold) *
             inversesqrt(spread * spread + softness * softness);
    // Phi: Page 1977, Approximations to the cumulative normal function and its inverse
    return 1.0 / (1.0 + exp(-x * (1.5976 + 0.070566 * x * x)));
}

float normal_covered(float value, float threshold, float lost, float softness) {
    return normal_covered(value, vec3(threshold), lost, vec3(softness)).x;
}
