// Fragment stage of texture export: evaluates the material of the ground at one texel.
// Writes base colour, roughness and metallic.
#version 430 core
#include "tone_curve.glsl"
#include "ground_material.glsl"

uniform vec2 low_mm;   // World position of the lower left corner of the tile.
uniform float texel_mm;

layout(location = 0) out vec4 out_albedo;    // sRGB-encoded.
layout(location = 1) out vec4 out_surface;   // Unused, roughness, metallic: glTF 2.0, section 3.9.2.

void main() {
    vec2 at_mm = fma(gl_FragCoord.xy, vec2(texel_mm), low_mm);
    GroundMaterial m = ground_material(at_mm, GroundFootprint(vec2(1.0, 0.0), texel_mm, 0.0, texel_mm));
    out_albedo = vec4(srgb_encode(m.albedo), 1.0);
    out_surface = vec4(1.0, m.roughness, 0.0, 1.0);
}
