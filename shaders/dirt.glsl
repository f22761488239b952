// float dirt(ZonePoint z, NoiseSample streaks): coverage by light dirt, 0..1. It gathers along edges.
// float dirt_streak(ZonePoint z, NoiseSample columns): coverage by dark streaks below upper edges, 0..1.
// SeaFront paper, section 3.2. The falloffs and the softness are artistic choices.

#include "rust.constants"
#include "scene.block"
#include "noise.glsl"
#include "zone_point.glsl"

float dirt(ZonePoint z, NoiseSample streaks) {
    float near_edge = exp(-z.edge_mm / min(dirt_reach_mm, EDGE_SHARE * z.narrow_mm));
    float broken = covered(streaks.value.z, 1.0 - near_edge, streaks.lost.z, 0.35);
    return dirt_strength * near_edge * broken;
}

// Rain washes dirt off ledges. Fewer columns stay dirty the farther down they are.
float dirt_streak(ZonePoint z, NoiseSample columns) {
    float share = dirt_streaks * z.steep * exp2(-z.below_mm / 900.0) * (0.4 + 1.2 * columns.value.y);
    return 0.65 * covered(columns.value.z, 1.12 - 0.75 * share, columns.lost.z, 0.12) * step(1e-4, share);
}
