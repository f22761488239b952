// ZoneSample zone_sample(ivec2 sample_at, uint key, vec3 view): material, ids, damage and depth, which
// are evaluated once per zone in a pixel, at one of its samples. key: Surface id of the sample. view:
// Unit, toward the eye.

#include "labels.constants"
#include "lookups.constants"
#include "variant.constants"
#include "scene.block"
#include "view.block"
#include "coarse_shading.glsl"
#include "surface_id.glsl"
#include "zone_id.glsl"
#include "visibility_buffer.glsl"
#include "material.glsl"
#if WITH_DAMAGE
#include "damage_law.glsl"
#include "rest_position.glsl"
#endif

struct ZoneSample {
    SurfacePoint surface;
    uint id;              // Value in the id image, not a surface id.
    uint damage;          // Value in the damage mask.
    float depth;          // In m along the optical axis.
    float footprint_mm;   // Width of a material lookup on the surface.
    Scar scar;            // See DamageSample.
#if WITH_DAMAGE
    mat3 bend;            // See DamageSample.
#endif
};

ZoneSample zone_sample(ivec2 sample_at, uint key, vec3 view) {
    vec2 atlas_mm = coarse_mean(atlas_positions, sample_at).xy;
    vec3 normal = id_normal(key);
    ZoneSample p;
    p.damage = uint(undamaged_value);
    p.depth = coarse_mean(surface_depths, sample_at).r;
    p.scar = NO_SCAR;
#if WITH_DAMAGE
    DamageSample d = damage_at(rest_at(sample_at));
    if (d.value != 0u) p.damage = d.value;
    p.scar = d.scar;
    p.bend = d.bend;
    normal = deformed_normal(d.bend, normal);
#endif
    float facing = dot(normal, view);
    // Geometric mean of the footprint's two axes on the surface.
    p.footprint_mm = sqrt(coarse_pixels) * LOOKUP_PX * p.depth * pixel_angle * 1000.0 *
                     inversesqrt(max(facing, 0.05));
    p.surface = surface_at(id_zone(key), atlas_mm, p.footprint_mm, p.scar);
    p.id = p.surface.decal_id != 0u ? p.surface.decal_id : zone_id(id_zone(key));
    if (p.id == SPREADER_ID) p.damage = 0u;
    return p;
}
