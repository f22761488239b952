// float scratches(NoiseSample streaks): share of the footprint scratched to bare steel, 0..1.
// float scrapes(ZonePoint z, NoiseSample coarse, NoiseSample streaks, NoiseSample columns): share scraped by
// forks and spreaders.
// float scrape_runs(ZonePoint z, NoiseSample columns): share of the footprint down which water runs from scrapes.
// SeaFront paper, section 3.2. Heights and shapes of scrapes are artistic choices.

#include "noise.constants"
#include "scene.block"
#include "noise.glsl"
#include "zone_point.glsl"

float scratches(NoiseSample streaks) {
    // The tile's lines show only in the most worn paint, so that they cover scratch_coverage of the
    // surface. They cover SCRATCHED_SHARE of the tile.
    float worn = clamp(scratch_coverage / SCRATCHED_SHARE, 0.0, 1.0);
    return streaks.value.x * covered(streaks.value.y, 1.0 - worn, streaks.lost.y, 0.02) *
           step(1e-4, worn);
}

// Heights below the lower edge of the scrapes of a spreader, and above the foot, at which runs end.
const float RUNS_MM = 500.0;
const float FORK_RUNS_MM = 450.0;

// The columns of noise are so tall that those which scraped the steel above are still the same here.
float scrape_runs(ZonePoint z, NoiseSample columns) {
    float spreader = smoothstep(200.0, 420.0, z.below_mm) * exp((420.0 - z.below_mm) / RUNS_MM);
    float forks = 1.0 - smoothstep(0.4 * FORK_RUNS_MM, FORK_RUNS_MM, z.above_mm);
    float share = scrape_share * z.steep * z.raised * min(max(spreader, forks), 1.0);
    return covered(columns.value.y, 1.0 - share, columns.lost.y, 0.08) * step(1e-4, share);
}

float scrapes(ZonePoint z, NoiseSample coarse, NoiseSample streaks, NoiseSample columns) {
    float forks = smoothstep(60.0, 250.0, z.above_mm) * (1.0 - smoothstep(500.0, 850.0, z.above_mm));
    float spreader = 1.0 - smoothstep(120.0, 420.0, z.below_mm);
    float share = scrape_share * z.steep * z.raised * max(forks, spreader);
    // The mean of two uniform values exceeds 1 - x, for x below 1/2, with the probability 2 x * x.
    float hit = covered(0.5 * (columns.value.y + streaks.value.y), 1.0 - sqrt(0.5 * share),
                        0.5 * length(vec2(columns.lost.y, streaks.lost.y)), 0.03);
    float bare = covered(0.5 * (columns.value.w + coarse.value.w), 0.42,
                         0.5 * length(vec2(columns.lost.w, coarse.lost.w)), 0.12);
    return hit * bare * step(1e-4, share);
}
