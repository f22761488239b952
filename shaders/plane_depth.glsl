// float plane_depth(vec3 ray, out vec3 at): depth at which a view ray meets the ground, infinite beyond
// the ground's reach. at: World position in m where it meets the plane.

#include "units.constants"
#include "ground.block"
#include "view.block"

float plane_depth(vec3 ray, out vec3 at) {
    float depth = (ground_height_m - eye_m.z) / ray.z;
    at = fma(vec3(depth), ray, eye_m);
    return depth > 0.0 && dot(at.xy, at.xy) < ground_reach_m * ground_reach_m ? depth : NO_DEPTH;
}
