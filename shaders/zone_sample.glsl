// ZoneSample zone_sample(ivec2 sample_at, uint surface_id, vec3 view): material, ids, damage and depth,
// which are evaluated once per zone in a pixel, at one of its samples. view: Unit, toward the eye.

#include "labels.constants"
#include "lookups.constants"
#include "variant.constants"
#include "scene.block"
#include "view.block"
#include "surface_id.glsl"
#include "zone_id.glsl"
#include "visibility_buffer.glsl"
#include "material.glsl"
#include "sheet_footprint.glsl"
#if WITH_DAMAGE
#include "damage_law.glsl"
#include "rest_position.glsl"
#endif

struct ZoneSample {
    SurfacePoint surface;
    DecalHit decal;
    uint id;              // Value in the id image, not a surface id.
    uint damage;          // Value in the damage mask.
    float depth;          // In m along the optical axis.
    float footprint_mm;   // Width of a lookup of the material layers on the surface.
    Scar scar;            // See DamageSample.
    Footprint decal_pixel;   // A lookup of the decals on the sheet.
#if WITH_DAMAGE
    mat3 bend;            // See DamageSample.
#endif
};

ZoneSample zone_sample(ivec2 sample_at, uint surface_id, vec3 view) {
    vec2 atlas_mm = texelFetch(atlas_positions, sample_at, 0).xy;
    vec3 normal = id_normal(surface_id);
    ZoneSample p;
    p.damage = uint(undamaged_value);
    p.depth = texelFetch(surface_depths, sample_at, 0).r;
    p.scar = NO_SCAR;
#if WITH_DAMAGE
    mark_filter_mm = p.depth * pixel_angle * 1000.0 * inversesqrt(max(dot(normal, view), 0.05));
    DamageSample d = damage_at(rest_at(sample_at));
    if (d.value != 0u) p.damage = d.value;
    p.scar = d.scar;
    p.bend = d.bend;
    normal = deformed_normal(d.bend, normal);
#endif
    float facing = dot(normal, view);
    // Geometric mean of the footprint's two axes on the surface.
    p.footprint_mm = LOOKUP_PX * p.depth * pixel_angle * 1000.0 * inversesqrt(max(facing, 0.05));
    p.decal = NO_DECAL;
#if WITH_DECALS
    p.decal_pixel = sheet_footprint(id_zone(surface_id), normal, view, p.depth);
    p.decal = worn_decals(id_zone(surface_id), atlas_mm, p.decal_pixel);
#endif
    p.surface = surface_at(id_zone(surface_id), atlas_mm, p.footprint_mm, p.scar, p.decal);
    p.id = p.decal.id != 0u ? p.decal.id : zone_id(id_zone(surface_id));
    if (p.id == SPREADER_ID) p.damage = 0u;
    return p;
}
