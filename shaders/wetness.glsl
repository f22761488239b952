// void apply_wetness(inout vec3 albedo, inout float roughness, float metallic, float wetness): changes a
// surface by rain. wetness: 0 for dry to 1 for soaked.

#include "reflectance.constants"
#include "scene.block"

// Lagarde 2013, "Water drop 3b: Physically based wet surfaces": rough non-metals are porous, soak up
// water and darken to a fifth. A film of water smooths every surface; the factor 0.7 is our choice.
void apply_wetness(inout vec3 albedo, inout float roughness, float metallic, float wetness) {
    float porosity = clamp((roughness - 0.5) / 0.4, 0.0, 1.0) * (1.0 - metallic);
    albedo *= 1.0 - POROUS_LOSS * porosity * wetness;
    roughness *= 1.0 - 0.7 * wetness;
}
