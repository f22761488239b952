// vec3 deformed(vec3 p): position of rest point p after all damages; mm in the container frame.
// int hole_at(vec3 p): index of the damage that tore p away, -1 for none.
// DamageSample damage_at(vec3 p): derivative of the deformation, wear of the steel and mask value at p.
// vec3 deformed_normal(mat3 bend, vec3 n): normal n of the rest surface after the deformation.
// Damage i displaces p along its inward axis. Twin of fastgen/geometry/damage_law.py.

#include "damage.constants"
#include "damage.block"
#include "damage_field.glsl"
#include "scar.glsl"
#include "damage.forms"

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

// Whether damage i, one of the first hole_count, tore p away.
bool in_hole(int i, vec3 p) {
    vec3 q = damage_local(i, p);
    float outside = OUTSIDE_HOLE(i, q.xy);
    return outside < 0.0 && abs(q.z) < DAMAGE_FADE_START_MM;
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
    return all(lessThan(abs(damage_local(i, p)), damage_reach[i].xyz + REACH_MARGIN_MM));
}

// Runs USE(i, change) for all damages of one form that may act on p. damage.constants has such a loop for
// each form: EACH_DAMAGE(USE) if it moves the sheet, EACH_MARK(USE) if it does not. One loop with
// branches would cost the work of all forms per damage on llvmpipe, which executes both sides of a branch.
#define EACH_NEAR(FROM, END, TYPE, CHANGE, USE)               \
    for (int i = next_damage_near(FROM, END, p); i < END;     \
         i = next_damage_near(i + 1, END, p)) {               \
        TYPE change = CHANGE(i, damage_local(i, p));          \
        USE(i, change);                                       \
    }

vec3 deformed(vec3 p) {
    vec3 moved = p;
#define MOVE(i, field) moved += field.amount * damage_inward[i].xyz
    EACH_DAMAGE(MOVE)
    return moved;
}

struct DamageSample {
    mat3 bend;    // Derivative of the deformed position by the rest position.
    Scar scar;    // The strongest.
    // Mask value of the damage with the largest displacement. It is 0 if that is below the threshold,
    // or if the displacements of several damages cancel.
    uint value;
};

void add_scar(inout Scar scar, int i, float wear, float fresh, vec3 albedo, bool over_repairs) {
    wear *= damage_bare[i].w;
    if (wear > scar.wear) scar = Scar(wear, fresh, albedo, over_repairs);
}

DamageSample damage_at(vec3 p) {
    DamageSample d = DamageSample(mat3(1.0), NO_SCAR, 0u);
    vec3 moved = vec3(0.0);
    float most = damage_threshold_mm;
#define SAMPLE(i, field)                                                                    \
    vec3 slope = field.slope.x * damage_along[i].xyz + field.slope.y * damage_across[i].xyz + \
                 field.slope.z * damage_inward[i].xyz;                                      \
    d.bend += outerProduct(damage_inward[i].xyz, slope);                                    \
    moved += field.amount * damage_inward[i].xyz;                                           \
    add_scar(d.scar, i, field.scar, damage_fresh(i), damage_bare[i].rgb, false);            \
    if (abs(field.amount) > most) {                                                         \
        most = abs(field.amount);                                                           \
        d.value = uint(damage_reach[i].w);                                                  \
    }
    EACH_DAMAGE(SAMPLE)
    if (length(moved) < damage_threshold_mm) d.value = 0u;
    bool covered = false;
#define SAMPLE_MARK(i, mark)                                                                        \
    if (mark.here && d.value == 0u) d.value = uint(damage_reach[i].w);                              \
    add_scar(d.scar, i, mark.here && !covered ? mark.wear : 0.0, mark.fresh, mark.albedo, true);    \
    covered = covered || (mark.here && mark.covers);
    EACH_MARK(SAMPLE_MARK)
    return d;
}

// Normals transform by the cofactor matrix of the derivative.
vec3 deformed_normal(mat3 bend, vec3 n) {
    return normalize(n.x * cross(bend[1], bend[2]) + n.y * cross(bend[2], bend[0]) +
                     n.z * cross(bend[0], bend[1]));
}
