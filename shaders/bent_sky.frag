// Shades the sky where a lens bends it, and what layers other than all of them show in its place.
#version 430 core
#include "blocks.glsl"
#include "shade.glsl"

layout(location = 0) out vec4 out_color;

void main() {
    out_color = vec4(developed(sky(view_ray(gl_FragCoord.xy)).color), 0.0);
}
