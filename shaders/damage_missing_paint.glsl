// DamageMark missing_paint_mark(int i, vec3 q): flaked paint at local coordinates q.
// Twin of fastgen/damages/missing_paint.py. Colours and blend weights are artistic choices.

#include "damage.constants"
#include "damage.block"
#include "damage_field.glsl"

DamageMark missing_paint_mark(int i, vec3 q) {
    vec4 shape = damage_shape[3 * i];   // Scale, phase, height, share of steel.
    float inside = patch_field(i, q.xy);
    float grain = ripples(q.xy, 0.4 * shape.x, shape.y + 2.1);
    float steel = smoothstep(-0.05, 0.05, 0.5 * inside + 0.35 * grain - 0.5 + 0.7 * shape.w) *
                  step(1e-3, shape.w);
    // The edge of the paint casts a thin shadow.
    float edge = mix(0.7, 1.0, smoothstep(0.0, 0.05, inside));
    return DamageMark(inside > 0.0 && in_contact(q.z, damage_shape[3 * i + 1].x), 1.0,
                      mix(1.0, damage_fresh(i), steel),
                      edge * mix(damage_bare[i].rgb, MISSING_PAINT_STEEL, steel), true);
}
