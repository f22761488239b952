// NoiseSample read_noise(int layer, vec2 noise_mm, float tile_mm, float footprint_mm): filtered noise.
// NoiseSample read_without_period(...): the same, without visible repetition.
// float covered(float value, float threshold, float lost, float softness): share of a footprint where
// uniform noise exceeds a threshold, 0..1. normal_covered(...) does it for normally distributed noise.
// float normal_threshold(float share): threshold that `share` of a normal channel exceeds.
// See noise.py for the channels. Both kinds of noise follow the idea of LEAN mapping (Olano and Baker
// 2010): variance that filtering removes returns as softness of the threshold.

#include "noise.constants"
#include "scene.block"

uniform sampler2DArray noise_tiles;

struct NoiseSample {
    vec4 value;
    vec4 lost;   // Standard deviation that filtering removed.
};

// tile_mm: Side of a noise tile on the surface. footprint_mm: Width of the lookup on the surface.
// The mip level's texels are at most as wide as the footprint, because bilinear filtering widens them.
NoiseSample read_noise(int layer, vec2 noise_mm, float tile_mm, float footprint_mm) {
    // The exponent bits of a positive float are floor(log2(x)) + 127.
    int exponent = (floatBitsToInt(footprint_mm * NOISE_SIZE / tile_mm) >> 23) - 127;
    int level = clamp(exponent, 0, NOISE_LEVELS - 1);
    vec4 value = textureLod(noise_tiles, vec3(noise_mm / tile_mm, layer), float(level));
    return NoiseSample(value, noise_lost[layer * NOISE_LEVELS + level]);
}

// Sums two lookups. One is mirrored, and their tiles differ in size by the golden ratio, so the sum
// repeats nowhere. The last channel, grain, has one lookup. The squares of the weights add up to 1,
// which keeps mean and deviation, and the distribution of normal channels: Heitz and Neyret 2018,
// High-Performance By-Example Noise using a Histogram-Preserving Blending Operator, section 3.
NoiseSample read_without_period(int layer, vec2 noise_mm, float tile_mm, float footprint_mm) {
    NoiseSample a = read_noise(layer, noise_mm, 0.7862 * tile_mm, footprint_mm);
    NoiseSample b = read_noise(layer, vec2(-noise_mm.x, noise_mm.y), 1.2720 * tile_mm, footprint_mm);
    a.value.xyz = clamp(0.5 + (a.value.xyz + b.value.xyz - 1.0) * 0.70710678, 0.0, 1.0);
    a.lost.xyz = sqrt(0.5 * (a.lost.xyz * a.lost.xyz + b.lost.xyz * b.lost.xyz));
    return a;
}

// A linear ramp about the threshold, widened by the deviation lost. A uniform distribution of
// half-width h has the variance h * h / 3, and variances add.
float covered(float value, float threshold, float lost, float softness) {
    float half_width = sqrt(softness * softness + 3.0 * lost * lost);
    return clamp(0.5 + 0.5 * (value - threshold) / half_width, 0.0, 1.0);
}

// The normal quantile of Abramowitz and Stegun 1964, 26.2.22, in standard deviations.
float normal_threshold(float share) {
    float rare = min(share, 1.0 - share);
    float t = sqrt(-2.0 * log(max(rare, 1e-6)));
    float quantile = t - (2.30753 + 0.27061 * t) / (1.0 + t * (0.99229 + 0.04481 * t));
    return share < 0.5 ? quantile : -quantile;
}

// Thresholds and softness are in standard deviations of the channel.
vec3 normal_covered(float value, vec3 threshold, float lost, vec3 softness) {
    float spread = 2.0 * NORMAL_REACH * lost;
    vec3 x = (2.0 * NORMAL_REACH * (value - 0.5) - threshold) *
             inversesqrt(spread * spread + softness * softness);
    // Normal distribution function: Page 1977, Approximations to the Cumulative Normal Function and its
    // Inverse.
    return 1.0 / (1.0 + exp(-x * (1.5976 + 0.070566 * x * x)));
}

float normal_covered(float value, float threshold, float lost, float softness) {
    return normal_covered(value, vec3(threshold), lost, vec3(softness)).x;
}
