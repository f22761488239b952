// float worn_roughness(float roughness, NoiseSample noise): roughness after weathering.
// SeaFront paper, section 3.2. The constants are artistic choices.

#include "reflectance.constants"
#include "scene.block"
#include "noise.glsl"

float worn_roughness(float roughness, NoiseSample noise) {
    return clamp(roughness + wear_strength * 0.5 * (noise.value.y - 0.4), MIN_ROUGHNESS, 1.0);
}
