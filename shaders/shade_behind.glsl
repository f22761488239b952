// Shaded shade_behind(ivec2 pixel, vec3 ray): what lies behind the container at a pixel: the sky, or with
// OVER the image as it is, with its coverage.
// vec3 blend_over(vec3 color, Shaded behind, float share): display colour of a pixel of which `share` shows
// what lies behind, and the rest exposed radiance `color`.

#include "variant.constants"
#include "display_color.glsl"
#include "output_images.glsl"
#include "shade_sky.glsl"

Shaded shade_behind(ivec2 pixel, vec3 ray) {
    Shaded s = shade_sky(ray);
#if OVER
#if RADIANCE
    vec4 shown = imageLoad(color_image, pixel);
#else
    vec4 shown = unpackUnorm4x8(imageLoad(color_image, pixel).r);
#endif
    s.color = shown.rgb;
    s.cover = shown.a;
#endif
    return s;
}

vec3 blend_over(vec3 color, Shaded behind, float share) {
#if OVER && !RADIANCE
    // The image is tone-mapped already, so the two are mixed as light of the display.
    vec3 light = srgb_decode(display_color(color));
    return srgb_encode(mix(light, srgb_decode(behind.color), share));
#else
    return display_color(mix(color, behind.color, share));
#endif
}
