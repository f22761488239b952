// float ageing(...): darkening toward the corners of a panel that is narrow_mm wide, 0..1.

float ageing(float corner_mm, float narrow_mm, float tone) {
    float near_corner = 1.0 - smoothstep(0.0, min(ageing_reach_mm, 0.5 * narrow_mm), corner_mm);
    return ageing_strength * near_corner * (0.55 + 0.45 * tone);
}
