// float dirt(float edge_mm, NoiseSample streaks): light deposit along the edges, 0..1.

float dirt(float edge_mm, NoiseSample streaks) {
    float near_edge = exp(-edge_mm / dirt_reach_mm);
    float broken = covered(streaks.value.z, 1.0 - near_edge, streaks.lost.z, 0.35);
    return dirt_strength * near_edge * broken;
}
