// Fragment stage of the background, seen through a distorting lens or in a single-layer image.
// Reads the environment map along the pixel's view ray. Writes display colour and coverage 0.
#version 430 core
#include "display_color.glsl"
#include "shade_sky.glsl"
#include "view_ray.glsl"

layout(location = 0) out vec4 out_color;

void main() {
    out_color = vec4(display_color(shade_sky(view_ray(gl_FragCoord.xy)).color), 0.0);
}
