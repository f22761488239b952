// Compute stage of the background: shades every pixel as sky. Later passes overwrite pixels
// that see a surface. Reads the environment map. Writes display colour, coverage 0, and the sky's label
// and depth.
#version 430 core
#include "pixel_list.constants"
#include "variant.constants"
#include "display_color.glsl"
#include "output_images.glsl"
#include "shade_sky.glsl"
#include "view_ray.glsl"

layout(local_size_x = LIST_GROUP) in;   // Pixels of one row.

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (pixel.x >= imageSize(color_image).x) return;
    Shaded s = shade_sky(view_ray(vec2(pixel) + 0.5));
#if RADIANCE
    imageStore(color_image, pixel, vec4(s.color, s.cover));
#else
    imageStore(color_image, pixel, uvec4(packUnorm4x8(vec4(display_color(s.color), s.cover))));
#endif
    imageStore(label_image, pixel, uvec4(s.id | (s.damage << 16)));
    imageStore(depth_image, pixel, vec4(s.depth));
}
