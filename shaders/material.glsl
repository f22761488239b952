// SurfacePoint surface_at(uint zone, vec2 atlas_mm, float footprint_mm, Scar scar, DecalHit decal): material
// of a point after all layers. footprint_mm: Width of the lookup on the surface. The layers follow section
// 3.2 of the SeaFront paper. Colours and blend weights here are artistic choices.
// DecalHit worn_decals(uint zone, vec2 atlas_mm, Footprint pixel): decals at a point, weathered.

#include "reflectance.constants"
#include "variant.constants"
#include "zones.constants"
#include "scene.block"
#include "brdf.glsl"
#include "noise.glsl"
#include "ageing.glsl"
#include "dirt.glsl"
#include "rust.glsl"
#include "scar.glsl"
#include "scratches.glsl"
#include "wear.glsl"
#include "wetness.glsl"
#include "decal_cell.glsl"
#include "decal.glsl"
#include "zone.glsl"
#include "zone_point.glsl"

const vec3 STREAK_ALBEDO = vec3(0.07, 0.06, 0.05);
// Height of noise relative to its width: of rust on steep parts, and of dirt and scrapes, which run down.
const float RUST_SQUEEZE = 0.6;
const float COLUMN_SQUEEZE = 0.12;
// Share of a scrape that rusts, relative to the rate of rust, and its upper limit.
const float SCRAPE_RUST = 6.0;
const float SCRAPE_RUST_MOST = 0.5;
// Stain below a scrape, relative to its rust.
const float SCRAPE_STAIN = 4.0;

struct SurfacePoint {
    Material material;
    vec3 outward;   // Outward axis of a panel's face, or 0; see zone.glsl.
    float decal_share;   // Share of the footprint that shows a decal.
};

vec2 noise_position(vec2 atlas_mm, int code) { return upright(atlas_mm, code) + noise_offset_mm; }

NoiseSample coarse_noise(vec2 noise_mm, int code, float footprint_mm) {
    float squeeze = (code & ZONE_LEVEL) == 0 ? RUST_SQUEEZE : 1.0;
    return read_without_period(0, vec2(noise_mm.x, squeeze * noise_mm.y), rust_tile_mm, footprint_mm);
}

NoiseSample streak_noise(vec2 noise_mm, float footprint_mm) {
    return read_noise(1, noise_mm + 3100.0, wear_tile_mm, footprint_mm);
}

DecalHit worn_decals(uint zone, vec2 atlas_mm, Footprint pixel) {
    int code = int(texelFetch(zone_table, ivec2(int(zone), 1), 0).x);
    vec2 noise_mm = noise_position(atlas_mm, code);
    return decals_at(sheet_number(code), atlas_mm, pixel, coarse_noise(noise_mm, code, pixel.mean_mm),
                     streak_noise(noise_mm, pixel.mean_mm));
}

SurfacePoint surface_at(uint zone, vec2 atlas_mm, float footprint_mm, Scar scar, DecalHit decal) {
    vec4 rect = texelFetch(zone_table, ivec2(int(zone), 0), 0);
    vec4 part = texelFetch(zone_table, ivec2(int(zone), 1), 0);
    int code = int(part.x);
    int kind = code & ZONE_MATERIAL;
    vec4 base = material_base[kind];   // Albedo, roughness.
    vec4 trait = material_trait[kind]; // Metallic, rust proneness, share of the paint layers, unused.

    ZonePoint z = zone_point(rect, texelFetch(zone_table, ivec2(int(zone), 2), 0), code, atlas_mm,
                             footprint_mm);
    vec2 noise_mm = noise_position(atlas_mm, code);
    NoiseSample coarse = coarse_noise(noise_mm, code, footprint_mm);
    NoiseSample streaks = streak_noise(noise_mm, footprint_mm);
    NoiseSample columns = read_noise(1, vec2(noise_mm.x, COLUMN_SQUEEZE * noise_mm.y), wear_tile_mm,
                                     footprint_mm);

    SurfacePoint s;
    s.outward = part.yzw;
    vec3 albedo = base.rgb;
    float roughness = base.a;

#if SHOWN_TONE
    albedo *= 1.0 + trait.z * tone_variation * (2.0 * coarse.value.x - 1.0);
#endif
#if SHOWN_AGEING
    float bleach_share = trait.z * bleaching(z, coarse.value.x, columns.value.y);
    albedo = bleached(albedo, bleach_share);
    roughness = mix(roughness, 0.8, 0.6 * bleach_share);
#endif
    float decal_alpha = 0.0, patched = 0.0;
#if WITH_DECALS && SHOWN_DECALS
    albedo = decal.ink + (1.0 - decal.alpha) * albedo;
    decal_alpha = decal.alpha;
    patched = decal.patched;
    roughness = mix(roughness, 0.45, 0.6 * decal_alpha);
#endif
#if SHOWN_AGEING
    albedo *= 1.0 - 0.85 * trait.z * ageing(z, coarse.value.x);
#endif
#if SHOWN_REFLECTION
    roughness = worn_roughness(roughness, streaks);
#endif
    float bare = 0.0, run = 0.0;
#if SHOWN_SCRATCHES
    float scraped = trait.z * scratches(streaks);
    bare = trait.z * scrapes(z, coarse, streaks, columns);
    run = trait.z * scrape_runs(z, columns);
    albedo = mix(albedo, vec3(0.38, 0.36, 0.33), max(0.5 * scraped, 0.8 * bare));
#endif
#if SHOWN_DIRT
    float grime = trait.z * dirt(z, streaks);
    float streak = trait.z * dirt_streak(z, columns);
    albedo = mix(mix(albedo, dirt_albedo, grime), STREAK_ALBEDO, streak);
    grime = max(grime, streak);
    roughness = mix(roughness, 0.9, grime);
#endif
    float rusty = 0.0;
#if SHOWN_RUST
    float sticker = 1.0 - 0.8 * decal_alpha;
    float scrape_rust = min(SCRAPE_RUST * rust_rate * trait.y, SCRAPE_RUST_MOST);
    Rust rust = rust_at(z, coarse, bare * scrape_rust, trait.y);
    albedo = stained(albedo, sticker * max(rust.stain, run * min(SCRAPE_STAIN * scrape_rust, 1.0)));
    rusty = sticker * rust.all;
#if WITH_DAMAGE
    // Bent steel has dull paint first, then rust where the noise is rustiest. Rubber does not rust, and
    // door gear in front of the sheet is not scarred. Repairs are painted over bent steel.
    float worn = scar.wear * ((code & ZONE_GEAR) == 0 ? step(1e-4, trait.y) : 0.0) *
                 (scar.over_repairs ? 1.0 : 1.0 - patched);
    albedo = mix(albedo, mix(rust_albedo * 0.7, scar.albedo, scar.fresh), mix(0.5, 0.9, scar.fresh) * worn);
    rusty = max(rusty, normal_covered(coarse.value.y, normal_threshold(worn), coarse.lost.y, 0.3) *
                       step(0.01, worn) * (1.0 - scar.fresh));
#endif
    float old = clamp(sticker * rust.old / max(rusty, 1e-4), 0.0, 1.0);
    // The factor is 1 on average: RUST_OLD of the rust is old.
    vec3 ochre = rust_albedo * (0.45 + 1.1 * streaks.value.w) * mix(1.22, 0.6, old);
    albedo = mix(albedo, ochre, rusty);
    roughness = mix(roughness, rust_roughness, rusty);
#endif
    s.decal_share = decal_alpha * (1.0 - rusty);
    float metallic = trait.x * (1.0 - rusty);
    apply_wetness(albedo, roughness, metallic, wetness * (0.6 + 0.4 * coarse.value.x));
    s.material = Material(clamp(albedo, 0.0, 0.95), max(roughness, MIN_ROUGHNESS), metallic);
    return s;
}
