// vec4 coarse_mean(sampler2D values, ivec2 sample_at), vec4 coarse_mean_bytes(usampler2D values, ...):
// value of a visibility-buffer texture where a pixel is shaded. sample_at: Texel of the pixel's sample.
// 2x2 coarse shading evaluates several pixels once, midway between the first and the last pixel.

#include "variant.constants"

// Offset of the last pixel from the first, and number of pixels.
#if WITH_COARSE
ivec2 coarse_offset;
float coarse_pixels;
#else
const ivec2 coarse_offset = ivec2(0);
const float coarse_pixels = 1.0;
#endif

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
