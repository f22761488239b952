// DamageField star_field, fold_field, bow_field and edge_field(int i, vec3 q): the four kinds of section
// 3.3.2 of the SeaFront paper, at local coordinates q of damage i. float outside_star(int i, vec2 q):
// distance in mm from its hole. Twin of fastgen/damages/plain.py.

#include "units.constants"
#include "damage.block"
#include "damage_field.glsl"

// Sideways offset of a dent's fold in mm at u mm along it: by turns straight and sinusoidal. a, b: the
// first two vectors of its damage_shape.
float fold_path(vec4 a, vec4 b, float u) {
    float turn = smoothstep(-0.25, 0.25, sin(PI * u / b.y + b.x));
    return a.z * turn * sin(2.0 * PI * u / a.w);
}

// Radius of a hole's outline in mm: its mean radius, modulated by the harmonics 2 to 6 of `angle`.
float hole_radius(int i, float angle) {
    vec4 a = damage_shape[3 * i];
    vec4 b = damage_shape[3 * i + 1];
    vec4 c = damage_shape[3 * i + 2];
    float ratio = 1.0 + a.y * cos(2.0 * angle + a.z) + a.w * cos(3.0 * angle + b.x) +
                  b.y * cos(4.0 * angle + b.z) + b.w * cos(5.0 * angle + c.x) +
                  c.y * cos(6.0 * angle + c.z);
    return damage_along[i].w * ratio;
}

float outside_star(int i, vec2 q) { return length(q) - hole_radius(i, atan(q.y, q.x)); }

DamageField star_field(int i, vec3 q) {
    vec4 shape = damage_shape[3 * i];
    float depth = damage_inward[i].w;
    float fade = sheet_fade(q.z);
    float r = max(length(q.xy), 1e-3);
    float outside = r - hole_radius(i, atan(q.y, q.x));
    float rim = clamp(1.0 - outside / shape.x, 0.0, 1.0);
    float rim_slope = rim < 1.0 ? -2.0 * rim / shape.x : 0.0;
    float scar = clamp(1.0 - outside / (0.7 * shape.x), 0.0, 1.0);
    return DamageField(depth * rim * rim * fade, depth * fade * rim_slope * vec3(q.xy / r, 0.0),
                       scar * scar * step(0.5, fade));
}

DamageField fold_field(int i, vec3 q) {
    vec4 shape = damage_shape[3 * i];
    vec4 more = damage_shape[3 * i + 1];
    float half_length = damage_along[i].w;
    float half_width = damage_across[i].w;
    float depth = damage_inward[i].w;
    float fade = sheet_fade(q.z);
    float path = fold_path(shape, more, q.x);
    float path_slope = (fold_path(shape, more, q.x + 2.0) - path) * 0.5;
    float away = abs(q.y - path);
    float side = q.y < path ? -1.0 : 1.0;
    float taper = max(1.0 - q.x * q.x / (half_length * half_length), 0.0);
    float taper_slope = taper > 0.0 ? -2.0 * q.x / (half_length * half_length) : 0.0;
    float rest = max(1.0 - away / shape.x, 0.0);
    float profile = mix(rest * sqrt(rest), bump(away / half_width), shape.y);
    float profile_slope =
        mix(-1.5 * sqrt(rest) / shape.x, bump_slope(away / half_width) / half_width, shape.y);
    vec3 slope = vec3(taper_slope * profile - taper * profile_slope * side * path_slope,
                      taper * profile_slope * side, 0.0);
    return DamageField(depth * taper * fade * profile, depth * fade * slope,
                       0.7 * fade * taper * taper * max(1.0 - away / (0.8 * shape.x), 0.0));
}

DamageField bow_field(int i, vec3 q) {
    vec2 unit = 1.0 / vec2(damage_along[i].w, damage_across[i].w);
    vec2 at = q.xy * unit;
    vec2 hill = vec2(bump(at.x), bump(at.y));
    vec2 tilt = unit * vec2(bump_slope(at.x) * hill.y, hill.x * bump_slope(at.y));
    float deep = damage_inward[i].w * sheet_fade(q.z);
    return DamageField(deep * hill.x * hill.y, deep * vec3(tilt, 0.0), 0.0);
}

// A hill about the axis along the edge.
DamageField edge_field(int i, vec3 q) {
    vec2 unit = 1.0 / vec2(damage_along[i].w, damage_across[i].w);
    float depth = damage_inward[i].w;
    float hill = bump(q.x * unit.x);
    float r = max(length(q.yz), 1e-3);
    float reach = bump(r * unit.y);
    return DamageField(depth * hill * reach,
                       depth * vec3(bump_slope(q.x * unit.x) * unit.x * reach,
                                    hill * bump_slope(r * unit.y) * unit.y * q.yz / r),
                       0.35 * hill * hill * reach * reach);
}
