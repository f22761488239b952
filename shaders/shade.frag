// Shades the pixels of one class that see only the sky, or only cables before it.
#version 430 core
#include "blocks.glsl"
#include "shade.glsl"
#if CLASS == CLASS_CABLE
#include "cables.glsl"
#endif

layout(location = 0) out vec4 out_color;

#if CLASS == CLASS_CABLE
// steel, rusty on the mean, as much of it as covers the pixel; of its four sides along the axes the eye
// sees two, each as wide as it faces the eye. What is exposed, and the share of the pixel that it covers
vec4 cable(vec2 center) {
    vec3 ray = view_ray(center);
    vec3 view = -normalize(ray);
    vec4 base = material_base[CABLE_MATERIAL];
    Material steel = Material(base.rgb, base.a, material_trait[CABLE_MATERIAL].x);
#if SHOWN(RUST)
    steel.albedo = cable_rusted.rgb;
    steel.roughness = mix(steel.roughness, rust_roughness, cable_rusted.a);
    steel.metallic *= 1.0 - cable_rusted.a;
#endif
    wet(steel.albedo, steel.roughness, steel.metallic, 0.8 * wetness);   // material.glsl's mean
    vec3 color = vec3(0.0);
    for (int axis = 0; axis < 2; ++axis) {
        vec3 normal = vec3(0.0);
        normal[axis] = view[axis] < 0.0 ? -1.0 : 1.0;
        Openness whole = Openness(normal, 0.0, vec3(1.0), 1.0, 1.0, vec3(0.0), steel.albedo,
                                  NO_RAYS);
        color += abs(view[axis]) * layer_color(steel, normal, view, whole, vec4(1.0));
    }
    color /= max(abs(view.x) + abs(view.y), 1e-6);
    float cover = cables_cover(center);
    return vec4(mix(sky(ray).color, color, cover), cover);
}
#endif

void main() {
    vec2 center = gl_FragCoord.xy;
#if CLASS == CLASS_SKY
    vec4 shaded = vec4(sky(view_ray(center)).color, 0.0);
#else
    vec4 shaded = cable(center);
#endif
    out_color = vec4(developed(shaded.rgb), shaded.a);
}
