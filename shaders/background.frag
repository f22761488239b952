// Fragment stage of the background without lens distortion.
// Reads the environment map at the interpolated coordinates. Writes display colour and coverage 0.
#version 430 core
#include "samples.constants"
#include "view.block"
#include "display_color.glsl"

uniform sampler2D environment_map;   // As in environment_map.glsl.

in vec2 map_uv;

layout(location = 0) out vec4 out_color;

void main() {
    // The coordinates are linear on each face of the octahedron. Lookups beyond the edge of a face are
    // off by less than a quarter of a pixel.
    mat2 pixel = mat2(dFdx(map_uv), dFdy(map_uv));
    vec3 sum = vec3(0.0);
    for (int i = 0; i < SKY_SAMPLES; ++i)
        sum += textureLod(environment_map, map_uv + pixel * SKY_PLACE[i], 0.0).rgb;
    out_color = vec4(display_color(exposure / float(SKY_SAMPLES) * sum), 0.0);
}
