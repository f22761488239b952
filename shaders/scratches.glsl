// float scratches(NoiseSample streaks): share of the footprint scraped to bare steel, 0..1.
// SeaFront paper, section 3.2.

#include "noise.constants"
#include "scene.block"

float scratches(NoiseSample streaks) {
    // The tile's lines show only in the most worn paint, so that they cover scratch_coverage of the
    // surface. They cover SCRATCHED_SHARE of the tile.
    float worn = clamp(scratch_coverage / SCRATCHED_SHARE, 0.0, 1.0);
    return streaks.value.x * covered(streaks.value.y, 1.0 - worn, streaks.lost.y, 0.02) *
           step(1e-4, worn);
}
