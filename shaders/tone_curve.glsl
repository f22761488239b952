// Twin of fastgen/camera/tone_curve.py.
// vec3 neutral_tone(vec3 c): exposed linear radiance to linear display colour.
// vec3 srgb_encode(vec3 c), vec3 srgb_decode(vec3 c): sRGB transfer function and its inverse.

#include "tone.constants"

// Khronos PBR Neutral (Khronos Group 2024, specification section 2; constants in the twin): subtracts
// the Fresnel offset, then compresses highlights toward white.
vec3 neutral_tone(vec3 c) {
    const float start = TONE_SHOULDER - TONE_FRESNEL;
    float low = min(c.r, min(c.g, c.b));
    c -= low < 2.0 * TONE_FRESNEL ? low - 0.25 / TONE_FRESNEL * low * low : TONE_FRESNEL;
    float peak = max(c.r, max(c.g, c.b));
    // A peak clamped to `start` makes the formula below the identity, so no branch is needed.
    const float d = 1.0 - start;
    float shoulder = clamp(peak, start, 1e6);   // Keeps the fourth power below finite.
    // The compressed peak is (over - d * d) / over, and the share of white is 1 - over / whitened. One
    // common divisor saves a division.
    float over = shoulder + d - start;
    float whitened = TONE_DESATURATION * (shoulder * over - over + d * d) + over;
    float kept = (over - d * d) / (over * shoulder * whitened);
    return c * (over * kept) + (whitened - over) * shoulder * kept;
}

// IEC 61966-2-1. A polynomial in the square root replaces the power 1/2.4; its error is at most 0.05
// of a step of 255.
vec3 srgb_encode(vec3 c) {
    vec3 x = sqrt(c);
    vec3 curve = fma(vec3(-0.94768983), x, vec3(3.41874960));
    curve = fma(curve, x, vec3(-5.00325045));
    curve = fma(curve, x, vec3(3.89849402));
    curve = fma(curve, x, vec3(-1.89949377));
    curve = fma(curve, x, vec3(1.57527351));
    curve = fma(curve, x, vec3(-0.04223207));
    return mix(curve, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

vec3 srgb_decode(vec3 c) {
    vec3 curve = pow((c + 0.055) / 1.055, vec3(2.4));
    return mix(curve, c / 12.92, lessThanEqual(c, vec3(0.04045)));
}
