// Fragment stage of the background without lens distortion.
// Reads the environment map at the interpolated coordinates. Writes display colour and coverage 0.
#version 430 core
#include "view.block"
#include "display_color.glsl"

uniform sampler2D environment_map;   // As in environment_map.glsl.

in vec2 map_uv;

layout(location = 0) out vec4 out_color;

void main() {
    vec3 radiance = textureLod(environment_map, map_uv, 0.0).rgb;
    out_color = vec4(display_color(exposure * radiance), 0.0);
}
