// DamageField kinked_field(int i, vec3 q): a notch of an edge, at local coordinates q.
// Twin of fastgen/damages/kinked.py.

#include "damage.block"
#include "damage_field.glsl"

DamageField kinked_field(int i, vec3 q) {
    vec4 shape = damage_shape[3 * i];   // Place of the deepest point, softness.
    float half_length = damage_along[i].w;
    float half_width = damage_across[i].w;
    float depth = damage_inward[i].w;
    float t = q.x / half_length;
    vec2 flank = 1.0 / vec2(1.0 + shape.x, 1.0 - shape.x);
    vec3 notch = lesser(vec3((1.0 + t) * flank.x, flank.x, 0.0),
                        vec3((1.0 - t) * flank.y, -flank.y, 0.0), shape.y);
    float deep = above_zero(notch.x, shape.y);
    float deep_slope = above_zero_slope(notch.x, shape.y) * notch.y / half_length;
    float r = max(length(q.yz), 1e-3);
    float near = bump(r / half_width);
    float near_slope = bump_slope(r / half_width) / half_width;
    float fold = clamp(1.0 - abs(q.x - shape.x * half_length) / 35.0, 0.0, 1.0);
    return DamageField(depth * deep * near,
                       depth * vec3(deep_slope * near, deep * near_slope * q.yz / r),
                       near * max(fold, 0.4 * deep * deep));
}
