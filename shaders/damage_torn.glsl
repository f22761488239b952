// DamageField torn_field(int i, vec3 q): lips of torn sheet, at local coordinates q.
// float outside_torn(int i, vec2 q): about the distance from its hole in mm, negative within.
// Twin of fastgen/damages/torn.py.

#include "units.constants"
#include "damage.constants"
#include "damage.block"
#include "damage_field.glsl"

const float ANYWHERE_MM = 1e6;

float ragged(float height, float u, float phase) {
    float turn = 2.0 * PI * u / TORN_LONG_TEETH_MM;
    float irregular = 1.4 * sin(0.31 * turn + phase);
    return height / 1.6 * (sin(turn + phase + irregular) +
                           0.6 * sin(2.0 * PI * u / TORN_SHORT_TEETH_MM + 2.3 * phase + 2.0 * irregular));
}

float outside_torn(int i, vec2 q) {
    vec4 shape = damage_shape[3 * i];      // Rim, belly, wedge, teeth.
    vec4 more = damage_shape[3 * i + 1];   // Phase, second slit, twist.
    float half_length = damage_along[i].w;
    float half_gape = damage_across[i].w;
    float t = q.x / half_length;
    float even = max(1.0 - t * t, 0.0);
    float wedged = max(min(0.5 * (1.0 + t), TORN_WEDGE_END * (1.0 - t)), 0.0);
    float gape = even + shape.z * (wedged - even);
    float teeth = min(4.0 * gape, 1.0);
    float upper = 2.0 * half_gape * gape * (1.0 - shape.y) + teeth * ragged(shape.w, q.x, more.x);
    float lower = 2.0 * half_gape * gape * shape.y + teeth * ragged(shape.w, q.x, more.x + 2.0);
    float outside = max(max(q.y - upper, -q.y - lower), abs(q.x) - half_length);
    float half_arm = 0.5 * max(more.y, 1.0);
    float s = q.y / half_arm - 1.0;
    float across = abs(q.x - (half_length - half_gape)) -
                   TORN_ARM_GAPE * half_gape * max(1.0 - s * s, 0.0);
    float arm = max(across, abs(q.y - half_arm) - half_arm);
    return min(outside, arm + (more.y < 1.0 ? ANYWHERE_MM : 0.0));
}

// Displacement at q, without the fade. outside: outside_torn(i, q).
float torn_amount(int i, vec2 q, float outside) {
    float rim = clamp(1.0 - outside / damage_shape[3 * i].x, 0.0, 1.0);
    float upward = q.y / (abs(q.y) + damage_across[i].w);
    return damage_inward[i].w * rim * rim *
           (1.0 - damage_shape[3 * i + 1].z * (0.5 - 0.5 * upward));
}

DamageField torn_field(int i, vec3 q) {
    float fade = sheet_fade(q.z);
    float outside = outside_torn(i, q.xy);
    float amount = torn_amount(i, q.xy, outside);
    vec2 right = q.xy + vec2(1.0, 0.0);
    vec2 up = q.xy + vec2(0.0, 1.0);
    vec2 slope = vec2(torn_amount(i, right, outside_torn(i, right)),
                      torn_amount(i, up, outside_torn(i, up)));
    float edge = clamp(1.0 - outside / min(0.35 * damage_shape[3 * i].x, 25.0), 0.0, 1.0);
    return DamageField(fade * amount, fade * vec3(slope - amount, 0.0), edge * step(0.5, fade));
}
