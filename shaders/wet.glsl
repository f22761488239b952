// void wet(albedo, roughness, metallic, wetness): what rain does to a surface; 0 dry to 1 soaked.

// Lagarde 2013, "Water drop 3b: physically based wet surfaces": what is porous, which is rough,
// soaks water and darkens to a fifth. That a film of water smooths all is his too, by how much is ours.
void wet(inout vec3 albedo, inout float roughness, float metallic, float wetness) {
    float porosity = clamp((roughness - 0.5) / 0.4, 0.0, 1.0) * (1.0 - metallic);
    albedo *= 1.0 - 0.8 * porosity * wetness;
    roughness *= 1.0 - 0.7 * wetness;
}
