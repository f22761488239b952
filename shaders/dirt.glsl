// float dirt(...): light deposit along the edges of what is narrow_mm wide, 0..1.

float dirt(float edge_mm, float narrow_mm, NoiseSample streaks) {
    float near_edge = exp(-edge_mm / min(dirt_reach_mm, EDGE_SHARE * narrow_mm));
    float broken = covered(streaks.value.z, 1.0 - near_edge, streaks.lost.z, 0.35);
    return dirt_strength * near_edge * broken;
}
