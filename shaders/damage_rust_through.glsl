// DamageMark rust_through_mark(int i, vec3 q): thick rust with pits, at local coordinates q.
// Twin of fastgen/damages/rust_through.py. Colours and blend weights are artistic choices.

#include "damage.block"
#include "damage_field.glsl"

const vec3 PIT_ALBEDO = vec3(0.010, 0.007, 0.006);

DamageMark rust_through_mark(int i, vec3 q) {
    vec4 shape = damage_shape[3 * i];   // Scale, phase, height, pits.
    float thick = patch_field(i, q.xy);
    float grain = ripples(q.xy, 0.28 * shape.x, shape.y + 1.3);
    float pit = smoothstep(0.0, 0.1, 0.8 * thick + 0.9 * grain - 1.35 + 0.8 * shape.w);
    float wear = smoothstep(0.0, 0.35, thick + 0.2 * grain * step(0.1, thick));
    return DamageMark(thick > 0.0 && in_contact(q.z, damage_shape[3 * i + 1].x), max(wear, 0.25),
                      pit, PIT_ALBEDO, true);
}
