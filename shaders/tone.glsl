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
    float shoulder = clamp(peak, start, 1e6);   // white anyway, and a fourth power below
    // of what comes out, the peak is (over - d * d) / over and the share of white 1 - over / whitened: both
    // over one divisor, for divisions are dear
    float over = shoulder + d - start;
    float whitened = TONE_DESATURATION * (shoulder * over - over + d * d) + over;
    float kept = (over - d * d) / (over * shoulder * whitened);
    return c * (over * kept) + (whitened - over) * shoulder * kept;
}

// IEC 61966-2-1, within a twentieth of a step of 255: the power 1/2.4 as a polynomial of the square root
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
