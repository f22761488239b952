// Shaded shade_cable(vec2 center): a pixel that cables cover in part. center: Its position in pixels.
// Steel with its mean rust is mixed with the sky by coverage. The eye sees two of a cable's four
// axis-aligned sides, each in proportion to how it faces the eye.

#include "materials.constants"
#include "variant.constants"
#include "scene.block"
#include "view.block"
#include "cables.glsl"
#include "layer_color.glsl"
#include "shade_sky.glsl"
#include "view_ray.glsl"
#include "wetness.glsl"

Shaded shade_cable(vec2 center) {
    vec3 ray = view_ray(center);
    vec3 view = -normalize(ray);
    vec4 base = material_base[CABLE_MATERIAL];
    Material steel = Material(base.rgb, base.a, material_trait[CABLE_MATERIAL].x);
#if SHOWN_RUST
    steel.albedo = cable_mean_rust.rgb;
    steel.roughness = mix(steel.roughness, rust_roughness, cable_mean_rust.a);
    steel.metallic *= 1.0 - cable_mean_rust.a;
#endif
    // The mean of the factor in material.glsl.
    apply_wetness(steel.albedo, steel.roughness, steel.metallic, 0.8 * wetness);
    vec3 color = vec3(0.0);
    for (int axis = 0; axis < 2; ++axis) {
        vec3 normal = vec3(0.0);
        normal[axis] = view[axis] < 0.0 ? -1.0 : 1.0;
        SkyVisibility whole = SkyVisibility(normal, 0.0, vec3(1.0), 1.0, 1.0, steel.albedo,
                                            NO_TRACED_LIGHT);
        color += abs(view[axis]) * layer_color(steel, normal, view, whole, vec4(1.0));
    }
    color /= max(abs(view.x) + abs(view.y), 1e-6);
    Shaded s = shade_sky(ray);
    s.cover = cable_coverage(center);
    s.color = mix(s.color, color, s.cover);
    return s;
}
