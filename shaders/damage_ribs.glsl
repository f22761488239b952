// DamageField ribs_field(int i, vec3 q): crush marks on the outer ribs, at local coordinates q.
// Twin of fastgen/damages/ribs.py.

#include "units.constants"
#include "damage.block"
#include "damage_field.glsl"

DamageField ribs_field(int i, vec3 q) {
    vec4 shape = damage_shape[3 * i];       // Softness, ramp, unevenness, wavelength.
    vec4 more = damage_shape[3 * i + 1];    // Phase, give.
    float half_width = damage_across[i].w;
    float depth = damage_inward[i].w;
    float t = q.y / half_width;
    float beyond = max(abs(q.x) - (damage_along[i].w - shape.y), 0.0) / shape.y;
    float turn = 2.0 * PI / shape.w;
    float uneven = (1.0 + shape.z * sin(turn * q.x + more.x)) / (1.0 + shape.z);
    float uneven_slope = shape.z * turn * cos(turn * q.x + more.x) / (1.0 + shape.z);
    float across = bump(t);
    float inside = depth * max(uneven * across - beyond * beyond, 0.0) - max(q.z, 0.0);
    float pushed = more.y * above_zero_slope(inside, shape.x);
    vec3 slope = vec3(depth * (uneven_slope * across - 2.0 * beyond * sign(q.x) / shape.y),
                      depth * uneven * bump_slope(t) / half_width, q.z > 0.0 ? -1.0 : 0.0);
    // Paint comes off where the object pressed hardest, and along the lips.
    float rubbed = clamp(1.5 - q.z / 12.0, 0.0, 1.0) * above_zero_slope(inside, shape.x);
    return DamageField(more.y * above_zero(inside, shape.x) * sheet_fade(q.z),
                       pushed * sheet_fade(q.z) * slope,
                       rubbed * mix(0.35, 1.0, t * t));
}
