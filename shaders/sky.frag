// Shades the pixels that see only the sky.
#version 430 core
#include "blocks.glsl"
#include "tone.glsl"

uniform sampler2D background_light;   // as in ibl.glsl

in vec2 map_uv;

layout(location = 0) out vec4 out_color;

void main() {
    vec3 radiance = textureLod(background_light, map_uv, 0.0).rgb;
    out_color = vec4(srgb_encode(neutral_tone(exposure * radiance)), 0.0);
}
