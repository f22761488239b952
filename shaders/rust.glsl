// Rust rust_at(...): what has rusted, and what rust has stained; vec3 stained(albedo, share).

struct Rust {
    float all;     // share of the footprint whose paint has gone to rust
    float thick;   // share that rusted first and has darkened
    float stain;   // of the paint about rust, and where water runs down from it, 0..1
};

// edge_mm, narrow_mm: distance to the nearest edge, and width, of the zone; below_mm: distance to its
// upper edge; steep: 0 where level, 1 where upright
Rust rust_at(
    float edge_mm, float narrow_mm, float below_mm, float steep, NoiseSample noise, float proneness
) {
    // water stands along edges, so rust starts there
    float near_edge = exp(-edge_mm / min(RUST_REACH_MM, EDGE_SHARE * narrow_mm));
    float share = min(rust_coverage * proneness * (0.6 + 3.0 * near_edge), 0.9);
    vec3 thresholds = normal_threshold(share) + vec3(0.0, 0.5, -0.3);
    vec3 found = normal_covered(noise.value.y, thresholds, noise.lost.y, vec3(0.03, 0.3, 0.25));
    // and it brings rust down from above
    float wetted = min(rust_coverage * proneness * (1.2 + 4.0 * exp(-below_mm / RUN_REACH_MM)), 0.6);
    float run = normal_covered(noise.value.z, normal_threshold(wetted), noise.lost.z, 0.5);
    float any = step(1e-4, share);
    return Rust(found.x * any, found.y * any, max(found.z, steep * run) * any);
}

// A thin layer, of which little but red comes back through.
vec3 stained(vec3 albedo, float share) {
    float most = max(max(rust_albedo.r, rust_albedo.g), max(rust_albedo.b, 1e-4));
    vec3 hides = mix(vec3(STAIN_HIDES_MOST), vec3(STAIN_HIDES), rust_albedo / most);
    return mix(albedo, STAIN_ALBEDO * rust_albedo, share * hides);
}
