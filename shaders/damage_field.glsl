// DamageField: displacement of one damage. float sheet_fade(float w): weight of its field.
// Functions for the forms of damage in damage_*.glsl. Twin of fastgen/geometry/damage_forms/form.py.

#include "damage.constants"

struct DamageField {
    float amount;   // Displacement along the inward axis, mm.
    // Gradient of `amount` in local coordinates. It is approximate along folds and outlines. It leaves
    // out the inward fade, which tilts neither the damaged sheet nor sheets perpendicular to it.
    vec3 slope;
    // Wear of the bent steel, 0..1. Its weights are artistic choices.
    float scar;
};

// A smooth hill, (1 - t^2)^2 up to |t| = 1 and 0 beyond, and its derivative.
float bump(float t) { float s = max(1.0 - t * t, 0.0); return s * s; }
float bump_slope(float t) { return -4.0 * t * max(1.0 - t * t, 0.0); }

// max(x, 0) with a parabola of length `softness` instead of the crease at 0, and its derivative.
float above_zero(float x, float softness) {
    x = max(x, 0.0);
    return x < softness ? x * x / (2.0 * softness) : x - 0.5 * softness;
}
float above_zero_slope(float x, float softness) { return clamp(x / softness, 0.0, 1.0); }

// The lesser of two values with their gradients in .yz, rounded where they differ by less than
// `softness`.
vec3 lesser(vec3 a, vec3 b, float softness) {
    float t = clamp(0.5 + 0.5 * (b.x - a.x) / softness, 0.0, 1.0);
    vec3 blend = mix(b, a, t);
    blend.x -= softness * t * (1.0 - t);
    return blend;
}

// Weight of a field at w mm behind its face: a damage must not move the opposite wall.
float sheet_fade(float w) {
    return 1.0 - smoothstep(DAMAGE_FADE_START_MM, DAMAGE_FADE_END_MM, abs(w));
}
