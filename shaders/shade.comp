// Compute stage that shades the listed pixels of one pixel class.
// Reads the list, the visibility buffer, material tables and lights. Writes colour and
// coverage, labels near decals and damages, and depth near holes.
#version 430 core
#include "pixel_list.constants"
#include "variant.constants"
#include "display_color.glsl"
#include "output_images.glsl"
#include "pixel_list.glsl"
#include "shade_single_surface.glsl"
#include "shade_mixed.glsl"

layout(local_size_x = LIST_GROUP) in;

void main() {
    if (gl_GlobalInvocationID.x >= pixels_listed()) return;
    ivec2 pixel = listed_pixel(gl_GlobalInvocationID.x);
#if WITH_MIXED
    bool at_body;
    Shaded s = shade_mixed(pixel, at_body);
#else
    const bool at_body = true;
    Shaded s = shade_single_surface(pixel);
    s.color = display_color(s.color);
#endif
#if RADIANCE
    vec4 shown = vec4(s.color, s.cover);
#else
    uvec4 shown = uvec4(packUnorm4x8(vec4(s.color, s.cover)));
#endif
    imageStore(color_image, pixel, shown);
    // For other classes classify.comp has written labels and depth.
#if OVER
    if (!at_body) return;   // What lies behind has its labels already.
#endif
#if WITH_DECALS || WITH_DAMAGE
    imageStore(label_image, pixel, uvec4(s.id | (s.damage << 16)));
#endif
#if WITH_HOLES
    imageStore(depth_image, pixel, vec4(s.depth));
#endif
}
