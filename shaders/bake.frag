// Fragment stage of texture export: evaluates the unlit material layers at one atlas texel.
// Reads the atlas position and zone, and the rest position if there is damage. Writes base colour,
// roughness and metallic.
#version 430 core
#include "variant.constants"
#include "tone_curve.glsl"
#include "material.glsl"
#if WITH_DAMAGE
#include "damage_law.glsl"

in vec3 rest_mm;
#endif

in vec2 atlas_mm;
flat in uint zone;

uniform float texel_mm;

layout(location = 0) out vec4 out_albedo;    // sRGB-encoded; alpha is 1 inside a part.
layout(location = 1) out vec4 out_surface;   // Unused, roughness, metallic: glTF 2.0, section 3.9.2.

void main() {
    Scar scar = NO_SCAR;
#if WITH_DAMAGE
    mark_filter_mm = texel_mm;
    scar = damage_at(rest_mm).scar;
#endif
    DecalHit decal = NO_DECAL;
#if WITH_DECALS
    decal = worn_decals(zone, atlas_mm, footprint_of(mat2(texel_mm), vec3(0.0)));
#endif
    Material m = surface_at(zone, atlas_mm, texel_mm, scar, decal).material;
    out_albedo = vec4(srgb_encode(m.albedo), 1.0);
    out_surface = vec4(1.0, m.roughness, m.metallic, 1.0);
}
