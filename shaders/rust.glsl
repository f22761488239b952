// float rust(...): fraction of paint gone to rust, 0..1; rust_stain(...): run-off on sound paint below.

float rust(float edge_mm, NoiseSample noise, float proneness) {
    // water stands along edges, so rust starts there
    float share = min(rust_coverage * proneness * (0.6 + 3.0 * exp(-edge_mm / 90.0)), 0.9);
    return normal_covered(noise.value.y, share, noise.lost.y, 0.03) * step(1e-4, share);
}

float rust_stain(NoiseSample noise) {
    return clamp(rust_coverage * 7.0, 0.0, 0.7) * noise.value.z;
}
