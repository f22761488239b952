// float dirt(float edge_mm, float narrow_mm, NoiseSample streaks): coverage by light dirt, 0..1.
// edge_mm: Distance to the zone's nearest edge, where dirt gathers. narrow_mm: The zone's shorter
// side, which limits the reach, or a narrow beam would be all edge.
// SeaFront paper, section 3.2. The falloff and the softness are artistic choices.

#include "rust.constants"
#include "scene.block"

float dirt(float edge_mm, float narrow_mm, NoiseSample streaks) {
    float near_edge = exp(-edge_mm / min(dirt_reach_mm, EDGE_SHARE * narrow_mm));
    float broken = covered(streaks.value.z, 1.0 - near_edge, streaks.lost.z, 0.35);
    return dirt_strength * near_edge * broken;
}
