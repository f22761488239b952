// Fragment stage of the background without lens distortion.
// Reads the environment map at the interpolated coordinates. Writes display colour and coverage 0.
#version 430 core
#include "variant.constants"
#include "view.block"
#include "tone_curve.glsl"

uniform sampler2D environment_map;   // As in environment_map.glsl.

in vec2 map_uv;

layout(location = 0) out vec4 out_color;

void main() {
    vec3 radiance = textureLod(environment_map, map_uv, 0.0).rgb;
#if RADIANCE
    out_color = vec4(exposure * radiance, 0.0);
#else
    out_color = vec4(srgb_encode(neutral_tone(exposure * radiance)), 0.0);
#endif
}
