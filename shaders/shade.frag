// Shades the pixels of one class that see a single surface, or only the sky.
#version 430 core
#include "blocks.glsl"
#include "shade.glsl"

layout(location = 0) out vec4 out_color;
layout(location = 1) out uint out_labels;   // object id | damage value << 16
layout(location = 2) out float out_depth;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec2 center = vec2(pixel) + 0.5;
#if CLASS == CLASS_SKY
    Shaded s = sky(view_ray(center));
    vec3 color = s.color;
#else
    ivec2 middle = pixel * SAMPLES_PER_AXIS + SAMPLES_PER_AXIS / 2;
    uint key = texelFetch(surface_keys, middle, 0).r;
    vec3 view = -normalize(view_ray(center));
    Part p = part_at(middle, key, view);
    Shaded s = Shaded(vec3(0.0), p.id, p.damage, p.depth);
    vec3 color = part_color(p, key, view);
#endif
    out_color = vec4(srgb_encode(color), 1.0);
    out_labels = s.id | (s.damage << 16);
    out_depth = s.depth;
}
