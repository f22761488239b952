// float rust(...): fraction of paint gone to rust, 0..1; rust_stain(...): run-off on sound paint below.

float rust(float edge_mm, float narrow_mm, NoiseSample noise, float proneness) {
    // water stands along edges, so rust starts there
    float near_edge = exp(-edge_mm / min(90.0, EDGE_SHARE * narrow_mm));
    float share = min(rust_coverage * proneness * (0.6 + 3.0 * near_edge), 0.9);
    return normal_covered(noise.value.y, share, noise.lost.y, 0.03) * step(1e-4, share);
}

float rust_stain(NoiseSample noise) {
    return clamp(rust_coverage * 7.0, 0.0, 0.7) * noise.value.z;
}
