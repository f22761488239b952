// vec3 zone_color(ZoneSample p, ivec2 sample_at, uint surface_id, vec3 ray, vec3 view): light of a sample
// toward the eye. p: Material of its zone. ray: View ray of the sample. view: Unit, toward the eye.

#include "materials.constants"
#include "variant.constants"
#include "scene.block"
#include "view.block"
#include "layer_color.glsl"
#include "sample_lattice.glsl"
#include "sky_visibility_at.glsl"
#include "surface_id.glsl"
#include "visibility_buffer.glsl"
#include "zone_sample.glsl"
#if LIGHTS
#include "light_visibility.glsl"
#endif
#if TRACED
#include "traced_light.glsl"
#endif

vec3 zone_color(ZoneSample p, ivec2 sample_at, uint surface_id, vec3 ray, vec3 view) {
    vec3 normal = id_normal(surface_id);
    SkyVisibility sky = sky_visibility_at(sample_at, id_zone(surface_id));
#if WITH_DAMAGE
    normal = deformed_normal(p.bend, normal);
    sky.bent_normal = deformed_normal(p.bend, sky.bent_normal);
#endif
    // Occluders are assumed to have the local albedo, because heavy rust is rarely isolated. A decal
    // says nothing about them, so the sheet's paint replaces it.
    vec3 paint = material_base[SHEET_MATERIAL].rgb;
    sky.occluder_albedo = mix(p.surface.material.albedo, paint, p.surface.decal_share);
    // Above a roof the occluder is the spreader.
    float overhead = above.a * sky.lacks_indirect * max(p.surface.outward.z, 0.0);
    sky.occluder_albedo = mix(sky.occluder_albedo, above.rgb, overhead);
    vec4 light_seen = vec4(0.0);
    float depth = texelFetch(surface_depths, sample_at, 0).r;
    vec3 from_eye = depth * ray;
#if TRACED
    sky.traced = traced_light_at(sample_position(sample_at), surface_id, from_eye, normal);
#endif
#if LIGHTS && LAYER == LAYER_ALL
    light_seen = light_visibility(p.surface.outward, from_eye, normal, depth * pixel_angle);
#endif
    return layer_color(p.surface.material, normal, view, sky, light_seen);
}
