// DamageMark graffiti_mark(int i, vec3 q): a sprayed tag at local coordinates q.
// Twin of fastgen/damages/graffiti.py.

#include "units.constants"
#include "damage.constants"
#include "damage.block"
#include "damage_field.glsl"

mat2 rotation(float angle) { return mat2(cos(angle), sin(angle), -sin(angle), cos(angle)); }
vec2 unit(float angle) { return vec2(cos(angle), sin(angle)); }

// Distance in mm from the line, negative on it.
float outside_tag(int i, vec2 at) {
    vec4 a = damage_shape[3 * i];       // Line, letters, loop, phase.
    vec4 b = damage_shape[3 * i + 1];   // Unevenness, drip, contact.
    float high = max(damage_across[i].w - 0.5 * (a.x + b.y), 1.0);
    float wide = max(damage_along[i].w - 0.5 * a.x - a.z * high, 1.0);
    // Waves advance by rotations, which cost less than functions of angles.
    float first = a.w - PI * a.y, turn = 2.0 * PI * a.y / float(GRAFFITI_PIECES);
    vec2 letter = unit(first), slow = unit(GRAFFITI_SLOW * first + 2.0 * a.w);
    vec2 fast = unit(GRAFFITI_FAST * first);
    mat2 turn_letter = rotation(turn), turn_slow = rotation(GRAFFITI_SLOW * turn);
    mat2 turn_fast = rotation(GRAFFITI_FAST * turn);
    vec2 from = vec2(0.0);
    float nearest = 1e9;
    for (int k = -1; k < GRAFFITI_PIECES; ++k) {
        float t = 2.0 * float(k + 1) / float(GRAFFITI_PIECES) - 1.0;
        vec2 to = vec2(wide * t + a.z * high * (0.6 * letter.x + 0.4 * fast.x),
                       high * (0.7 * mix(letter.y, slow.y, b.x) + 0.3 * fast.y) + 0.5 * b.y);
        letter = turn_letter * letter;
        slow = turn_slow * slow;
        fast = turn_fast * fast;
        if (k < 0) from = to;
        vec2 piece = to - from, away = at - from;
        away -= piece * clamp(dot(away, piece) / max(dot(piece, piece), 1e-12), 0.0, 1.0);
        nearest = min(nearest, length(away));
        if (k >= 0 && k % GRAFFITI_DRIP_EVERY == GRAFFITI_DRIP_EVERY / 2) {
            float run = b.y * (0.5 + 0.5 * sin(1.7 * float(k) + a.w));
            vec2 drop = vec2(at.x - from.x, at.y - clamp(at.y, from.y - run, from.y));
            nearest = min(nearest, length(drop) + 0.5 * (1.0 - GRAFFITI_DRIP_WIDTH) * a.x);
        }
        from = to;
    }
    return nearest - 0.5 * a.x;
}

DamageMark graffiti_mark(int i, vec3 q) {
    float outside = outside_tag(i, q.xy);
    bool within = abs(q.x) < damage_along[i].w && abs(q.y) < damage_across[i].w &&
                  in_contact(q.z, damage_shape[3 * i + 1].z);
    // The paint of a spray can thins toward the edges of the line.
    float wear = mix(0.6, 1.0, smoothstep(0.0, 0.15 * damage_shape[3 * i].x, -outside));
    return DamageMark(within && outside < 0.0, wear, damage_fresh(i), damage_bare[i].rgb, true);
}
