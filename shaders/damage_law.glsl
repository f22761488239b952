// vec3 deformed(vec3 p): position of rest point p after all damages; mm in the container frame.
// int hole_at(vec3 p): index of the perforation that removed p, -1 for none.
// DamageSample damage_at(vec3 p): derivative of the deformation, wear of the steel and mask value at p.
// vec3 deformed_normal(mat3 bend, vec3 n): normal n of the rest surface after the deformation.
// Damage i displaces p along its inward axis. Twin of fastgen/geometry/damage_law.py; section 3.3.2 of
// the SeaFront paper describes the four kinds.

#include "damage.constants"
#include "units.constants"
#include "damage.block"

// A smooth hill, (1 - t^2)^2 up to |t| = 1 and 0 beyond, and its derivative.
float bump(float t) { float s = max(1.0 - t * t, 0.0); return s * s; }
float bump_slope(float t) { return -4.0 * t * max(1.0 - t * t, 0.0); }

// Coordinates of p along, across and inward from the origin of damage i, in mm.
vec3 damage_local(int i, vec3 p) {
    vec3 q = p - damage_origin[i].xyz;
    return vec3(dot(q, damage_along[i].xyz), dot(q, damage_across[i].xyz), dot(q, damage_inward[i].xyz));
}

// Index of the first damage from i on, before `end`, whose bounding sphere contains p; `end` if there
// is none. The sphere includes the margin of within_reach. Loops skip distant damages by this
// function, because llvmpipe executes both sides of a branch in a loop's body.
int next_damage_near(int i, int end, vec3 p) {
    for (; i < end; ++i) {
        vec3 q = p - damage_origin[i].xyz;
        if (dot(q, q) < damage_origin[i].w) break;
    }
    return i;
}

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

// Whether perforation i removed p. Perforations are the first hole_count damages.
bool in_hole(int i, vec3 p) {
    vec3 q = damage_local(i, p);
    return length(q.xy) < hole_radius(i, atan(q.y, q.x)) && abs(q.z) < DAMAGE_FADE_START_MM;
}

int hole_at(vec3 p) {
    int found = -1;
    int i = next_damage_near(0, hole_count, p);
    do {
        if (in_hole(i, p) && i < hole_count) found = i;
        i = next_damage_near(i + 1, hole_count, p);
    } while (i < hole_count);
    return found;
}

// Whether damage i may change a pixel that shows p. REACH_MARGIN_MM covers the neighbours that the
// pixel filter reads.
bool within_reach(int i, vec3 p) {
    vec3 q = abs(damage_local(i, p));
    vec3 reach = vec3(damage_along[i].w, damage_across[i].w, DAMAGE_FADE_END_MM);
    if (i < hole_count) reach.xy = reach.xy * HOLE_REACH + damage_shape[3 * i].x;
    else if (i < dent_end) {
        vec4 shape = damage_shape[3 * i];
        reach.y = max(reach.y, shape.x) + shape.z;   // The fold swings to both sides.
    }
    else if (i >= concave_end) reach.z = reach.y;
    return all(lessThan(q, reach + REACH_MARGIN_MM));
}

struct DamageField {
    float amount;   // Displacement along the inward axis, mm.
    // Gradient of `amount` in local coordinates. It is approximate along folds and hole outlines. It
    // leaves out the inward fade, which tilts neither the damaged sheet nor sheets perpendicular to it.
    vec3 slope;
    // Wear of the bent steel, 0..1: aged in a fold, rusty along a torn rim. Its weights are artistic
    // choices.
    float scar;
};

// Weight of a field at w mm behind its face: a damage must not move the opposite wall.
float sheet_fade(float w) {
    return 1.0 - smoothstep(DAMAGE_FADE_START_MM, DAMAGE_FADE_END_MM, abs(w));
}

// The functions below return the field of damage i of one kind. q: Local coordinates, see damage_local.

DamageField perforation_field(int i, vec3 q) {
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

// taper: 1 - (u / half length)^2 at u along the fold, at least 0. The callers round it differently, so
// each computes its own.
DamageField dent_field(int i, vec3 q, float taper) {
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

// Concave damages, and bent edges: hills about the axis along the edge.
DamageField hill_field(int i, vec3 q) {
    bool edge = i >= concave_end;
    float half_length = damage_along[i].w;
    float half_width = damage_across[i].w;
    float depth = damage_inward[i].w;
    float fade = edge ? 1.0 : sheet_fade(q.z);
    float hill = bump(q.x / half_length);
    float hill_slope = bump_slope(q.x / half_length) / half_length;
    float r = edge ? max(length(q.yz), 1e-3) : q.y;
    float reach = bump(r / half_width);
    float reach_slope = bump_slope(r / half_width) / half_width;
    vec2 turned = edge ? hill * reach_slope * q.yz / r : vec2(hill * reach_slope, 0.0);
    return DamageField(depth * hill * reach * fade, depth * fade * vec3(hill_slope * reach, turned),
                       edge ? 0.35 * hill * hill * reach * reach : 0.0);
}

// Damages are sorted by kind: perforations, dents, concave damages, bent edges.
DamageField damage_field(int i, vec3 p) {
    vec3 q = damage_local(i, p);
    if (i >= dent_end) return hill_field(i, q);
    if (i >= hole_count) {
        float half_length = damage_along[i].w;
        return dent_field(i, q, max(1.0 - q.x * q.x / (half_length * half_length), 0.0));
    }
    return perforation_field(i, q);
}

// Each kind has its own loop. One loop with branches would cost the work of all kinds per damage on
// llvmpipe, which executes both sides of every branch.
vec3 deformed(vec3 p) {
    vec3 moved = p;
    for (int i = next_damage_near(0, hole_count, p); i < hole_count;
         i = next_damage_near(i + 1, hole_count, p))
        moved += perforation_field(i, damage_local(i, p)).amount * damage_inward[i].xyz;
    for (int i = next_damage_near(hole_count, dent_end, p); i < dent_end;
         i = next_damage_near(i + 1, dent_end, p)) {
        vec3 q = damage_local(i, p);
        float along = q.x / damage_along[i].w;
        moved += dent_field(i, q, max(1.0 - along * along, 0.0)).amount * damage_inward[i].xyz;
    }
    for (int i = next_damage_near(dent_end, damage_count, p); i < damage_count;
         i = next_damage_near(i + 1, damage_count, p))
        moved += hill_field(i, damage_local(i, p)).amount * damage_inward[i].xyz;
    return moved;
}

struct DamageSample {
    mat3 bend;      // Derivative of the deformed position by the rest position.
    float scar;
    uint value;     // Mask value of the damage with the largest displacement; 0 below the threshold.
};

DamageSample damage_at(vec3 p) {
    DamageSample d = DamageSample(mat3(1.0), 0.0, 0u);
    float most = damage_threshold_mm;
    // There is at least one damage, and a distant one adds nothing.
    int i = min(next_damage_near(0, damage_count, p), damage_count - 1);
    do {
        DamageField f = damage_field(i, p);
        vec3 slope = f.slope.x * damage_along[i].xyz + f.slope.y * damage_across[i].xyz +
                     f.slope.z * damage_inward[i].xyz;
        d.bend += outerProduct(damage_inward[i].xyz, slope);
        d.scar = max(d.scar, f.scar);
        if (abs(f.amount) > most) {
            most = abs(f.amount);
            d.value = uint(damage_shape[3 * i + 2].w);
        }
        i = next_damage_near(i + 1, damage_count, p);
    } while (i < damage_count);
    return d;
}

// Normals transform by the cofactor matrix of the derivative.
vec3 deformed_normal(mat3 bend, vec3 n) {
    return normalize(n.x * cross(bend[1], bend[2]) + n.y * cross(bend[2], bend[0]) +
                     n.z * cross(bend[0], bend[1]));
}
