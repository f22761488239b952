// vec3 display_color(vec3 radiance): exposed linear radiance to sRGB-encoded 0..1.

// Khronos PBR Neutral tone mapper (Khronos Group 2024, specification section 2): the identity below
// 0.8 less the Fresnel offset, then a shoulder that leans to white.
vec3 neutral_tone(vec3 c) {
    const float start = 0.8 - 0.04;
    const float desaturation = 0.15;
    float low = min(c.r, min(c.g, c.b));
    c -= low < 0.08 ? low - 6.25 * low * low : 0.04;
    float peak = max(c.r, max(c.g, c.b));
    if (peak < start) return c;
    const float d = 1.0 - start;
    float new_peak = 1.0 - d * d / (peak + d - start);
    c *= new_peak / peak;
    float g = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0);
    return mix(c, vec3(new_peak), g);
}

// IEC 61966-2-1
vec3 srgb_encode(vec3 c) {
    vec3 curve = 1.055 * pow(max(c, 0.0031308), vec3(1.0 / 2.4)) - 0.055;
    return mix(curve, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

vec3 srgb_decode(vec3 c) {
    vec3 curve = pow((c + 0.055) / 1.055, vec3(2.4));
    return mix(curve, c / 12.92, lessThanEqual(c, vec3(0.04045)));
}
