// DamageField: displacement of one damage. DamageMark: surface of a damage without displacement.
// float sheet_fade(float w): weight of a field. float damage_fresh(int i): Damage.fresh of damage i.
// float mark_filter_mm: width on the sheet over which patterns of marks are filtered; set it before
// damage_at().
// Functions for the forms of damage in damage_*.glsl. Twin of fastgen/damages/fields.py.

#include "damage.constants"
#include "damage.block"

float mark_filter_mm = 1.0;

struct DamageField {
    float amount;   // Displacement along the inward axis, mm.
    // Gradient of `amount` in local coordinates. It is approximate along folds and outlines. It leaves
    // out the inward fade, which tilts neither the damaged sheet nor sheets perpendicular to it.
    vec3 slope;
    // Wear of the bent steel, 0..1. Its weights are artistic choices.
    float scar;
};

struct DamageMark {
    bool here;     // Whether the point is in the mask of the damage.
    float wear;    // Share of the surface that it changes, 0..1; ignored outside the mask.
    float fresh;   // Share of the changed surface that has not rusted.
    vec3 albedo;   // Albedo of the fresh share.
    bool covers;   // Whether it hides the marks of earlier kinds below it.
};

float damage_fresh(int i) { return damage_shape[3 * i + 2].w; }

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

// Displacement that flattens corrugation, for sheet w mm behind its face, and its derivative.
float to_flat(float w) { return DAMAGE_FLAT_MM - clamp(w, 0.0, DAMAGE_DEEPEST_MM); }
float to_flat_slope(float w) { return w > 0.0 && w < DAMAGE_DEEPEST_MM ? -1.0 : 0.0; }

// Whether a surface w mm behind its face is near enough to be marked.
bool in_contact(float w, float contact_mm) { return w < contact_mm && w > -DAMAGE_PROUD_MM; }

// Smooth noise between -1 and 1, a sum of waves.
float ripples(vec2 at, float scale_mm, float phase) {
    vec2 p = at / scale_mm;
    p += 0.7 * vec2(sin(1.3 * p.y + phase), sin(1.1 * p.x - 2.0 * phase));
    float total = 0.0, size = 0.327;
    for (int k = 0; k < 5; ++k) {
        float turn = 2.4 * float(k) + phase, c = cos(turn), s = sin(turn);
        total += size * sin(c * p.x - s * p.y + 1.7 * float(k)) * cos(s * p.x + c * p.y + phase);
        p *= 1.53;
        size *= 0.75;
    }
    return total;
}

// Above 0 in a patch with a ragged outline.
float patch_field(int i, vec2 at) {
    vec4 shape = damage_shape[3 * i];   // Scale, phase, height.
    vec2 t = at / vec2(damage_along[i].w, damage_across[i].w);
    return ripples(at, shape.x, shape.y) - 1.0 + (1.0 + shape.z) * (1.0 - dot(t, t));
}
