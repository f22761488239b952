// Shades the pixels of one class that see a single surface, or only the sky.
#version 430 core
#include "blocks.glsl"
#include "shade.glsl"

layout(location = 0) out vec4 out_color;
layout(location = 1) out uint out_labels;   // object id | damage value << 16
layout(location = 2) out float out_depth;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
#if CLASS == CLASS_SKY
    Shaded s = sky(view_ray(vec2(pixel) + 0.5));
#else
    Shaded s = single_surface(pixel);
#endif
    out_color = vec4(developed(s.color), 1.0);
    out_labels = s.id | (s.damage << 16);
    out_depth = s.depth;
}
