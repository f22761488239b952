// Rust rust_at(...): what has rusted, and what rust has stained; vec3 stained(albedo, share).

struct Rust {
    float all;     // share of the footprint whose paint has gone to rust
    float old;     // share that rusted first and has darkened
    float stain;   // of the paint about rust, and where water runs down from it, 0..1
};

// edge_mm, narrow_mm: distance to the nearest edge, and width, of the zone; below_mm: distance to its
// upper edge; steep: 0 where level, else 1. Constants and means: fastgen/drawing/rust.py
Rust rust_at(
    float edge_mm, float narrow_mm, float below_mm, float steep, NoiseSample noise, float proneness
) {
    // water stands along edges, so rust starts there
    float near_edge = exp(-edge_mm / min(RUST_REACH_MM, EDGE_SHARE * narrow_mm));
    float share = min(rust_coverage * proneness * fma(RUST_NEAR, near_edge, RUST_FAR), RUST_MOST);
    float threshold = normal_threshold(share);
    vec3 thresholds = vec3(threshold, normal_threshold(RUST_OLD * share), threshold - HALO);
    vec3 found = normal_covered(noise.value.y, thresholds, noise.lost.y, vec3(0.03, 0.3, HALO_SOFTNESS));
    // and it brings rust down from above
    float below = exp(-below_mm / RUN_REACH_MM);
    float wetted = min(rust_coverage * proneness * fma(RUN_NEAR, below, RUN_FAR), RUN_MOST);
    float run = normal_covered(noise.value.z, normal_threshold(wetted), noise.lost.z, RUN_SOFTNESS);
    // a share of 0 has no threshold
    float rusts = step(1e-4, share);
    return Rust(found.x * rusts, found.y * rusts, max(found.z, steep * run) * rusts);
}

// A thin layer, of which little but red comes back through.
vec3 stained(vec3 albedo, float share) {
    float most = max(max(rust_albedo.r, rust_albedo.g), max(rust_albedo.b, 1e-4));
    vec3 hides = mix(vec3(STAIN_HIDES_MOST), vec3(STAIN_HIDES), rust_albedo / most);
    return albedo * (1.0 - share * hides) + share * STAIN_HIDES * STAIN_ALBEDO * rust_albedo;
}
