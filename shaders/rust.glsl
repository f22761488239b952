// Rust rust_at(...): shares of a footprint that are rust or stained by it.
// vec3 stained(vec3 albedo, float share): albedo of paint with `share` under a thin stain of rust.
// Constants: fastgen/render/rust.py, which also computes the mean albedo under rust.

#include "rust.constants"
#include "scene.block"
#include "noise.glsl"
#include "zone_point.glsl"

struct Rust {
    float all;     // Share of the footprint with paint gone to rust.
    float old;     // Share that rusted first and has darkened.
    float stain;   // Stain around rust, and below it by run-off, 0..1.
};

// bare_rust: Share of the footprint that rusts because it is scraped bare. proneness: Factor of the material.
Rust rust_at(ZonePoint z, NoiseSample noise, float bare_rust, float proneness) {
    // Rust comes in groups on open panels. The mean of x^4 over the tone noise is 1 / CLUMP.
    float squared = noise.value.x * noise.value.x;
    float clump = CLUMP * squared * squared;
    // Water collects along edges and at the foot of walls, and the folds of a corrugation are scraped.
    float near_edge = exp(-z.edge_mm / min(RUST_REACH_MM, EDGE_SHARE * z.narrow_mm));
    float foot = z.steep * exp(-z.above_mm / min(FOOT_REACH_MM, EDGE_SHARE * z.narrow_mm));
    float open_panel = mix(RUST_LEVEL, RUST_FAR, z.steep) + RUST_FOLD * z.fold;
    float rate = rust_rate * proneness;
    float share = rate * (open_panel * clump + (RUST_NEAR * near_edge + RUST_FOOT * foot) *
                                               mix(1.0, clump, EDGE_CLUMP));
    share = min(share + bare_rust, RUST_MOST);
    float threshold = normal_threshold(share);
    vec3 thresholds = vec3(threshold, normal_threshold(RUST_OLD * share), threshold - HALO);
    vec3 found = normal_covered(noise.value.y, thresholds, noise.lost.y, vec3(0.03, 0.3, HALO_SOFTNESS));
    // Run-off carries rust down from the upper edge and from rusty places.
    float below = exp(-z.below_mm / RUN_REACH_MM);
    float wetted = min(rate * (RUN_NEAR * below + RUN_FAR * clump) + bare_rust, RUN_MOST);
    float run = normal_covered(noise.value.z, normal_threshold(wetted), noise.lost.z, RUN_SOFTNESS);
    // A share of 0 has no finite threshold.
    float rusts = step(1e-4, share);
    return Rust(found.x * rusts, found.y * rusts, max(found.z, z.steep * run) * rusts);
}

// A stain hides most of the paint in the channels that rust absorbs, so mainly red light returns.
vec3 stained(vec3 albedo, float share) {
    float most = max(max(rust_albedo.r, rust_albedo.g), max(rust_albedo.b, 1e-4));
    vec3 hides = mix(vec3(STAIN_HIDES_MOST), vec3(STAIN_HIDES), rust_albedo / most);
    return albedo * (1.0 - share * hides) + share * STAIN_HIDES * STAIN_ALBEDO * rust_albedo;
}
