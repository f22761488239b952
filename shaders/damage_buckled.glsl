// DamageField buckled_ribs_field(int i, vec3 q): ribs that buckle along one line, at local coordinates q.
// Twin of fastgen/damages/buckled.py.

#include "units.constants"
#include "damage.constants"
#include "damage.block"
#include "damage_field.glsl"

DamageField buckled_ribs_field(int i, vec3 q) {
    vec4 a = damage_shape[3 * i];       // Rounding, softness, tilt, wobble.
    vec4 b = damage_shape[3 * i + 1];   // Wavelength, phase, crushed share, crushed length.
    float half_length = damage_along[i].w, half_width = damage_across[i].w;
    float depth = damage_inward[i].w;
    float turn = 2.0 * PI / b.x, reach = 1.0 - abs(a.z) - a.w;
    float off = q.y / half_width - a.z * q.x / half_length - a.w * sin(turn * q.x + b.y);
    vec2 off_slope = vec2(-a.z / half_length - a.w * turn * cos(turn * q.x + b.y), 1.0 / half_width);
    // y holds the derivative by `off`.
    vec3 sides = lesser(vec3(-off, -1.0, 0.0), vec3(off, 1.0, 0.0), 2.0 * a.x * reach) / reach;
    float t = q.x / half_length;
    float height = bump(t) + sides.x;
    vec2 tilt = vec2(bump_slope(t) / half_length, 0.0) + sides.y * off_slope;
    float up = above_zero(height, a.y);
    tilt *= above_zero_slope(height, a.y);
    float s = off * half_width / b.w;
    float crushed = b.z * bump(s);
    vec2 crushed_slope = b.z * bump_slope(s) * half_width / b.w * off_slope;
    float level = to_flat(q.z);
    vec2 more = level * (crushed_slope * up + crushed * tilt);
    float sheet = sheet_fade(q.z);
    // Paint cracks along the line, only on the crests.
    float rubbed = clamp(1.0 - q.z / DAMAGE_FLAT_MM, 0.0, 1.0) * bump(s) * min(2.0 * up, 1.0);
    return DamageField(sheet * (depth * up + crushed * up * level),
                       sheet * vec3(depth * tilt + more, crushed * up * to_flat_slope(q.z)),
                       0.5 * sheet * rubbed);
}
