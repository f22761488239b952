// Exposed linear radiance to what a screen shows, and sRGB encoding.

// Khronos PBR Neutral (fastgen/light/tone.py): the identity less the Fresnel offset, then a shoulder that
// leans to white.
vec3 neutral_tone(vec3 c) {
    const float start = TONE_SHOULDER - TONE_FRESNEL;
    float low = min(c.r, min(c.g, c.b));
    c -= low < 2.0 * TONE_FRESNEL ? low - 0.25 / TONE_FRESNEL * low * low : TONE_FRESNEL;
    float peak = max(c.r, max(c.g, c.b));
    // where the peak is below the start, the shoulder's own formula leaves c as it is
    const float d = 1.0 - start;
    float shoulder = max(peak, start);
    float new_peak = 1.0 - d * d / (shoulder + d - start);
    float white = TONE_DESATURATION * (shoulder - new_peak) + 1.0;
    float keep = 1.0 / (shoulder * white);
    return c * (new_peak * keep) + (new_peak - new_peak * shoulder * keep);
}

// IEC 61966-2-1, within 1e-5: the power 1/2.4 as a polynomial of the fourth root, which costs less
vec3 srgb_encode(vec3 c) {
    vec3 x = sqrt(sqrt(c));
    vec3 curve = fma(vec3(-0.06538064), x, vec3(0.28097106));
    curve = fma(curve, x, vec3(-0.56738774));
    curve = fma(curve, x, vec3(1.24977997));
    curve = fma(curve, x, vec3(0.16349550));
    curve = fma(curve, x, vec3(-0.06148334));
    return mix(curve, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

vec3 srgb_decode(vec3 c) {
    vec3 curve = pow((c + 0.055) / 1.055, vec3(2.4));
    return mix(curve, c / 12.92, lessThanEqual(c, vec3(0.04045)));
}
