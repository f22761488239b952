// DamageField creased_field(int i, vec3 q): flat parts between sharp folds, at local coordinates q.
// Twin of fastgen/damages/creased.py.

#include "units.constants"
#include "damage.constants"
#include "damage.block"
#include "damage_field.glsl"

DamageField creased_field(int i, vec3 q) {
    vec4 a = damage_shape[3 * i];       // Phase, sides 1 to 3.
    vec4 b = damage_shape[3 * i + 1];   // Sides 4 and 5, softness, flattening.
    vec2 unit = 1.0 / vec2(damage_along[i].w, damage_across[i].w);
    float depth = damage_inward[i].w;
    vec2 at = q.xy * unit;
    vec3 rim = lesser(vec3(1.0 - abs(at.x), -sign(at.x) * unit.x, 0.0),
                      vec3(1.0 - abs(at.y), 0.0, -sign(at.y) * unit.y), b.z);
    vec3 height = CREASED_EDGE * rim;   // Height of the pyramid and its gradient.
    float side[5] = float[5](a.y, a.z, a.w, b.x, b.y);
    float scar = 1.0;   // Distance from the nearest fold, in units of the height.
    for (int k = 0; k < 5; ++k) {
        float angle = a.x + 2.0 * PI * float(k) / 5.0;
        vec2 toward = vec2(cos(angle), sin(angle)) / side[k];
        vec3 other = vec3(1.0 - dot(toward, at), -toward * unit);
        scar = min(scar, abs(height.x - other.x));
        height = lesser(height, other, b.z);
    }
    float sheet = sheet_fade(q.z);
    vec2 tilt = height.yz * above_zero_slope(height.x, b.z);
    float up = above_zero(height.x, b.z);
    float flattened = b.w * min(up / CREASED_FLATTENED_AT, 1.0);
    float level = to_flat(q.z);
    vec2 more = up < CREASED_FLATTENED_AT ? b.w * level / CREASED_FLATTENED_AT * tilt : vec2(0.0);
    return DamageField(sheet * (depth * up + flattened * level),
                       sheet * vec3(depth * tilt + more, flattened * to_flat_slope(q.z)),
                       0.3 * sheet * clamp(1.0 - scar / 0.03, 0.0, 1.0) * step(1e-4, up));
}
