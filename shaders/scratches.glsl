// float scratches(NoiseSample lines): bare scraped lines, 0..1.

float scratches(NoiseSample lines) {
    // the lines take up about a fiftieth of the tile when all are shown
    float shown = clamp(scratch_coverage * 50.0, 0.0, 1.0);
    return covered(lines.value.x, 1.0 - shown, lines.lost.x, 0.02) * step(0.004, lines.value.x) *
           step(1e-4, shown);
}
