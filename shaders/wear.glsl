// float worn_roughness(float roughness, NoiseSample noise): reflection spread by weathering.

float worn_roughness(float roughness, NoiseSample noise) {
    return clamp(roughness + wear_strength * 0.5 * (noise.value.y - 0.4), MIN_ROUGHNESS, 1.0);
}
