// vec4 worn_art(vec3 ink, vec3 tint, float wear, float fade, NoiseSample coarse, NoiseSample streaks):
// albedo of an aged marker or sticker, and in alpha the share of the footprint where its paper sticks.
// It is opaque: paint shows only where paper peeled off, and white backing only around peeled places
// and along scratches. wear and fade are in 0..1. The constants are artistic choices.

#include "noise.glsl"

const vec3 BLEACHED = vec3(0.60, 0.57, 0.54);
const vec3 BACKING = vec3(0.66, 0.65, 0.62);
const vec3 GRIME = vec3(0.16, 0.14, 0.11);

vec4 worn_art(vec3 ink, vec3 tint, float wear, float fade, NoiseSample coarse, NoiseSample streaks) {
    vec3 albedo = ink * tint;
    // Light destroys coloured pigments before carbon black.
    float most = max(albedo.r, max(albedo.g, albedo.b));
    float pigment = (most - min(albedo.r, min(albedo.g, albedo.b))) / max(most, 0.03);
    albedo = mix(albedo, BLEACHED, fade * fma(pigment, 0.8, 0.2) * fma(coarse.value.x, 0.5, 0.75));
    // The mean of two uniform values exceeds 1 - x, for x below 1/2, with the probability 2 x * x.
    float rough = 0.5 * (coarse.value.x + coarse.value.w);
    float lost = 0.5 * length(vec2(coarse.lost.x, coarse.lost.w));
    float intact = fma(wear, -0.42, 1.02);
    float bare = covered(rough, intact, lost, 0.006);
    float peeled = covered(rough, intact + 0.03, lost, 0.006);
    float scratched = streaks.value.x * covered(streaks.value.y, 1.02 - 0.7 * wear, streaks.lost.y, 0.02);
    albedo = mix(albedo, BACKING, max(bare, scratched));
    float runs = covered(streaks.value.z, 1.25 - 0.8 * wear, streaks.lost.z, 0.25);
    return vec4(mix(albedo, GRIME, 0.6 * runs), 1.0 - peeled);
}
