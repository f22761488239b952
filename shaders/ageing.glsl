// float ageing(float corner_mm, float tone): darkening toward the corners of a panel, 0..1.

float ageing(float corner_mm, float tone) {
    float near_corner = 1.0 - smoothstep(0.0, ageing_reach_mm, corner_mm);
    return ageing_strength * near_corner * (0.55 + 0.45 * tone);
}
