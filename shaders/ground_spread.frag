// Fragment stage that spreads ground shaded once per 2x2 pixels over the image.
// Reads what ground.frag drew at half the resolution. Writes display colour, the share that is not the
// panorama, no labels, and the depth of each pixel.
#version 430 core
#include "display_color.glsl"
#include "seen_plane.glsl"
#include "view_ray.glsl"

uniform sampler2D ground_coarse;   // Exposed radiance, share that is not the panorama.

layout(location = 0) out vec4 out_color;
layout(location = 1) out uint out_labels;
layout(location = 2) out float out_depth;

void main() {
    vec3 at;
    float share;
    out_depth = seen_plane(view_ray(gl_FragCoord.xy), at, share);
    if (isinf(out_depth)) discard;
    vec2 size = vec2(textureSize(ground_coarse, 0));
    vec4 color = textureLod(ground_coarse, 0.5 * gl_FragCoord.xy / size, 0.0);
    out_color = vec4(display_color(color.rgb), color.a);
    out_labels = 0u;
}
