// float ageing(ZonePoint z, float tone): darkening near a panel's corners, 0..1. The darkening reaches
// at most half the panel's shorter side.
// float bleaching(ZonePoint z, float tone, float column): bleaching by the sun, 0..1.
// vec3 bleached(vec3 albedo, float share): albedo of bleached paint.
// tone, column: Noise, 0..1, which breaks up the pattern.
// SeaFront paper, section 3.2. The weights are artistic choices.

#include "scene.block"
#include "zone_point.glsl"

float ageing(ZonePoint z, float tone) {
    float near_corner = 1.0 - smoothstep(0.0, min(ageing_reach_mm, 0.5 * z.narrow_mm), z.corner_mm);
    return ageing_strength * near_corner * (0.55 + 0.45 * tone);
}

float bleaching(ZonePoint z, float tone, float column) {
    return bleach * (0.65 + 0.25 * tone + 0.45 * column) * mix(1.2, 0.8 + 0.2 * z.raised, z.steep);
}

// Light destroys pigments, so paint loses its colour and turns chalky.
vec3 bleached(vec3 albedo, float share) {
    vec3 grey = vec3(dot(albedo, vec3(0.2126, 0.7152, 0.0722)));
    vec3 faded = mix(albedo, grey, 0.4);
    return mix(albedo, faded + 0.16 * (1.0 - faded), clamp(share, 0.0, 1.0));
}
