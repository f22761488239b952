// SurfacePoint empty_material_sum(SurfacePoint first): start of a mean over several material lookups.
// void add_material(inout SurfacePoint sum, ZoneSample p, uint zone, vec2 atlas_mm, float count): adds the
// material of `p` at another atlas position to `sum`, the mean of `count` lookups.

#include "lookups.constants"
#include "variant.constants"
#include "zone_sample.glsl"

// Keeps the values of the first lookup that are the same for all.
SurfacePoint empty_material_sum(SurfacePoint first) {
    first.material = Material(vec3(0.0), 0.0, 0.0);
    first.decal_share = 0.0;
    return first;
}

void add_material(inout SurfacePoint sum, ZoneSample p, uint zone, vec2 atlas_mm, float count) {
    DecalHit decal = p.decal;
#if WITH_DECALS && DECALS_EACH_LOOKUP
    decal = worn_decals(zone, atlas_mm, p.decal_pixel);
#endif
    SurfacePoint s = surface_at(zone, atlas_mm, p.footprint_mm, p.scar, decal);
    sum.material.albedo += s.material.albedo / count;
    sum.material.roughness += s.material.roughness / count;
    sum.material.metallic += s.material.metallic / count;
    sum.decal_share += s.decal_share / count;
}
