// DamageField bent_bar_field(int i, vec3 q): locking bar that leans outward to a kink.
// DamageField missing_bar_field(int i, vec3 q): locking bar that is moved out of sight.
// DamageMark missing_bar_mark(int i, vec3 q): the part of the door in front of which it was.
// DamageField open_handle_field(int i, vec3 q): handle that is sheared away from the leaf.
// DamageField hanging_gasket_field(int i, vec3 q): lip of the gasket that bows out of the door.
// Twin of fastgen/damages/door_gear.py.

#include "damage.constants"
#include "damage.block"
#include "damage_field.glsl"

DamageField bent_bar_field(int i, vec3 q) {
    float apex = damage_shape[3 * i].x;
    float half_length = damage_along[i].w;
    float half_width = damage_across[i].w;
    float depth = max(abs(q.y), abs(q.z)) < half_width ? damage_inward[i].w : 0.0;
    float t = q.x / half_length;
    float low = (1.0 + t) / (1.0 + apex), high = (1.0 - t) / (1.0 - apex);
    float rise = max(min(low, high), 0.0);
    float slope = low < high ? 1.0 / (1.0 + apex) : -1.0 / (1.0 - apex);
    return DamageField(depth * rise, vec3(depth * slope * sign(rise) / half_length, 0.0, 0.0), 0.0);
}

// Whether q belongs to the missing bar, its cams or its handle.
bool on_missing_bar(int i, vec3 q) {
    vec4 shape = damage_shape[3 * i];   // Place and length of the handle.
    float half_length = damage_along[i].w;
    vec3 away = abs(q);
    bool bar = away.y < MISSING_BAR_THICK_MM && away.x < half_length + MISSING_BAR_CLEAR_MM;
    vec2 from_cam = vec2(away.y, abs(away.x - (half_length - MISSING_BAR_CAM_MM)));
    bool cam = all(lessThan(from_cam, MISSING_BAR_CAM_HALF_MM));
    float from_handle = abs(q.x - shape.x);
    bool hub = all(lessThan(vec3(away.y, from_handle, away.z), MISSING_BAR_HUB_MM));
    bool lever = q.y >= 0.0 && q.y < shape.y + MISSING_BAR_CLEAR_MM &&
                 all(lessThan(vec2(from_handle, abs(q.z + MISSING_BAR_LEVER_FRONT_MM)), HANDLE_HALF_MM));
    return ((bar || cam) && away.z < MISSING_BAR_THICK_MM) || hub || lever;
}

DamageField missing_bar_field(int i, vec3 q) {
    return DamageField(on_missing_bar(i, q) ? damage_inward[i].w : 0.0, vec3(0.0), 0.0);
}

DamageMark missing_bar_mark(int i, vec3 q) {
    bool strip = abs(q.x) < damage_along[i].w && abs(q.y) < damage_across[i].w &&
                 q.z > -MISSING_BAR_PROUD_MM && q.z < MISSING_BAR_BEHIND_MM;
    return DamageMark(strip && !on_missing_bar(i, q), 0.0, 0.0, vec3(0.0), false);
}

DamageField open_handle_field(int i, vec3 q) {
    vec2 half_size = vec2(damage_along[i].w, damage_across[i].w);
    bool lever = all(lessThan(abs(q), vec3(half_size, HANDLE_HALF_MM.y)));
    float depth = lever ? damage_inward[i].w : 0.0;
    return DamageField(0.5 * depth * (1.0 + q.x / half_size.x), vec3(0.5 * depth / half_size.x, 0.0, 0.0),
                       0.0);
}

DamageField hanging_gasket_field(int i, vec3 q) {
    float apex = damage_shape[3 * i].x;
    float half_length = damage_along[i].w;
    float t = q.x / half_length;
    float part = t < apex ? -1.0 / max(1.0 + apex, 1e-3) : 1.0 / (1.0 - apex);
    float flank = (t - apex) * part;
    bool on_lip = length(q.yz) < damage_across[i].w && max(abs(t), abs(flank)) <= 1.0;
    float depth = on_lip ? damage_inward[i].w : 0.0;
    return DamageField(depth * (1.0 - flank * flank), vec3(-2.0 * depth * flank * part / half_length, 0.0, 0.0),
                       0.0);
}
