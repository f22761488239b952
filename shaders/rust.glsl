// Rust rust_at(...): shares of a footprint that are rust or stained by it.
// vec3 stained(vec3 albedo, float share): albedo of paint with `share` under a thin stain of rust.
// Constants: fastgen/render/rust.py, which also computes the mean albedo under rust.

#include "rust.constants"
#include "scene.block"

struct Rust {
    float all;     // Share of the footprint with paint gone to rust.
    float old;     // Share that rusted first and has darkened.
    float stain;   // Stain around rust, and below it by run-off, 0..1.
};

// edge_mm: Distance to the zone's nearest edge. narrow_mm: The zone's shorter side. below_mm: Distance
// to its upper edge. steep: 0 if the zone is level, else 1. proneness: Factor of the material.
Rust rust_at(
    float edge_mm, float narrow_mm, float below_mm, float steep, NoiseSample noise, float proneness
) {
    // Water collects along edges, so rust starts there.
    float near_edge = exp(-edge_mm / min(RUST_REACH_MM, EDGE_SHARE * narrow_mm));
    float share = min(rust_coverage * proneness * fma(RUST_NEAR, near_edge, RUST_FAR), RUST_MOST);
    float threshold = normal_threshold(share);
    vec3 thresholds = vec3(threshold, normal_threshold(RUST_OLD * share), threshold - HALO);
    vec3 found = normal_covered(noise.value.y, thresholds, noise.lost.y, vec3(0.03, 0.3, HALO_SOFTNESS));
    // Run-off carries rust down from the upper edge.
    float below = exp(-below_mm / RUN_REACH_MM);
    float wetted = min(rust_coverage * proneness * fma(RUN_NEAR, below, RUN_FAR), RUN_MOST);
    float run = normal_covered(noise.value.z, normal_threshold(wetted), noise.lost.z, RUN_SOFTNESS);
    // A share of 0 has no finite threshold.
    float rusts = step(1e-4, share);
    return Rust(found.x * rusts, found.y * rusts, max(found.z, steep * run) * rusts);
}

// A stain hides most of the paint in the channels that rust absorbs, so mainly red light returns.
vec3 stained(vec3 albedo, float share) {
    float most = max(max(rust_albedo.r, rust_albedo.g), max(rust_albedo.b, 1e-4));
    vec3 hides = mix(vec3(STAIN_HIDES_MOST), vec3(STAIN_HIDES), rust_albedo / most);
    return albedo * (1.0 - share * hides) + share * STAIN_HIDES * STAIN_ALBEDO * rust_albedo;
}
