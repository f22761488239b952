// vec3 ground_ray(vec2 pixel): view ray through a position in the image, as view_ray().
// float plane_depth(vec3 ray, out vec3 at): depth at which it meets the ground, infinite beyond the
// ground's reach. at: World position in m where it meets the plane.

#include "ground.constants"
#include "units.constants"
#include "ground.block"
#include "view.block"
#include "view_ray.glsl"

vec3 ground_ray(vec2 pixel) {
#if GROUND_LENS
    return view_ray(pixel);
#else
    return fma(vec3(pixel.x), ray_right, fma(vec3(pixel.y), ray_down, ray_corner));
#endif
}

float plane_depth(vec3 ray, out vec3 at) {
    float depth = (ground_height_m - eye_m.z) / ray.z;
    at = fma(vec3(depth), ray, eye_m);
    return depth > 0.0 && dot(at.xy, at.xy) < ground_reach_m * ground_reach_m ? depth : NO_DEPTH;
}
