// float ageing(float corner_mm, float narrow_mm, float tone): darkening near a panel's corners, 0..1.
// corner_mm: Distance to the nearest corner. narrow_mm: The panel's shorter side: the darkening
// reaches at most half that far. tone: Paint-tone noise, 0..1, which breaks up the pattern.
// SeaFront paper, section 3.2. The two weights are artistic choices.

#include "scene.block"

float ageing(float corner_mm, float narrow_mm, float tone) {
    float near_corner = 1.0 - smoothstep(0.0, min(ageing_reach_mm, 0.5 * narrow_mm), corner_mm);
    return ageing_strength * near_corner * (0.55 + 0.45 * tone);
}
