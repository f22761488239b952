// float scratches(NoiseSample streaks): share that is scraped to the bare steel.

float scratches(NoiseSample streaks) {
    // paint that is most worn is scraped, where the tile has its lines
    float worn = clamp(scratch_coverage / SCRATCHED_SHARE, 0.0, 1.0);
    return streaks.value.x * covered(streaks.value.y, 1.0 - worn, streaks.lost.y, 0.02) *
           step(1e-4, worn);
}
