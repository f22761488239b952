// vec3 view_ray(vec2 pixel): ray from the eye through a position in the image, in the world frame.
// Its length is 1 m of depth along the optical axis.

#include "view.block"
#include "lens.glsl"

vec3 view_ray(vec2 pixel) {
    pixel = undistorted(pixel);
    return fma(vec3(pixel.x), ray_right, fma(vec3(pixel.y), ray_down, ray_corner));
}
